// Lines to a file or to stdout.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

namespace combforce {

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
