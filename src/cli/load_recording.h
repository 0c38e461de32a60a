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

// What is told of a recording beside its samples.
struct RecordingFacts {
  Datasheet sheet;
  double start = 0;  // s, time of the first sample
  double end = 0;    // s, the latest time
  SampleFindings findings;
  std::uint64_t missed_at_start = 0;  // samples of the run before the first one (run_start.h)
  std::vector<std::string> remarks;   // what a user should know, one line each
  std::string made_by;                // from the bag's description
};

struct LoadedRecording : RecordingFacts {
  Recording recording;              // in the datasheet's order of channels; times as a live node would see them
  std::vector<std::int64_t> stamp;  // ns since 1970, one per row: the times without rounding
  double run_start = 0;             // s, of the run's first sample, as a bag's description says; 0: not known
};

// The datasheet of `rig` from the shared config folder or from a package outside this tree, or that of the file
// `config` (whose rig must be `rig`, if that is given).
Datasheet load_datasheet(const std::string& rig, const std::string& config);

// At which period samples must come: the datasheet's, or for what models are fitted to any, up to twenty times longer
// or shorter than that.
enum class Period { of_rig, of_run };

// `rig` may be empty for a bag, which says itself; a CSV file needs it or `config`.
LoadedRecording load_recording(const std::string& file, const std::string& rig, const std::string& config,
                               Period period = Period::of_rig);

// Of readings that were interpolated onto a finer grid the samples between which they were (segments/own_samples.h),
// with a remark: what fits models to a run at the run's own period takes no more.
void keep_own_samples(const std::string& file, LoadedRecording& loaded);

// Takes samples one by one, in the datasheet's order of channels.
class SampleTaker {
 public:
  virtual ~SampleTaker() = default;
  // Before the first sample; it is of time `start`. A second time where a bag turned out not to be in the order of its
  // receive times: all begins anew.
  virtual void begin(const Datasheet& sheet, double start) = 0;
  virtual void take(const Sample& sample) = 0;
};

// The same checks, without keeping the samples: those of a bag are taken as they are read. What is wrong with the
// recording as a whole is told (InputError) in the end.
RecordingFacts stream_recording(const std::string& file, const std::string& rig, const std::string& config,
                                SampleTaker& taker);

// Once: what is wrong with rigs outside this tree other than the one that is asked for, on stderr.
void note_left_out(const std::string& asked_for);

void print_remarks(const std::string& subcommand, const std::vector<std::string>& remarks);  // on stderr

}  // namespace faultline
