#include "faultline/estimators/state_estimator.h"

#include "faultline/estimators/divided_difference.h"
#include "faultline/estimators/extended_kalman.h"
#include "faultline/estimators/unscented_kalman.h"
#include "faultline/signal/error.h"

namespace faultline {

void check_state_estimator(const std::string& type) {
  for (const char* known : {"divided_difference_1", "divided_difference_2", "extended_kalman", "unscented_kalman"})
    if (type == known) return;
  throw InputError("there is no estimator '" + type +
                   "'; there are divided_difference_1, divided_difference_2, extended_kalman, unscented_kalman");
}

std::unique_ptr<StateEstimator> make_state_estimator(const std::string& type, const ProcessModel& model) {
  if (type == "divided_difference_1") return make_divided_difference(model, 1);
  if (type == "divided_difference_2") return make_divided_difference(model, 2);
  if (type == "extended_kalman") return std::make_unique<ExtendedKalmanFilter>(model);
  check_state_estimator(type);
  return std::make_unique<UnscentedKalmanFilter>(model);
}

}  // namespace faultline
