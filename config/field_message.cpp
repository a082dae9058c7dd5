#include "config/field_message.hpp"

#include <algorithm>
#include <cctype>

namespace combforce {

FieldMessage split_field(std::string_view text, std::string_view prefix) {
  if (text.starts_with(prefix)) text.remove_prefix(prefix.size());
  const std::size_t colon = text.find(": ");
  const std::string_view field = text.substr(0, colon);
  const auto in_name = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  const auto in_field = [&](char c) {
    return in_name(static_cast<unsigned char>(c)) || c == '.' || c == '[' || c == ']';
  };
  if (colon == std::string_view::npos || !std::ranges::all_of(field, in_field))
    return {"", std::string(text)};
  FieldMessage split{"/", std::string(text.substr(colon + 2))};
  for (const char c : field) {
    if (c == ']') continue;
    split.pointer += c == '.' || c == '[' ? '/' : c;
  }
  return split;
}

}  // namespace combforce
