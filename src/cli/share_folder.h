// Where config/ and bags/ are: the one folder that holds both, whether the program runs from the source tree, from a
// devel space or from an install space. No path is compiled in. Tried in this order:
//   1. $FAULTLINE_SHARE
//   2. <prefix>/share/faultline, the program being <prefix>/lib/faultline/faultline   (install space)
//   3. the folder that <prefix>/share/faultline/source_folder names                   (devel space)
//   4. the working folder, if it is the source tree
// A folder counts if it holds config/. Throws InputError where none does.
#pragma once

#include <string>

namespace faultline {

std::string share_folder();

}  // namespace faultline
