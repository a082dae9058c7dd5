// Lines to a file or to stdout.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

namespace combforce {

// Throws std::runtime_error when `path`, about to be written, is one of these files that are read. Empty
// names and "-" are none.
void refuse_input(const std::string& path, const std::vector<std::string>& inputs);

// Thread-bound. Throws std::runtime_error naming the file when it cannot be opened or not all could be
// written.
class LineOutput {
 public:
  explicit LineOutput(const std::string& path);  // "-": stdout
  ~LineOutput();
  LineOutput(const LineOutput&) = delete;
  LineOutput& operator=(const LineOutput&) = delete;

  void write(std::string_view text);
  void flush();
  void close();  // reports what write() may have missed; the destructor cannot

 private:
  [[noreturn]] void fail() const;

  std::string path_;
  std::FILE* file_;
};

}  // namespace combforce
