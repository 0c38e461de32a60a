// Trials of the gap diagnosis: structures (sets of effects) are screened to first order, the best fitted quickly, the
// few best of those fitted with everything else - parameters, start states, sensitivities of their own - and scored
// on runs that a fit did not see. Holds the linearisation around the model that stands at the moment. See
// diagnose_gap.h for the whole.
#pragma once

#include <memory>

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_settings.h"
#include "faultline/gap/size_agreement.h"
#include "faultline/gap/split_runs.h"

namespace faultline {

// Start states and linearisation around a model.
struct Surroundings {
  std::shared_ptr<ResidualModel> residuals;
  std::shared_ptr<Linearisation> linear;
  ModelChange seen_from;  // where the sensitivities were computed
};

// One structure: which effects, how far it was followed, and how it does.
struct Structure {
  FitResult fit;                 // effects at their starting points until it was fitted
  double screened = 0;           // gain in the screening
  double quick = 0;              // gain of the quick fit
  std::vector<double> held_out;  // loss per segment of all tests; empty until refined
  std::vector<double> score;     // the same on the scale of GapTrials::robust()
  Eigen::VectorXd
      apart;  // how far the folds' fits of the last effect's coordinates lie from each other: standard deviation
  Surroundings around;  // its own, once refined
};

FitResult without_last(FitResult fit);  // without its last effect

double sum(const std::vector<double>& values);
std::vector<double> minus(const std::vector<double>& a, const std::vector<double>& b);

class GapTrials {
 public:
  GapTrials(const Datasheet& sheet, std::vector<SegmentedRun> runs, const std::vector<Fold>& folds,
            const std::vector<std::size_t>& learn, const GapSettings& settings, const GapProgress& progress);

  const ResidualModel& model() const { return *around_.residuals; }
  const GapOptions& options() const { return settings_.options; }
  const std::vector<std::size_t>& learned() const { return learn_; }
  const std::vector<Fold>& folds() const { return folds_; }
  int jobs() const { return settings_.jobs; }

  void tell(double share, const std::string& text) const;

  // Refits the parameters around `effects` until nothing is gained; leaves start states and linearisation of all runs
  // at the result.
  FitResult refit(const ModelChange& start, const std::vector<Candidate>& effects);
  // The same of the parameters alone, from elsewhere too: the best, or `from_datasheet` where none is better. On long
  // recordings it is sought on the segments of take_part().
  FitResult refit_from_elsewhere(const FitResult& from_datasheet);
  // The same from a refined structure on.
  FitResult refit(const Structure& refined);
  // What refit() just returned. Where one of its sizes trades with parameters along a ridge it is fitted with central
  // differences until nothing is gained, and has its covariance from there: only then do tolerances decide on it.
  FitResult polish(FitResult fit);

  // Start states and linearisation at what refit() or stand() returned, to come back to.
  struct Standing {
    Surroundings around;
    Surroundings part;
    bool parted = false;
  };
  Standing standing() const { return {around_, part_, parted_}; }
  void come_back(const Standing& standing);

  // The model as it is, with start states and linearisation of all runs at it.
  FitResult stand(const ModelChange& model);

  // Puts what swings beside the model that stands in step over the runs (run_phases.h), by the segments on which causes
  // are sought.
  // Returns what part of the mean square of residuals it closes.
  double put_in_step(const FitResult& standing);

  // What refit() or stand() just returned, scored fold by fold: the parameters belong to the rig and stay as all
  // learning runs have them, and so do the effects but the last; that one is fitted again on a fold's learning runs
  // and has to prove itself on the others.
  Structure score(const FitResult& fit) const;

  // disagreement() of the runs to learn from, at what refit() or stand() just returned.
  std::string runs_disagree(const FitResult& fit) const;

  // size_agreement() over all runs, at what refit() or stand() just returned.
  std::vector<SizeAgreement> sizes_agree(const FitResult& fit) const;

