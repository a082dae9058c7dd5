#include "proto/fields.hpp"

#include <fmt/format.h>

namespace combforce {

void check_keys(const JsonView& view, UnknownKeys unknown, std::initializer_list<std::string_view> keys) {
  if (unknown == UnknownKeys::refuse) view.only(keys);
}

double number_or(const JsonView& view, std::string_view key, double otherwise, Range range) {
  const auto member = view.find(key);
  return member ? member->number(range) : otherwise;
}

std::uint64_t integer_or(const JsonView& view, std::string_view key, std::uint64_t otherwise) {
  const auto member = view.find(key);
  return member ? member->integer() : otherwise;
}

std::uint32_t count(const JsonView& view, std::uint32_t most) {
  return static_cast<std::uint32_t>(view.integer(1, most));
}

double non_zero(const JsonView& view) {
  const double value = view.number();
  if (value == 0.0) view.fail("is 0, must not be 0");
  return value;
}

std::vector<JsonView> not_empty(const JsonView& view) {
  auto elements = view.elements();
  if (elements.empty()) view.fail("is empty, must have at least one element");
  return elements;
}

std::vector<double> numbers(const JsonView& view, Range range) {
  std::vector<double> values;
  for (const auto& element : view.elements()) values.push_back(element.number(range));
  return values;
}

std::array<double, 2> interval(const JsonView& view) {
  const auto ends = numbers(view, any_number);
  if (ends.size() != 2) view.fail(fmt::format("has {} elements, must be [lo, hi]", ends.size()));
  if (!(ends[0] < ends[1]))
    view.fail(fmt::format("is [{}, {}], must be [lo, hi] with lo < hi", ends[0], ends[1]));
  return {ends[0], ends[1]};
}

std::vector<std::complex<double>> phasors(const JsonView& view) {
  std::vector<std::complex<double>> values;
  for (const auto& phasor : not_empty(view)) values.push_back(phasor.complex());
  return values;
}

Json encode_phasors(std::span<const std::complex<double>> phasors) {
  Json list = Json::array();
  for (const auto& phasor : phasors) list.push_back(Json::array({phasor.real(), phasor.imag()}));
  return list;
}

}  // namespace combforce
