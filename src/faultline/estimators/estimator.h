// What runs inside an estimator stage: a filter of the Kalman family, a bank of least squares, the responses of a model
// to faults, a virtual sensor. The stage (estimator_stage.h) gates the samples and hands over channels that are fit to
// be used, each at its last good value; the estimator never sees a sample twice. Estimators register themselves by
// type, each in its own file.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/estimators/histogram_view.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/reference.h"
#include "faultline/signal/error.h"
#include "faultline/signal/registry.h"

namespace faultline {

class Estimator {
 public:
  virtual ~Estimator() = default;

  virtual std::vector<State> states() const = 0;                  // empty where it has none
  virtual std::vector<std::string> innovation_names() const = 0;  // what the innovation runs over
  virtual void begin(const double* channels) = 0;
  // From the last sample to this one, `dt` s, in `steps` steps of about one period. False: the state is no number any
  // more.
  virtual bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) = 0;
  // s without a sample, after which what it learnt of the rig still holds and it goes on; 0: it begins anew after any
  // gap (estimator_stage.h).
  virtual double bridges() const { return 0; }
  // Whether there is anything that the last write() has not told. False only where the type is occasional.
  virtual bool news() const { return true; }
  // Fills all but time, sequence, restarted and channel_status, which are there already. `begun`: this sample only
  // began it.
  virtual void write(const double* channels, bool begun, Estimate& estimate) const = 0;
  // As a detector has them (rig/reference.h): what it learnt of the healthy rig so far, none if that is nothing; and,
  // before the first sample, to go on from there. InputError where it does not fit.
  virtual std::optional<Reference> reference() const { return {}; }
  virtual void restore(const Reference&) { throw InputError("this type of estimator keeps no reference"); }
  virtual std::vector<HistogramView> histograms() const { return {}; }  // one per variable that it observes so
};

struct EstimatorType {
  static constexpr const char* kKind = "estimator type";
  std::string name;
  std::string family;  // kalman, parameter, response, ...: what a node hosts together (nodes/estimator_host.h)
  bool occasional;     // speaks now and then only (news()), not at every sample
  std::unique_ptr<Estimator> (*make)(const Datasheet& sheet, const StageSpec& spec);
};

template <class T>
std::unique_ptr<Estimator> make_estimator_of(const Datasheet& sheet, const StageSpec& spec) {
  return std::make_unique<T>(sheet, spec);
}

// InputError that lists the known types where there is none of that name.
inline const EstimatorType& estimator_type(const StageSpec& spec) {
  return registry<EstimatorType>().require(spec.type, spec.settings.where());
}

}  // namespace faultline

#define FAULTLINE_ESTIMATOR(name, ...) FAULTLINE_REGISTER(EstimatorType, name, __VA_ARGS__)
