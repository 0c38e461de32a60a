// A rig's model over stretches of samples, made linear: the sums from which fault_responses.h judges.
//
// A stretch is cut into segments with smoothed start states (segments/segment_model.h). r: whitened residuals of the model
// at a point, T: their derivative by each parameter (per tolerance) and each nuisance effect of the datasheet (as
// listed), D: by each fault (per amplitude). A segment counts by one over its mean square where that is above 1, and
// all squares are divided by `inflation_variances`. With theta, the deviation of parameters and nuisance effects from
// the point, known beforehand to one tolerance,
//
//   loss(effects) = min over theta of  |r_prior + T_prior theta|^2 + |r(effects) + T theta|^2 + |shift + theta|^2
//
// r(effects) is computed with the effects in the model, T at the point. Units: amplitudes as in FaultHypothesis;
// losses as evidence.
#pragma once

#include <memory>
#include <vector>

#include "faultline/estimators/response_settings.h"
#include "faultline/segments/linearisation.h"

namespace faultline {

// T'T, T'D, D'D, T'r, D'r, r'r over stretches.
struct ResponseSums {
  Eigen::MatrixXd tt, td, dd;
  Eigen::VectorXd tr, dr;
  double rr = 0;
  ResponseSums(Eigen::Index t, Eigen::Index d);
  void scale(double factor);
  void add(const ResponseSums& other);
};

struct Stretch {
  Stretch(Eigen::Index t, Eigen::Index d) : sums(t, d) {}
  SegmentedRun run;
  double begin = 0;                     // s
  std::unique_ptr<StartProjection> starts;
  std::vector<Eigen::MatrixXd> tolerances;  // per counted segment
  std::vector<double> weights;  // of squares, inflation in it
  ResponseSums sums;
};

// The latest of some stretches, by reference.
using Stretches = std::vector<const Stretch*>;

// Where the model is made linear.
struct ModelPoint {
  Eigen::VectorXd shift;           // from the datasheet: parameters in tolerances, then zeros for nuisance effects
  std::vector<double> parameters;  // the same, in the datasheet's order and units
  std::vector<EffectSpec> effects;
};

// What is known of theta before some stretches: from the tolerances, and from other stretches.
struct ResponsePrior {
  Eigen::MatrixXd information;  // 1 + T'T
  Eigen::VectorXd pull;         // information vector of the parameters: shift + T'r
  double constant = 0;          // shift'shift + r'r
  void add(const ResponseSums& sums);
};

class StretchModel {
 public:
  StretchModel(const Datasheet& sheet, const ResponseSettings& settings);

  const std::vector<FaultHypothesis>& hypotheses() const { return hypotheses_; }
  std::size_t free_parameters() const { return free_.size(); }
  ResponseSums no_sums() const;

  ModelPoint nominal() const;
  ModelPoint at(const Eigen::VectorXd& shift) const;  // no effects
  ResponsePrior tolerances(const ModelPoint& point) const;

  std::unique_ptr<Stretch> respond(const Recording& recording, const ModelPoint& point) const;
  // With `effects` beside those of the point, theta adjusted to first order.
  double loss(const ResponsePrior& prior, const Stretches& stretches, const ModelPoint& point,
              const std::vector<EffectSpec>& effects) const;

 private:
  Datasheet sheet_;
  ResponseSettings settings_;
  SegmentModel model_;
  std::vector<double> sigma_;  // of each output
  std::vector<FaultHypothesis> hypotheses_;
  std::vector<std::size_t> free_;  // parameters with a tolerance
  std::vector<EffectSpec> nuisance_;
};

}  // namespace faultline
