#include "config/field_message.hpp"

#include <gtest/gtest.h>

namespace combforce {
namespace {

TEST(FieldMessage, IsAPointerAndTheRest) {
  const struct {
    const char *text, *prefix, *pointer, *message;
  } cases[] = {
      {"gain: 3, must be 2", "", "/gain", "3, must be 2"},
      {"simulation.faults[10].sample: 3", "simulation.", "/faults/10/sample", "3"},
      {"scan.size_nm[0]: 1, must be: 2", "simulation.", "/scan/size_nm/0", "1, must be: 2"},
      {"no model: dmt", "", "", "no model: dmt"},
      {"nothing", "", "", "nothing"},
  };
  for (const auto& one : cases) {
    const FieldMessage split = split_field(one.text, one.prefix);
    EXPECT_EQ(split.pointer, one.pointer) << one.text;
    EXPECT_EQ(split.message, one.message) << one.text;
  }
}

}  // namespace
}  // namespace combforce
