#include "daemon/serve/line_framer.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

namespace combforce {
namespace {

using testing::ElementsAre;

class Lines {
 public:
  explicit Lines(std::size_t limit) : framer_(limit) {}

  bool feed(std::string_view bytes) {
    return framer_.feed(bytes, [this](std::string_view line) { lines.emplace_back(line); });
  }

  std::vector<std::string> lines;

 private:
  LineFramer framer_;
};

TEST(LineFramer, CutsLinesHoweverTheBytesCome) {
  const std::string stream = "one\ntwo\r\n\nfour";
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    Lines lines(100);
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      EXPECT_TRUE(lines.feed(std::string_view(stream).substr(at, piece)));
    }
    EXPECT_THAT(lines.lines, ElementsAre("one", "two", "")) << "in pieces of " << piece;
    EXPECT_TRUE(lines.feed("\n"));
    EXPECT_EQ(lines.lines.back(), "four");
  }
}

TEST(LineFramer, TakesALineOfTheLimitAndRefusesOneByteMore) {
  Lines exact(5);
  EXPECT_TRUE(exact.feed("12345\n"));
  EXPECT_THAT(exact.lines, ElementsAre("12345"));

  Lines whole(5);
  EXPECT_FALSE(whole.feed("123456\n"));
  Lines unfinished(5);
  EXPECT_TRUE(unfinished.feed("12345"));
  EXPECT_FALSE(unfinished.feed("6"));
  Lines after_another(5);
  EXPECT_FALSE(after_another.feed("ok\n123456"));
  EXPECT_THAT(after_another.lines, ElementsAre("ok"));
}

}  // namespace
}  // namespace combforce
