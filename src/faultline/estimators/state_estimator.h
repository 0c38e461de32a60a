// The family of recursive state estimators: predict with a model, correct with what was measured. One instance runs at one
// rate; no call but the constructor and reset() allocates.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/process_model.h"

namespace faultline {

class StateEstimator {
 public:
  virtual ~StateEstimator() = default;

  // Begins anew with the given state and the diagonal of its covariance.
  virtual void reset(const double* state, const double* variance) = 0;
  // x-, P- after dt [s]; `noise_scale` multiplies Q (dt over the sample period).
  virtual void predict(double dt, double noise_scale) = 0;
  // Corrects with y; rows with use[i] == false are left out. Sets innovation and its statistics.
  virtual void correct(const double* y, const bool* use) = 0;

  virtual const double* state() const = 0;
  virtual void covariance(double* row_major) const = 0;
  virtual const double* innovation() const = 0;
  virtual const double* innovation_std() const = 0;
  virtual double normalised_innovation() const = 0;
};

// type: divided_difference_1, divided_difference_2, extended_kalman, unscented_kalman. InputError that lists the known ones
// otherwise. `model` must outlive it.
// InputError where there is no such type, without a look at what else the stage asks for.
void check_state_estimator(const std::string& type);
std::unique_ptr<StateEstimator> make_state_estimator(const std::string& type, const ProcessModel& model);

}  // namespace faultline
