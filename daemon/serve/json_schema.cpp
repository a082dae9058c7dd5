#include "daemon/serve/json_schema.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <regex>
#include <stdexcept>
#include <string>
#include <string_view>

namespace combforce {

namespace {

constexpr std::array<std::string_view, 17> keywords{
    "type",  "properties",  "required", "additionalProperties", "items",     "minItems",  "maxItems",
    "enum",  "minimum",     "maximum",  "exclusiveMinimum",     "minLength", "maxLength", "pattern",
    "title", "description", "default"};

bool has_type(const Json& value, std::string_view type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "integer") return value.is_number_integer();
  if (type == "number") return value.is_number();
  if (type == "boolean") return value.is_boolean();
  throw std::logic_error(fmt::format("schema: unknown type {}", type));
}

void check_object(const JsonView& value, const Json& schema) {
  const Json properties = schema.value("properties", Json::object());
  const bool closed = schema.contains("additionalProperties") && schema["additionalProperties"] == false;
  if (schema.contains("required")) {
    for (const auto& key : schema["required"]) value.get(key.get_ref<const std::string&>());
  }
  for (const auto& item : value.json().items()) {
    const auto property = properties.find(item.key());
    const JsonView member = value.get(item.key());
    if (property != properties.end()) {
      check_schema(member, *property);
    } else if (closed) {
      member.fail("unknown parameter");
    }
  }
}

void check_array(const JsonView& value, const Json& schema) {
  const std::size_t size = value.json().size();
  if (schema.contains("minItems") && size < schema["minItems"].get<std::size_t>()) {
    value.fail(fmt::format("has {} items, needs at least {}", size, schema["minItems"].dump()));
  }
  if (schema.contains("maxItems") && size > schema["maxItems"].get<std::size_t>()) {
    value.fail(fmt::format("has {} items, may have at most {}", size, schema["maxItems"].dump()));
  }
  if (!schema.contains("items")) return;
  for (const JsonView& element : value.elements()) check_schema(element, schema["items"]);
}

void check_number(const JsonView& value, const Json& schema) {
  const auto number = value.json().get<double>();
  if (schema.contains("minimum") && number < schema["minimum"].get<double>()) {
    value.fail(fmt::format("{} is below {}", value.json().dump(), schema["minimum"].dump()));
  }
  if (schema.contains("maximum") && number > schema["maximum"].get<double>()) {
    value.fail(fmt::format("{} is above {}", value.json().dump(), schema["maximum"].dump()));
  }
  if (schema.contains("exclusiveMinimum") && number <= schema["exclusiveMinimum"].get<double>()) {
    value.fail(fmt::format("{} is not above {}", value.json().dump(), schema["exclusiveMinimum"].dump()));
  }
}

void check_string(const JsonView& value, const Json& schema) {
  const auto& text = value.json().get_ref<const std::string&>();
  if (schema.contains("enum")) {
    const Json& names = schema["enum"];
    if (std::ranges::find(names, value.json()) == names.end()) {
      value.fail(fmt::format("\"{:.40}\" is none of {}", text, names.dump()));
    }
  }
  if (schema.contains("minLength") && text.size() < schema["minLength"].get<std::size_t>()) {
    value.fail(fmt::format("has {} characters, needs at least {}", text.size(), schema["minLength"].dump()));
  }
  if (schema.contains("maxLength") && text.size() > schema["maxLength"].get<std::size_t>()) {
    value.fail(
        fmt::format("has {} characters, may have at most {}", text.size(), schema["maxLength"].dump()));
  }
  if (schema.contains("pattern") &&
      !std::regex_search(text, std::regex(schema["pattern"].get<std::string>()))) {
    value.fail(fmt::format("\"{:.40}\" does not match {}", text, schema["pattern"].get<std::string>()));
  }
}

}  // namespace

void check_schema(const JsonView& value, const Json& schema) {
  for (const auto& item : schema.items()) {
    if (std::ranges::find(keywords, item.key()) == keywords.end()) {
      throw std::logic_error(fmt::format("schema: unknown keyword {}", item.key()));
    }
  }
  if (schema.contains("type") && !has_type(value.json(), schema["type"].get_ref<const std::string&>())) {
    value.fail(fmt::format("is of type {}, not {}", value.json().type_name(),
                           schema["type"].get_ref<const std::string&>()));
  }
  if (value.json().is_object()) check_object(value, schema);
  if (value.json().is_array()) check_array(value, schema);
  if (value.json().is_number()) check_number(value, schema);
  if (value.json().is_string()) check_string(value, schema);
}

}  // namespace combforce