  // Every candidate beside the effects of `base`, what swings as put_in_step() of it says, best first, parameters
  // adjusted to first order, each at its best starting point or wherever on the way to it from no effect it should be
  // better.
  std::vector<Structure> screen(const FitResult& base, double from, double to) const;
  // The same at one port alone.
  std::vector<Structure> screen_at(const std::string& port, const FitResult& base) const;
  // All that may be tried: at_lines() of what stands.
  std::vector<Candidate> tried() const;

  // Fits each with the linearisation as it stands, and sorts them, best first. With `search`, sizes are searched
  // where a step fails, which takes several times as long.
  void shortlist(const FitResult& base, std::vector<Structure>& structures, bool search, double from, double to) const;

  // Fits each with start states and linearisation of its own and scores it in the same way.
  // Those that are far behind the first with a linearisation of their own are not followed further: they come last,
  // without a score. Returns how many have one.
  std::size_t refine(std::vector<Structure>& structures, double from, double to) const;

  // Whether the model that stands is fitted better by the parameters of a structure that was refined than by its own,
  // without the structure's last effect: then it ended in a valley beside theirs.
  bool better_without(const Structure& structure) const;
  // What a structure that was refined wins over the model that stands, on the runs to learn from; and what it would
  // win on a rig without it whose measured inputs have their noise (input_noise.h).
  double learned_gain(const Structure& structure) const;
  // ... and what another model near to it would.
  double learned_gain(const Structure& structure, const ModelChange& instead) const;
  double gain_of_input_noise(const FitResult& standing, const Structure& structure) const;
  // Residuals of what stands, per run.
  const std::vector<Eigen::MatrixXf>& left() const { return around_.linear->at_model(); }

  // Losses per held-out segment of a model as it is.
  std::vector<double> held_out(const ModelChange& at) const;

  double segment_values() const { return model().segment_values(); }
  double segment_s() const;
  double held_out_values() const;
  double learned_segments() const;
  // Half width of 90 % bounds in standard errors that so many segments told.
  double ninety_percent() const;

  // Loss of each segment on a scale where one in which the model goes astray does not outweigh all others: the
  // negative log likelihood with that segment's own noise level, n/2 log(2 loss/n). Near the noise it equals the loss
  // but for a constant.
  std::vector<double> robust(const std::vector<double>& losses) const;
  // Of a sum of differences in log-likelihood: the variance of a log-likelihood ratio is about twice its size, and
  // neighbouring samples of a residual that is not white count for one. Differences between segments are no
  // uncertainty: an effect may show in a few only.
  double standard_error(const std::vector<double>& differences) const;

 private:
  // Sensitivities are kept where they still hold; forward differences do not serve for central ones.
  Surroundings settle(const Surroundings& before, const ModelChange& at,
                      Differences differences = Differences::forward) const;
  double learned_loss(const Surroundings& around) const;
  double learned_loss(const Surroundings& around, const ModelChange& at) const;
  double learned_cost(const Surroundings& around, const FitResult& fit) const;  // with the tolerances' part
  // Linearises and fits around what stands until nothing is gained, or until the last round gained less than what is
  // missing to `aim`.
  void converge(FitResult& fit, double aim);
  void take_part(const ModelChange& at);
  // Around sensitivities of its own, once.
  double begin(Structure& structure) const;
  // Until nothing is gained on the segments on which causes are sought, and on all. Returns the learned loss there.
  double finish(Structure& structure) const;
  void finish_whole(Structure& structure) const;
  // `base`: learned loss of what it is beside, over the same segments.
  double follow(Structure& structure, const Surroundings& from, double base, std::size_t rounds) const;
  // The first `held` effects stay as they are.
  void cross_score(const Surroundings& around, Structure& structure, std::size_t held) const;

  const Datasheet& sheet_;
  const GapSettings& settings_;
  const GapProgress& progress_;
  std::vector<Fold> folds_;
  std::vector<std::size_t> learn_, every_;
  std::vector<Candidate> all_;
  std::vector<double> orders_;    // likeliest_orders() of these
  std::vector<Candidate> tried_;  // tried() as put_in_step() leaves them; empty: not asked
  Surroundings around_;           // of the model that stands
  Surroundings part_;             // the same over the segments on which causes are sought (part_of_runs.h)
  bool parted_ = false;           // whether these are not all
};

}  // namespace faultline
