// What runs inside an estimator stage: a filter of the Kalman family, or a bank of least squares. The stage gates the samples and
// hands over channels that are fit to be used, each at its last good value; the core never sees a sample twice.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class StageCore {
 public:
  virtual ~StageCore() = default;

  virtual std::vector<State> states() const = 0;
  virtual std::vector<std::string> innovation_names() const = 0;  // what the innovation runs over
  virtual void begin(const double* channels) = 0;
  // From the last sample to this one, `dt` s, in `steps` steps of about one period. False: the state is no number any more.
  virtual bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) = 0;
  // Whether there is anything that the last write() has not told. A core that has no state to follow speaks only then.
  virtual bool news() const { return true; }
  // Fills all but time, sequence, restarted and channel_status. `begun`: this sample only began the core.
  virtual void write(const double* channels, bool begun, Estimate& estimate) const = 0;
};

std::unique_ptr<StageCore> make_filter_core(const Datasheet& sheet, const StageSpec& spec);
std::unique_ptr<StageCore> make_relation_core(const Datasheet& sheet, const StageSpec& spec);
std::unique_ptr<StageCore> make_response_core(const Datasheet& sheet, const StageSpec& spec);

// Families of estimator types; each is hosted by a node of its own.
bool is_least_squares(const std::string& type);
bool is_fault_response(const std::string& type);

}  // namespace faultline
