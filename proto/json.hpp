// Strict JSON: every error says file, JSON pointer, value and bound.
//
// parse_json() refuses duplicate keys; a JsonView walks the tree and checks types, bounds and keys.
#pragma once

#include <complex>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace combforce {

using Json = nlohmann::ordered_json;

// Bad input from a file or a client: what() is "FILE: POINTER: MESSAGE", empty parts left out.
class InputError : public std::runtime_error {
 public:
  InputError(std::string file, std::string pointer, const std::string& message);
  const std::string& file() const { return file_; }
  const std::string& pointer() const { return pointer_; }  // "" is the root
  const std::string& message() const { return message_; }

 private:
  std::string file_, pointer_, message_;
};

enum class Comments : std::uint8_t { refuse, allow };

// Throws InputError on malformed text (with line and column), duplicate keys (with their pointer), numbers
// that do not fit a double, and nesting deeper than 64 levels. `file` is only a name for messages.
Json parse_json(std::string_view text, const std::string& file, Comments comments = Comments::refuse);
Json parse_json_file(const std::string& path, Comments comments = Comments::refuse);  // also when unreadable

struct Range {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool lower_open = false, upper_open = false;
};
inline constexpr Range any_number{};
inline constexpr Range positive{0.0, std::numeric_limits<double>::infinity(), true, false};
inline constexpr Range non_negative{0.0};

// A value in a parsed tree, with its place. Cheap to copy; the tree and the string `file` must outlive it.
class JsonView {
 public:
  JsonView(const Json& value, const std::string& file, std::string pointer = "");

  const Json& json() const { return *value_; }
  const std::string& file() const { return *file_; }
  const std::string& pointer() const { return pointer_; }
  [[noreturn]] void fail(const std::string& message) const;  // throws InputError at this place

  // Members of an object. get() fails when the key is missing, find() is empty then; null is a value.
  JsonView get(std::string_view key) const;
  std::optional<JsonView> find(std::string_view key) const;
  // Fails on the first key that is not among these ("unknown key …; expected one of …").
  void only(std::initializer_list<std::string_view> keys) const;

  // Elements of an array; fails when it is none.
  std::vector<JsonView> elements() const;
  std::size_t size() const;

  // Values; each fails with the type found, or with value and bound. 8e3 is an integer too.
  double number(Range range = any_number) const;
  std::uint64_t integer(std::uint64_t lower = 0, std::uint64_t upper = (std::uint64_t{1} << 53) - 1) const;
  bool boolean() const;
  std::string string() const;
  std::complex<double> complex() const;  // [re, im]
  // One of the given names; returns its index.
  std::size_t one_of(std::span<const std::string_view> names) const;
  std::size_t one_of(std::initializer_list<std::string_view> names) const {
    return one_of(std::span(names.begin(), names.size()));
  }

 private:
  const Json* value_;
  const std::string* file_;
  std::string pointer_;
};

// Numbers as messages carry them: 9 significant digits, null when not finite.
Json number9(double value);

}  // namespace combforce
