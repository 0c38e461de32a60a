// Text that came from a file, a file's name or the command line, and may hold any bytes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace faultline {

// Where the first byte stands that begins no valid UTF-8 character (Unicode 15, table 3-7); npos: there is none.
std::size_t invalid_utf8(const std::string& text);

// What a message can show: valid UTF-8 in one line. Every byte that is no text, and every control character, becomes
// '?'.
std::string printable(const std::string& text);

// "a, b" as a and b; blanks do not count.
std::vector<std::string> split_list(const std::string& text);

}  // namespace faultline
