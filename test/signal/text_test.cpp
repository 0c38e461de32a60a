#include "faultline/signal/text.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(Text, FindsTheFirstByteThatIsNoUtf8) {
  const auto none = std::string::npos;
  EXPECT_EQ(invalid_utf8(""), none);
  EXPECT_EQ(invalid_utf8("plain\n"), none);
  EXPECT_EQ(invalid_utf8("m\xC2\xB2 \xE2\x82\xAC \xF0\x9F\x94\xA7"), none);  // two, three and four bytes
  EXPECT_EQ(invalid_utf8("caf\xE9"), 3u);                                    // Latin-1
  EXPECT_EQ(invalid_utf8("ab\x80"), 2u);                                     // begins in the middle
  EXPECT_EQ(invalid_utf8("ab\xE2\x82"), 2u);                                 // ends too early
  EXPECT_EQ(invalid_utf8("\xC0\xAF"), 0u);                                   // longer than needed
  EXPECT_EQ(invalid_utf8("\xE0\x9F\xBF"), 0u);
  EXPECT_EQ(invalid_utf8("a\xED\xA0\x80"), 1u);  // a surrogate
  EXPECT_EQ(invalid_utf8("\xF4\x90\x80\x80"), 0u);
  EXPECT_EQ(invalid_utf8("\xFF"), 0u);
}

TEST(Text, ShowsInOneLineWhatATerminalDoesNotActOn) {
  EXPECT_EQ(printable("m\xC2\xB2 is fine"), "m\xC2\xB2 is fine");
  EXPECT_EQ(printable("a\xFF\xFE\nb\x1B[31m\x7F"), "a???b?[31m?");
  EXPECT_EQ(printable("\xC2\x9B"
                      "1m"),
            "?1m");  // a control sequence in one character
  EXPECT_EQ(printable(std::string("a\0b", 3)), "a?b");
}

}  // namespace
}  // namespace faultline
