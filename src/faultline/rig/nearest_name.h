// The name that somebody may have meant: the one with the fewest edits to what stands there (Levenshtein, Binary codes
// capable of correcting deletions, insertions and reversals, 1966), if they are at most a third of its letters.
#pragma once

#include <string>
#include <vector>

namespace faultline {

std::string nearest_name(const std::string& word, const std::vector<std::string>& names);  // empty: none is near

// "; did you mean 'NAME'?" for the end of a message, or nothing.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& names);

}  // namespace faultline
