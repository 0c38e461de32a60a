// A recording from a .bag or .csv file together with the datasheet of its rig, checked against it: what diagnose,
// export and every other subcommand that reads recordings begins with.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "faultline/signal/sample_check.h"

namespace faultline {

struct LoadedRecording {
  Datasheet sheet;
  Recording recording;              // in the datasheet's order of channels; times as a live node would see them
  std::vector<std::int64_t> stamp;  // ns since 1970, one per row: the times without rounding
  double start = 0;                 // s, time of the first sample
  double end = 0;                   // s, the latest time
  SampleFindings findings;
  std::vector<std::string> remarks;  // what a user should know, one line each
  std::string made_by;               // from the bag's description
};

// The datasheet of `rig` from the shared config folder or from a package outside this tree, or that of the file
// `config` (whose rig must be `rig`, if that is given).
Datasheet load_datasheet(const std::string& rig, const std::string& config);

// `rig` may be empty for a bag, which says itself; a CSV file needs it or `config`.
LoadedRecording load_recording(const std::string& file, const std::string& rig, const std::string& config);

// Once: what is wrong with rigs outside this tree other than the one that is asked for, on stderr.
void note_left_out(const std::string& asked_for);

void print_remarks(const std::string& subcommand, const std::vector<std::string>& remarks);  // on stderr

}  // namespace faultline
