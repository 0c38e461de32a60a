// A rig's model over stretches of samples, made linear: the sums from which fault_responses.h judges.
//
// A stretch is cut into segments with smoothed start states (segments/segment_model.h). r: whitened residuals of the
// model at a point, T: their derivative by each parameter (per tolerance) and each nuisance effect of the datasheet (as
// listed), D: by each fault (per amplitude). A segment counts by one over its mean square where that is above 1, and
// all squares are divided by `inflation_variances`. With theta, the deviation of parameters and nuisance effects from
// the point, known beforehand to one tolerance,
//
//   loss(effects) = min over theta of  |r_prior + T_prior theta|^2 + |r(effects) + T theta|^2 + |shift + theta|^2
//
// r(effects) is computed with the effects in the model, T at the point. Every row adds a square, so the loss of the
// first segments is never more than that of all: a run ends where it is beyond what is asked for.
//
// A stretch costs one run of the model for r, one more for each column of T and for each start state (respond), and one
// for each column of D (weigh). Whether that is worth its price one run tells (misfit):
//
//   misfit = sum over segments of  weight |C r_w|^2
//
// r_w: residuals of the model with all that is known in it (ModelPoint: parameters, nuisance effects, faults), start
// states projected out; C: the first cosines (DCT-II) of each output over a segment. What an effect does to an output
// is as smooth as the plant and lies in C; noise is white and hardly does. What any effect could explain of a stretch
// is at most what its misfit has beyond that of noise and of the model's usual error.
// Units: amplitudes as in FaultHypothesis; losses and misfits as evidence.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
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

// What a segment of a stretch says at a point.
struct SegmentResponse {
  Eigen::VectorXd residuals;    // r
  Eigen::MatrixXd tolerances;   // T
  Eigen::MatrixXd information;  // weight T'T
  double weight = 0;            // of squares, inflation in it
};

struct Stretch {
  Stretch(Eigen::Index t, Eigen::Index d) : sums(t, d) {}
  SegmentedRun run;
  double begin = 0;        // s
  double misfit = 0;       // of what was known when it was judged last
  bool responded = false;  // r and T are there ...
  bool weighed = false;    // ... and the sums of D
  std::shared_ptr<const StartProjection> starts;
  std::vector<SegmentResponse> segments;  // those that count: all but the first
  ResponseSums sums;
};

// The latest of some stretches, by reference.
using Stretches = std::vector<const Stretch*>;

// Where the model is made linear, or all that is known of it.
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
  Eigen::VectorXd theta() const;  // of the least loss
  double loss() const;
};

class StretchModel {
 public:
  StretchModel(const Datasheet& sheet, const ResponseSettings& settings);

  const std::vector<FaultHypothesis>& hypotheses() const { return hypotheses_; }
  std::size_t free_parameters() const { return free_.size(); }
  ResponseSums no_sums() const;

  ModelPoint nominal() const;
  ModelPoint at(const Eigen::VectorXd& shift) const;  // no effects
  // Parameters and nuisance effects moved by theta from `point`, with its effects and more. A nuisance effect that
  // would turn against its direction is left out.
  ModelPoint known(const ModelPoint& point, const Eigen::VectorXd& theta, const std::vector<EffectSpec>& effects) const;
  ResponsePrior tolerances(const ModelPoint& point) const;

  std::unique_ptr<Stretch> prepare(const Recording& recording) const;
  void respond(Stretch& stretch, const ModelPoint& point) const;
  void weigh(Stretch& stretch, const ModelPoint& point) const;  // after respond(), at the same point

  // With `effects` beside those of the point, theta adjusted to first order; infinite where it is more than `limit`.
  // The prior as of all that is known then goes to `after`.
  double loss(const ResponsePrior& prior, const Stretches& stretches, const ModelPoint& point,
              const std::vector<EffectSpec>& effects, double limit = kInfinity, ResponsePrior* after = nullptr) const;
  // Without any: nothing runs.
  static double loss(const ResponsePrior& prior, const Stretches& stretches);

  // Of white noise as the datasheet has it.
  double noise_misfit() const;
  // One run; the start states' part is borrowed from a stretch before where that leaves less than `enough`, else more
  // runs find the stretch's own.
  double misfit(const Stretch& stretch, const ModelPoint& known, double enough);
  void forget_starts() { lately_.clear(); }  // nothing is borrowed from before
  // To first order, of a stretch that responded at a point, theta from there.
  double misfit(const Stretch& stretch, const Eigen::VectorXd& theta) const;
  // Runs of the model so far: what judging costs.
  std::uint64_t runs() const { return runs_; }

 private:
  using Starts = std::shared_ptr<const StartProjection>;
  Starts starts_at(const ModelChange& base, const SegmentedRun& run) const;
  std::vector<LinearSegment> linear(const Stretch& stretch, const ModelPoint& point,
                                    const std::vector<Direction>& directions) const;
  double segment_values() const;  // readings in a segment
  double misfit(const Stretch& stretch, const Eigen::MatrixXf& residuals, const StartProjection& starts) const;
  double smooth_square(const Eigen::VectorXd& residuals) const;
  double weight_of(const Eigen::VectorXd& residuals) const;

  Datasheet sheet_;
  ResponseSettings settings_;
  SegmentModel model_;
  std::size_t segment_rows_;
  std::vector<double> sigma_;  // of each output, as the datasheet says
  std::vector<FaultHypothesis> hypotheses_;
  std::vector<std::size_t> free_;  // parameters with a tolerance
  std::vector<EffectSpec> nuisance_;
  Eigen::MatrixXd cosines_;    // C of one output
  std::deque<Starts> lately_;  // of stretches before
  mutable std::atomic<std::uint64_t> runs_{0};
};

}  // namespace faultline
