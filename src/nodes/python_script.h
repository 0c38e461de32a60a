// Where our Python scripts are and what runs them: beside the program (install space), or in scripts/ of the tree that
// share/faultline/source_folder names (devel space). The interpreter is $FAULTLINE_PYTHON, else the system's
// /usr/bin/python3, else the python3 on PATH.
#pragma once

#include <string>

namespace faultline {

std::string find_script(const std::string& name);  // InputError where it is not there
std::string python_interpreter();

}  // namespace faultline
