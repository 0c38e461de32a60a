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
// first segments is never more than that of all, less what is white noise in the others, which no effect explains: a
// run ends where it is beyond what is asked for.
//
// A nuisance effect that is a force loop holds a memory of which a segment's start says nothing: as its start states, a
// constant force of up to half the loop's width, another one in every segment, is known beforehand and projected out.
//
// A stretch costs one run of the model for r, one more for each column of T and for each start state (respond), and one
// for each column of D (weigh). Whether that is worth its price known_model.h tells.
// Units: amplitudes as in FaultHypothesis; losses as evidence.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "faultline/estimators/response_settings.h"
#include "faultline/segments/linearisation.h"

namespace faultline {

// What a segment of a stretch says at a point.
struct SegmentResponse {
  Eigen::VectorXd residuals;    // r
  Eigen::MatrixXd tolerances;   // T
  Eigen::MatrixXd faults;       // D; nothing before weigh()
  Eigen::MatrixXd information;  // weight T'T
  double weight = 0;            // of squares, inflation in it
  double floor = 0;             // of the loss, whatever the effects: what is white noise in r, weighted
};

struct Stretch {
  SegmentedRun run;
  double begin = 0;                          // s
  double misfit = 0;                         // of what was known when it was judged last (known_model.h)
  bool responded = false;                    // r and T are there ...
  bool weighed = false;                      // ... and D
  Eigen::VectorXd tolerances_at, faults_at;  // where T and D were taken: ModelPoint::shift
  std::shared_ptr<const StartProjection> starts;
  std::vector<SegmentResponse> segments;  // those that count: all but the first
  Eigen::MatrixXd sums;                   // of them, weighted: [r T D]'[r T D] (attribution/screening.h)
};

// The latest of some stretches, by reference.
using Stretches = std::vector<const Stretch*>;

// A loss after each of the segments, in their order.
using LossCourse = std::vector<double>;

// Where the model is made linear, or all that is known of it.
struct ModelPoint {
  Eigen::VectorXd shift;           // from the datasheet: parameters in tolerances, then zeros for nuisance effects
  std::vector<double> parameters;  // the same, in the datasheet's order and units
  std::vector<EffectSpec> effects;
};

class StretchModel {
 public:
  StretchModel(const Datasheet& sheet, const ResponseSettings& settings);

  const std::vector<FaultHypothesis>& hypotheses() const { return hypotheses_; }
  const ResponseSettings& settings() const { return settings_; }
  std::size_t free_parameters() const { return free_.size(); }
  Eigen::Index parameters() const { return static_cast<Eigen::Index>(free_.size() + nuisance_.size()); }  // in theta
  std::size_t outputs() const { return model_.outputs().size(); }
  const std::vector<int>& output_channels() const { return model_.outputs(); }
  const std::vector<double>& noise() const { return sigma_; }  // of each output
  std::size_t segment_rows() const { return segment_rows_; }
  Eigen::MatrixXd no_sums() const;

  ModelPoint nominal() const;
  ModelPoint at(const Eigen::VectorXd& shift) const;  // no effects
  // Parameters and nuisance effects moved by theta from `point`, with its effects and more. A nuisance effect that
  // would turn against its direction is left out.
  ModelPoint known(const ModelPoint& point, const Eigen::VectorXd& theta, const std::vector<EffectSpec>& effects) const;

  std::unique_ptr<Stretch> prepare(const Recording& recording) const;
  void respond(Stretch& stretch, const ModelPoint& point) const;
  // The same where that stretch has responded before: T, D and the start states' part stay as they are while the point
  // has moved no more than `reused_tolerances` since.
  void follow(Stretch& stretch, const ModelPoint& point) const;
  void weigh(Stretch& stretch, const ModelPoint& point) const;  // after respond(), at the same point

  // With `effects` beside those of the point, theta adjusted to first order; infinite where it is more than `limit`, or
  // after a segment more than `limits` say, if given. `prior`: [r T]'[r T] of what is known of theta from the
  // tolerances and from other stretches. `after` takes all.
  double loss(const Eigen::MatrixXd& prior, const Stretches& stretches, const ModelPoint& point,
              const std::vector<EffectSpec>& effects, double limit = kInfinity, Eigen::MatrixXd* after = nullptr,
              const LossCourse* limits = nullptr, LossCourse* course = nullptr) const;
  // Without any: nothing runs.
  double loss(Eigen::MatrixXd prior, const Stretches& stretches, LossCourse* course = nullptr) const;

  // One run, and the start states' part as seen from a change.
  Eigen::MatrixXf residuals(const Stretch& stretch, const ModelPoint& known) const;
  std::shared_ptr<const StartProjection> starts_at(const ModelChange& base, const SegmentedRun& run) const;
  // Of a segment: one over its mean square or, if that is more than `most`, over that.
  double weight_of(const Eigen::VectorXd& residuals, double most = kInfinity) const;
  // |C r|^2 of a segment, C: the first cosines (DCT-II) of each output. What an effect does to an output is as smooth
  // as the plant and lies in C; noise is white and hardly does.
  double smooth_square(const Eigen::VectorXd& residuals) const;
  // What that has beyond white noise as strong as the rest of r is, or as the datasheet says; as evidence. No effect
  // explains more.
  double beyond_noise(const Eigen::VectorXd& residuals) const;
  // What a stretch leaves with theta: that evidence, and the mean square in variances.
  struct Left {
    double evidence = 0, mean_square = 0;
  };
  Left left_of(const Stretch& stretch, const Eigen::VectorXd& theta) const;
  std::size_t smooth_terms() const { return static_cast<std::size_t>(cosines_.rows()); }
  // Runs of the model so far: what judging costs.
  std::uint64_t runs() const { return runs_; }

 private:
  std::vector<LinearSegment> linear(const Stretch& stretch, const ModelPoint& point,
                                    const std::vector<Direction>& directions) const;
  double segment_values() const;                                                  // readings in a segment
  void set_residuals(SegmentResponse& segment, Eigen::VectorXd residuals) const;  // T stands
  void sum_up(Stretch& stretch) const;

  Datasheet sheet_;
  ResponseSettings settings_;
  SegmentModel model_;
  std::size_t segment_rows_;
  std::vector<double> sigma_;  // of each output, as the datasheet says
  std::vector<FaultHypothesis> hypotheses_;
  std::vector<std::size_t> free_;                // parameters with a tolerance
  std::vector<EffectSpec> nuisance_, memories_;  // memories_: a standard deviation of each
  Eigen::MatrixXd cosines_;                      // C of one output
  mutable std::atomic<std::uint64_t> runs_{0};
};

}  // namespace faultline
