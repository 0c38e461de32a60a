// The family of recursive state estimators: predict with a model, correct with what was measured. One instance runs at
// one rate; no call but the constructor and reset() allocates.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/estimator.h"
#include "faultline/estimators/process_model.h"

namespace faultline {

class StateEstimator {
 public:
  virtual ~StateEstimator() = default;

  // Begins anew with the given state and the diagonal of its covariance.
  virtual void reset(const double* state, const double* variance) = 0;
  // x-, P- after dt [s]; `noise_scale` multiplies Q (dt over the sample period).
  virtual void predict(double dt, double noise_scale) = 0;
  // The same, where `leader`, of the same type and model, has just done it from about the same state
  // (ProcessModel::near): its step may serve. Not after `leader` was corrected.
  virtual void predict_beside(const StateEstimator& /*leader*/, double dt, double noise_scale) {
    predict(dt, noise_scale);
  }
  // Corrects with y; rows with use[i] == false are left out. Sets innovation and its statistics.
  virtual void correct(const double* y, const bool* use) = 0;

  virtual const double* state() const = 0;
  virtual void covariance(double* row_major) const = 0;
  virtual const double* innovation() const = 0;
  virtual const double* innovation_std() const = 0;
  virtual double normalised_innovation() const = 0;
};

struct StateEstimatorType {
  static constexpr const char* kKind = "state estimator";
  std::string name;
  std::unique_ptr<StateEstimator> (*make)(const ProcessModel& model);  // `model` must outlive it
};

template <class T>
std::unique_ptr<StateEstimator> make_state_estimator_of(const ProcessModel& model) {
  return std::make_unique<T>(model);
}

// InputError that lists the known types where there is none of that name.
inline std::unique_ptr<StateEstimator> make_state_estimator(const std::string& type, const ProcessModel& model) {
  return registry<StateEstimatorType>().require(type, "estimator").make(model);
}

// The stage around a state estimator: `model` among the settings names its process model.
std::unique_ptr<Estimator> make_filter(const Datasheet& sheet, const StageSpec& spec);

}  // namespace faultline

// Registers it twice: as what runs on a process model, and as a stage of that name, of the family kalman.
#define FAULTLINE_STATE_ESTIMATOR(name, make)                  \
  FAULTLINE_REGISTER(StateEstimatorType, name, {#name, make}); \
  FAULTLINE_ESTIMATOR(name, {#name, "kalman", false, make_filter})
