// What a part says of settings that it refuses, as an error of the file that they come from.
#pragma once

#include <string>
#include <string_view>

namespace combforce {

struct FieldMessage {
  std::string pointer;  // JSON pointer of the field; "": the text names none
  std::string message;
};

// "PREFIXscan.size_nm[0]: 3, must be 4" -> {"/scan/size_nm/0", "3, must be 4"}; the prefix may be absent.
// Reentrant.
FieldMessage split_field(std::string_view text, std::string_view prefix = "");

}  // namespace combforce
