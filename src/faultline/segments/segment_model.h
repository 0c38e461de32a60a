// A rig's model driven by a recording in segments.
//
//   r = (y - y_model)/sigma      y_model within its channel's range, 0 where a reading does not count
//   start of a segment = s + L d,  d ~ N(0, 1) beforehand
//
// s: the measured states without their noise (smoothing.h), L: the root of how well they are known, never better than
// `start_prior_sigma` noises of the channel - a state that moves within the smoothing window is smoothed with a bias.
// A state that no channel shows goes on from segment to segment where it forgets its start soon; else the smoother of
// state_smoother.h says mean and covariance, and its standard deviations count `start_prior_sigma` times, since it has
// seen the readings that the segment is held against. d is estimated with everything else (settle()), and what is left
// of its error is projected out (linearisation.h).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/rig/driven_model.h"
#include "faultline/segments/segmented_run.h"

namespace faultline {

// What the model is changed by.
struct ModelChange {
  std::vector<double> parameters;   // in the datasheet's order
  std::vector<EffectSpec> effects;  // on top of the datasheet's nominal effects
};

// What it is in a run: an effect with a frequency and a phase (Hz, rad) swings on when nothing is recorded, so that its
// phase is another one in each run (SegmentedRun::ahead).
ModelChange in_run(ModelChange change, const SegmentedRun& run);

class SegmentModel {
 public:
  explicit SegmentModel(const Datasheet& sheet, const SegmentOptions& options = {});

  const Datasheet& sheet() const { return *sheet_; }
  const std::vector<int>& outputs() const { return outputs_; }  // channels that count
  const SegmentOptions& options() const { return options_; }
  const std::vector<int>& shown_by() const { return shown_by_; }  // per state: output that shows it, or -1
  Eigen::Index directions() const;                                // states that are shown

  // Puts the starts of all segments where the measurements say, without shift. `noise`: of each output. `change`: the
  // model that estimates hidden states.
  void place_starts(SegmentedRun& run, const std::vector<double>& noise, const ModelChange& change) const;
  ModelChange nominal() const { return {sheet_->nominal(), {}}; }

  // The model that a run drives, which sees around a row what it needs of the recording. Both must outlive it.
  // `beside`: as the options say, or never.
  enum class Beside { as_asked, never };
  std::unique_ptr<DrivenModel> driven(const ModelChange& change, const SegmentedRun& run,
                                      const std::vector<double>& noise, Beside beside = Beside::as_asked) const;

  // Rows x outputs, each over `sigma` of its output. A model that leaves all bounds gives large but finite numbers.
  Eigen::MatrixXf residuals(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& sigma) const;
  // The same until `enough(row, residuals)`, asked after every row, is true; what is not run is 0.
  using Enough = std::function<bool(std::size_t, const Eigen::MatrixXf&)>;
  Eigen::MatrixXf residuals(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& sigma,
                            const Enough& enough) const;
  // With the states put back to the measured ones every `horizon` rows, and the first `horizon` rows after
  // each counted. `noise`: of each output, for the smoothing.
  Eigen::MatrixXf residuals(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& noise,
                            std::size_t horizon) const;
  // Of several models, or of one from several starts: one matrix each. All that can go beside the first do
  // (RunningPlant::Beside), so differences from it are what they are for. With `jobs` threads.
  struct Variant {
    const ModelChange* change;
    std::vector<double> starts;  // starts_of()
  };
  std::vector<Eigen::MatrixXf> residuals(const std::vector<Variant>& variants, const SegmentedRun& run,
                                         const std::vector<double>& sigma, int jobs,
                                         Beside beside = Beside::as_asked) const;
  // d residuals / d shift, by differences: one matrix per direction. After them, of each of `memories`: what the model
  // changed so does in place of a memory of which a start says nothing, of one standard deviation (stretch_model.h).
  std::vector<Eigen::MatrixXf> start_columns(const ModelChange& change, const SegmentedRun& run,
                                             const std::vector<double>& sigma, int jobs = 1,
                                             const std::vector<ModelChange>& memories = {}) const;
  // Moves the starts to those that fit the model best, where that lowers a segment's loss |r|^2 + |d|^2. One
  // Gauss-Newton step a call; starts that are far from what the channels show go back to it where that is better, as
  // where another model had moved them. Returns the columns that it used: `known` ones, or its own where that is empty;
  // where a start went back, those of the starts as they are then.
  std::vector<Eigen::MatrixXf> settle(const ModelChange& change, SegmentedRun& run, const std::vector<double>& sigma,
                                      std::vector<Eigen::MatrixXf> known = {}, int jobs = 1) const;

  // What stuck transducers hold, read from the recording: the simulated value has the error of the segment in which one
  // stuck, for ever, and where parts of a run are simulated each of them would hold another.
  struct Held {
    std::size_t output;  // position in outputs()
    std::size_t first;   // row
    double value;        // mean of what is read from there on
  };
  std::vector<Held> held_readings(const ModelChange& change, const SegmentedRun& run) const;

 private:
  // The row of a restart still shows where the segment before it ended, which is not what this segment's states
  // explain; but it is what a run of so many samples says.
  enum class Restarted { left_out, counted };
  // The first leads, if the others go beside it.
  using Models = std::vector<std::unique_ptr<DrivenModel>>;
  std::vector<Eigen::MatrixXf> simulate(const std::vector<Variant>& variants, const Models& models,
                                        const SegmentedRun& run, const std::vector<std::size_t>& restarts,
                                        const std::vector<double>& sigma, Restarted restarted,
                                        const Enough& enough) const;
  // In sigmas: beyond anything the sensor shows, and finite where a model diverges.
  double largest_residual(std::size_t output, double sigma) const;
  // What the channels show of the states at a row; NaN: nothing.
  std::vector<double> shown_states(const SegmentedRun& run, std::size_t row) const;
  void read_held_values(const ModelChange& change, const SegmentedRun& run, const std::vector<double>& sigma,
                        Eigen::MatrixXf& residuals) const;
  void place_hidden(SegmentedRun& run, std::size_t segment, const Eigen::VectorXd& mean,
                    const Eigen::MatrixXd& covariance, const std::vector<int>& hidden, Eigen::Index direction) const;
  bool counts(const SegmentedRun& run, std::size_t row, std::size_t output) const;

  std::shared_ptr<const Datasheet> sheet_;
  SegmentOptions options_;
  std::vector<int> outputs_;
  std::vector<int> shown_by_;    // per state: channel that shows it, or -1
  std::vector<std::size_t> at_;  // per state: position of that channel among the outputs
};

// Noise of each compared output over runs (noise_of()), where the starts of all of them are placed with it. A motion as
// fast as the samples has third differences of its own: what a reading's are once those of the nominal model are taken
// away counts where that is less than `model_noise_ratio` of the reading's own.
std::vector<double> place_all(const SegmentModel& model, std::vector<SegmentedRun>& runs);

// Where the segments start, one after the other, as DrivenModel::run() takes it.
std::vector<double> starts_of(const SegmentedRun& run);

// r + S e per segment, at the e that makes |r + S e|^2 + |d + e|^2 smallest: residuals from the likeliest starts, to
// first order, so that the noise in the samples from which a segment starts is not taken for the model's error.
// `columns`: S. A model that is right leaves noise.
Eigen::MatrixXf settled(const SegmentedRun& run, const std::vector<Eigen::MatrixXf>& columns,
                        Eigen::MatrixXf residuals);

}  // namespace faultline
