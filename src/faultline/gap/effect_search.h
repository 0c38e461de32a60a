// The search for the effects that explain a gap: round by round the best effect beside those found before, as long as
// one more pays; then close rivals of those that were found while others were still missing are tried again. See
// diagnose_gap.h for the whole.
#pragma once

#include "faultline/gap/discrepancy.h"
#include "faultline/gap/gap_trials.h"

namespace faultline {

// What was tried in place of the effect of a round after the first, beside the others.
struct Rival {
  std::size_t round = 0;
  FitResult fit;  // its effect is the last
  Eigen::VectorXd apart;
  double behind = 0, standard_error = 0;  // on the scale of Structure::score
};

struct EffectSearch {
  Structure plain;                     // the refitted model without effects, scored like every other
  Discrepancy before, after;           // of plain and base
  std::vector<FreePlace> noise;        // of transducers, that has a memory: in both, and no cause
  FitResult base;                      // the refitted model with the effects that were found
  std::vector<std::size_t> round_of;   // in which round each of them was found
  std::vector<Eigen::VectorXd> apart;  // Structure::apart of each of them
  std::vector<double> losses, score;   // of base on held-out segments, as in Structure
  std::vector<double> nominal;         // such losses of the datasheet's model
  std::vector<Structure> screened;     // all candidates of the first round, best first
  std::vector<Structure> ranked;  // the finalists of the first round, best first: those with scores, then the others
  std::vector<Rival> rivals;      // of the effects of later rounds
};

// Where among the effects of `base` the one of a round stands.
std::size_t position_of(const EffectSearch& search, std::size_t round);

// Looks for at most `most_effects`, until a typical segment's excess is below `quiet_variances` or no free signal
// anywhere wins much (discrepancy.h).
EffectSearch search_effects(GapTrials& work, int most_effects, double quiet_variances);

// Excess beyond the noise of a typical segment, in noise variances, from scores on the scale of GapTrials::robust():
// a few segments that go astray (a breakaway a moment too late) are no evidence that something is missing. `values`:
// how many residuals there are.
double typical_excess(const std::vector<double>& scores, double values);
// The same of all segments, from their losses.
double mean_excess(const std::vector<double>& losses, double values);

}  // namespace faultline
