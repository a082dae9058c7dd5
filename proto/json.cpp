#include "proto/json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <unordered_set>

#include "proto/text_file.hpp"

namespace combforce {
namespace {

std::string member_pointer(const std::string& parent, std::string_view key) {
  std::string pointer = parent + '/';
  for (const char c : key) {
    if (c == '~') {
      pointer += "~0";
    } else if (c == '/') {
      pointer += "~1";
    } else {
      pointer += c;
    }
  }
  return pointer;
}

std::string line_and_column(std::string_view text, std::size_t bytes_read) {
  const std::string_view before = text.substr(0, bytes_read > 0 ? bytes_read - 1 : 0);
  const auto line_start = before.rfind('\n');
  return fmt::format("line {}, column {}", 1 + std::ranges::count(before, '\n'),
                     before.size() - (line_start == std::string_view::npos ? 0 : line_start + 1) + 1);
}

// Builds the tree as the parser reads; knows where it is, so that errors carry a pointer.
class TreeBuilder : public nlohmann::json_sax<Json> {
 public:
  TreeBuilder(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  Json take() { return std::move(root_); }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(std::int64_t value) override { return add(value); }
  bool number_unsigned(std::uint64_t value) override { return add(value); }
  bool number_float(double value, const std::string& /*text*/) override { return add(value); }
  bool string(std::string& value) override { return add(std::move(value)); }
  bool binary(Json::binary_t& /*value*/) override { return false; }  // not of JSON texts

  bool start_object(std::size_t /*size*/) override { return open(Json::object()); }
  bool start_array(std::size_t /*size*/) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(std::string& name) override {
    Level& level = levels_.back();
    level.key = name;
    if (!level.keys.insert(name).second) throw InputError(file_, pointer(), "duplicate key");
    return true;
  }

  bool parse_error(std::size_t position, const std::string& /*token*/,
                   const nlohmann::detail::exception& error) override {
    const std::string_view what = error.what();
    const bool syntax = dynamic_cast<const nlohmann::detail::parse_error*>(&error) != nullptr;
    const std::string_view separator = syntax ? ": " : "] ";
    const auto start = what.find(separator);
    throw InputError(file_, syntax ? "" : pointer(),
                     fmt::format("{}: {}", line_and_column(text_, position),
                                 start == std::string_view::npos ? what : what.substr(start + 2)));
  }

 private:
  struct Level {
    Json* value;
    std::string key;  // of an object: the member being read
    std::unordered_set<std::string> keys;
  };

  Json* place(Json&& value) {
    if (levels_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Level& level = levels_.back();
    if (level.value->is_array()) {
      level.value->push_back(std::move(value));
      return &level.value->back();
    }
    // Not operator[], which searches the whole object: key() has seen to uniqueness.
    auto& members = level.value->get_ref<Json::object_t&>();
    members.emplace_back(level.key, std::move(value));
    return &members.back().second;
  }

  bool add(Json value) {
    place(std::move(value));
    return true;
  }

  bool open(Json&& value) {
    if (levels_.size() == max_depth)
      throw InputError(file_, pointer(), fmt::format("nested deeper than {} levels", max_depth));
    levels_.push_back({place(std::move(value)), {}, {}});
    return true;
  }

  bool close() {
    levels_.pop_back();
    return true;
  }

  std::string pointer() const {
    std::string result;
    for (const Level& level : levels_) {
      const bool innermost = &level == &levels_.back();
      if (level.value->is_object()) {
        result = member_pointer(result, level.key);
      } else {
        result += fmt::format("/{}", innermost ? level.value->size() : level.value->size() - 1);
      }
    }
    return result;
  }

  static constexpr std::size_t max_depth = 64;
  std::string_view text_;
  const std::string& file_;
  Json root_;
  std::vector<Level> levels_;
};

// The value as it stands, short enough for a message.
std::string shown(const Json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array";
  constexpr std::size_t longest = 60;
  std::string text = value.dump(-1, ' ', true);
  if (text.size() > longest) text = text.substr(0, longest) + "…";
  return text;
}

std::string shown(const Range& range) {
  const bool below = std::isfinite(range.lower);
  const bool above = std::isfinite(range.upper);
  if (below && above)
    return fmt::format("in {}{}, {}{}", range.lower_open ? '(' : '[', range.lower, range.upper,
                       range.upper_open ? ')' : ']');
  if (below) return fmt::format("{} {}", range.lower_open ? ">" : ">=", range.lower);
  return fmt::format("{} {}", range.upper_open ? "<" : "<=", range.upper);
}

std::string quoted(std::span<const std::string_view> names) {
  std::string text;
  for (const auto name : names) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", name);
  return text;
}

std::string error_text(const std::string& file, const std::string& pointer, const std::string& message) {
  std::string text;
  for (const auto& part : {file, pointer})
    if (!part.empty()) text += part + ": ";
  return text + message;
}

}  // namespace

InputError::InputError(std::string file, std::string pointer, const std::string& message)
    : std::runtime_error(error_text(file, pointer, message)),
      file_(std::move(file)),
      pointer_(std::move(pointer)),
      message_(message) {}

Json parse_json(std::string_view text, const std::string& file, Comments comments) {
  TreeBuilder builder(text, file);
  Json::sax_parse(text, &builder, Json::input_format_t::json, true, comments == Comments::allow);
  return builder.take();
}

Json parse_json_file(const std::string& path, Comments comments) {
  return parse_json(read_text_file(path), path, comments);
}

JsonView::JsonView(const Json& value, const std::string& file, std::string pointer)
    : value_(&value), file_(&file), pointer_(std::move(pointer)) {}

void JsonView::fail(const std::string& message) const {
  throw InputError(*file_, pointer_, message);
}

std::optional<JsonView> JsonView::find(std::string_view key) const {
  if (!value_->is_object()) fail(fmt::format("is {}, must be an object", shown(*value_)));
  for (const auto& [name, member] : value_->get_ref<const Json::object_t&>())
    if (name == key) return JsonView(member, *file_, member_pointer(pointer_, key));
  return std::nullopt;
}

JsonView JsonView::get(std::string_view key) const {
  auto member = find(key);
  if (!member) throw InputError(*file_, member_pointer(pointer_, key), "is missing");
  return *std::move(member);
}

void JsonView::only(std::initializer_list<std::string_view> keys) const {
  if (!value_->is_object()) fail(fmt::format("is {}, must be an object", shown(*value_)));
  for (const auto& [name, member] : value_->get_ref<const Json::object_t&>())
    if (std::ranges::find(keys, name) == keys.end())
      throw InputError(
          *file_, member_pointer(pointer_, name),
          fmt::format("unknown key \"{}\"; expected one of {}", name, quoted({keys.begin(), keys.size()})));
}

std::vector<JsonView> JsonView::elements() const {
  std::vector<JsonView> views;
  views.reserve(size());
  for (const auto& element : *value_)
    views.emplace_back(element, *file_, fmt::format("{}/{}", pointer_, views.size()));
  return views;
}

std::size_t JsonView::size() const {
  if (!value_->is_array()) fail(fmt::format("is {}, must be an array", shown(*value_)));
  return value_->size();
}

double JsonView::number(Range range) const {
  if (!value_->is_number()) fail(fmt::format("is {}, must be a number", shown(*value_)));
  const auto value = value_->get<double>();
  const bool low = range.lower_open ? value <= range.lower : value < range.lower;
  const bool high = range.upper_open ? value >= range.upper : value > range.upper;
  if (low || high) fail(fmt::format("is {}, must be {}", shown(*value_), shown(range)));
  return value;
}

std::uint64_t JsonView::integer(std::uint64_t lower, std::uint64_t upper) const {
  if (!value_->is_number()) fail(fmt::format("is {}, must be an integer", shown(*value_)));
  const auto as_double = value_->get<double>();
  if (as_double != std::trunc(as_double)) fail(fmt::format("is {}, must be an integer", shown(*value_)));
  // 2^64: from here on the conversion would be undefined.
  const bool representable = as_double >= 0.0 && as_double < 18446744073709551616.0;
  const std::uint64_t value = representable ? value_->get<std::uint64_t>() : 0;
  if (!representable || value < lower || value > upper)
    fail(fmt::format("is {}, must be in [{}, {}]", shown(*value_), lower, upper));
  return value;
}

bool JsonView::boolean() const {
  if (!value_->is_boolean()) fail(fmt::format("is {}, must be true or false", shown(*value_)));
  return value_->get<bool>();
}

std::string JsonView::string() const {
  if (!value_->is_string()) fail(fmt::format("is {}, must be a string", shown(*value_)));
  return value_->get<std::string>();
}

std::complex<double> JsonView::complex() const {
  const auto parts = elements();
  if (parts.size() != 2) fail(fmt::format("has {} elements, must be [re, im]", parts.size()));
  return {parts[0].number(), parts[1].number()};
}

std::size_t JsonView::one_of(std::span<const std::string_view> names) const {
  const auto found = std::ranges::find(names, string());
  if (found == names.end()) fail(fmt::format("is {}, must be one of {}", shown(*value_), quoted(names)));
  return static_cast<std::size_t>(found - names.begin());
}

Json number9(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(fmt::format("{:.9g}", value).c_str(), nullptr);
}

}  // namespace combforce
