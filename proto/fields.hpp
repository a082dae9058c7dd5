// What the codecs of several types read: numbers with defaults, lists, intervals, names of enumerators. Each
// fails with the pointer of what it read.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "proto/description.hpp"
#include "proto/json.hpp"

namespace combforce {

template <typename Enum>
std::string_view name_of(std::span<const std::string_view> names, Enum value) {
  return names[static_cast<std::size_t>(value)];
}

void check_keys(const JsonView& view, UnknownKeys unknown, std::initializer_list<std::string_view> keys);

double number_or(const JsonView& view, std::string_view key, double otherwise, Range range = any_number);
std::uint64_t integer_or(const JsonView& view, std::string_view key, std::uint64_t otherwise);
std::uint32_t count(const JsonView& view, std::uint32_t most = std::numeric_limits<std::uint32_t>::max());
double non_zero(const JsonView& view);

std::vector<JsonView> not_empty(const JsonView& view);  // elements
std::vector<double> numbers(const JsonView& view, Range range);
std::array<double, 2> interval(const JsonView& view);             // [lo, hi], lo < hi
std::vector<std::complex<double>> phasors(const JsonView& view);  // [[re, im], …], at least one
Json encode_phasors(std::span<const std::complex<double>> phasors);

}  // namespace combforce
