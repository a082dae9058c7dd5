// Whole files of text.
#pragma once

#include <string>

namespace combforce {

// The bytes of a file. Throws InputError naming it when it is a directory or cannot be read.
std::string read_text_file(const std::string& path);

}  // namespace combforce
