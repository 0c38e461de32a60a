// Text of a drawing: pure functions.
#pragma once

#include <cstddef>
#include <string>

#include "faultline/signal/channel.h"

namespace faultline {

// A value as people at a stand read it: decimals and a prefix that follow from the channel's range, so that they do
// not jump; m^3/s in l/min. "4.52 MPa".
std::string shown_value(double value, const Channel& channel);

// Lines of at most `width` letters where the words allow it.
std::string wrapped(const std::string& text, std::size_t width);

// A name of a datasheet as words: "leak flow".
std::string words_of(const std::string& name);

}  // namespace faultline
