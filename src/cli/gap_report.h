// The HTML report of a gap diagnosis. A Python script draws it from the answer and the series, which are handed over as
// files in a folder of their own that vanishes afterwards. Script and interpreter: nodes/python_script.h.
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
