#include "daemon/cli/line_output.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace combforce {

void refuse_input(const std::string& path, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code unknown;  // one of them does not exist
    if (std::filesystem::equivalent(path, input, unknown))
      throw std::runtime_error(fmt::format("{}: would overwrite {}, which is read", path, input));
  }
}

LineOutput::LineOutput(const std::string& path)
    : path_(path), file_(path == "-" ? stdout : std::fopen(path.c_str(), "we")) {
  if (file_ == nullptr) fail();
}

LineOutput::~LineOutput() {
  if (file_ != nullptr && file_ != stdout) std::fclose(file_);
}

void LineOutput::write(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), file_) != text.size()) fail();
}

void LineOutput::flush() {
  if (std::fflush(file_) != 0) fail();
}

void LineOutput::close() {
  std::FILE* const file = std::exchange(file_, nullptr);
  if (file == nullptr) return;
  if ((file == stdout ? std::fflush(file) : std::fclose(file)) != 0) fail();
}

void LineOutput::fail() const {
  throw std::runtime_error(fmt::format("{}: {}", path_ == "-" ? "stdout" : path_, std::strerror(errno)));
}

}  // namespace combforce
