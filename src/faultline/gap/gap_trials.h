// Trials of the gap diagnosis: structures (sets of effects) are screened to first order, fitted on one part of the runs and scored on
// the other. Holds the linearisation around the model that stands at the moment. See diagnose_gap.h for the whole.
#pragma once

#include <memory>

#include "faultline/gap/diagnose_gap.h"

namespace faultline {

struct Fold {
  std::vector<std::size_t> train, test;  // positions of runs
};

// One structure: which effects, fitted per fold and scored on what the fold left out.
struct Scored {
  std::vector<Candidate> effects;  // starting points
  std::vector<double> held_out;    // loss per segment of all tests
  std::vector<double> score;       // the same on the scale of robust()
  double screened = 0;             // gain in the screening
  FitResult everywhere;            // fitted to all learning runs
};

double sum(const std::vector<double>& values);

// Of a sum of differences in log likelihood: the variance of a log likelihood ratio is about twice its size, and neighbouring samples
// of a residual that is not white count for one. Differences between segments are no uncertainty: an effect may show in a few only.
double standard_error(const std::vector<double>& values);

std::vector<double> minus(const std::vector<double>& a, const std::vector<double>& b);

// Loss of a segment on a scale where one segment in which the model goes astray does not outweigh all others: the negative log
// likelihood with that segment's own noise level, n/2 log(2 loss/n). Near the noise it equals the loss but for a constant.
std::vector<double> robust(const std::vector<double>& losses, double values_per_segment);

class GapTrials {
 public:
  GapTrials(const Datasheet& sheet, std::vector<GapRun> runs, const std::vector<Fold>& folds,
            const std::vector<std::size_t>& learn, const GapSettings& settings, const GapProgress& progress);

  const ResidualModel& model() const { return model_; }
  const std::vector<Candidate>& all() const { return all_; }

  void tell(double share, const std::string& text) const;

  // Refits the parameters around `effects`, twice linearised; leaves the linearisation of all runs at the result.
  FitResult refit(const GapModel& start, const std::vector<Candidate>& effects, int rounds);

  // Gain of each candidate over the linearised model, and its best starting point.
  std::vector<Scored> screen(const FitResult& base, double from, double to);

  // Fits each structure per fold and everywhere, and scores it.
  void score(const FitResult& base, std::vector<Scored>& structures, double from, double to);

  // Everything smooth that the library has at a port, at once: what a flexible model of that place could win. Each effect starts as
  // small as its range allows.
  Scored closure(const FitResult& base, const std::string& port) const;

  // Losses per held-out segment of a model as it is.
  std::vector<double> held_out(const GapModel& model) const;

  double segment_values() const { return static_cast<double>(model_.segment() * model_.outputs().size()); }

  double held_out_values() const;

  static GapModel with(const std::vector<Candidate>& effects, const std::vector<double>& parameters);

 private:
  const Datasheet& sheet_;
  const GapSettings& settings_;
  const GapProgress& progress_;
  ResidualModel model_;
  std::vector<Fold> folds_;
  std::vector<std::size_t> learn_, every_;
  std::vector<Candidate> all_;
  std::unique_ptr<Linearisation> linear_;
};

}  // namespace faultline
