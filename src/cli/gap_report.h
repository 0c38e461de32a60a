// The HTML report of a gap diagnosis. A Python script draws it from the answer and the series, which are handed over as
// files in a folder of their own that vanishes afterwards. The script lies in the share folder's scripts/ (source tree)
// or beside the program (install space). The interpreter is $FAULTLINE_PYTHON, else the system's /usr/bin/python3, else
// the python3 on PATH.
#pragma once

#include <string>
#include <vector>

namespace faultline {

// InputError with one line that says what is missing, where no report can be made on this machine. Takes about a
// second: to be asked before the diagnosis, which takes longer.
void check_gap_report();

struct GapReportInput {
  std::string answer;     // JSON text
  std::string series;     // CSV text
  std::string datasheet;  // file
  std::string command;    // how the diagnosis was asked for
  std::vector<std::string> recordings;
};

void write_gap_report(const GapReportInput& input, const std::string& file);

}  // namespace faultline
