#include "faultline/gap/effect_worth.h"

#include <algorithm>
#include <cmath>

#include "faultline/gap/input_noise.h"

namespace faultline {
namespace {

constexpr double kNoSize = 1e-4;  // of the range of a size
constexpr double kAtEnd = 1e-3;   // of its coordinate
// Of the least size that is tried, and of what that wins: two decades less of what the rig has would win much less.
constexpr double kMuchLess = 0.01, kWinsAsMuch = 0.9;

// Per output, the mean square of what counts beyond the noise's.
std::vector<double> excess_by_output(const std::vector<Eigen::MatrixXf>& residuals) {
  std::vector<double> result;
  for (Eigen::Index o = 0; o < residuals.front().cols(); ++o) {
    double squares = 0, count = 0;
    for (const Eigen::MatrixXf& run : residuals) {
      squares += static_cast<double>(run.col(o).squaredNorm());
      count += static_cast<double>((run.col(o).array() != 0).count());
    }
    result.push_back(std::max(0.0, squares / std::max(count, 1.0) - 1));
  }
  return result;
}

// closes_one_output() of a structure beside what stands. Nothing where its last effect is at a sensor: that closes its
// own channel, whatever is wrong.
double most_closed(const GapTrials& work, const Structure& best) {
  if (port_kind(best.fit.effects.back().effect.port) == PortKind::sensor || !best.around.linear) return 0;
  return closes_one_output(work.left(), best.around.linear->at_model(),
                           work.options().verdict.material_excess_variances);
}

// closes(), of a typical segment.
double closes_typically(const GapTrials& work, const EffectSearch& now, const Structure& best) {
  const double values = work.held_out_values();
  return 1 - typical_excess(best.score, values) / std::max(typical_excess(now.score, values), 1e-12);
}

// Of the likelihood that a perfect model would win beside `now`, what a structure of this loss does.
double part_won(const EffectSearch& now, double loss) { return 1 - loss / std::max(now.after.loss, 1e-9); }

}  // namespace

double closes_one_output(const std::vector<Eigen::MatrixXf>& before, const std::vector<Eigen::MatrixXf>& after,
                         double least_excess) {
  const std::vector<double> left = excess_by_output(before), now = excess_by_output(after);
  double most = 0;
  for (std::size_t o = 0; o < left.size(); ++o)
    if (left[o] > least_excess) most = std::max(most, 1 - now[o] / left[o]);
  return most;
}

double loss_of(const GapTrials& work, const std::vector<FreePlace>& noise, const Structure& structure) {
  const ResidualModel& residuals = structure.around.residuals ? *structure.around.residuals : work.model();
  return find_discrepancy(residuals, structure.fit.model, work.learned(), work.jobs(), Places::none, noise).loss;
}

bool from_input_noise(const GapTrials& work, const FitResult& base, const Structure& structure) {
  if (!has_noisy_inputs(work.model().runs())) return false;
  const double gain = work.learned_gain(structure);
  return 0.5 * (gain + work.gain_of_input_noise(base, structure)) > work.options().search.input_noise_fraction * gain;
}

bool has_no_size(const GapTrials& work, const Structure& structure) {
  const Candidate& candidate = structure.fit.effects.back();
  const EffectType& type = *find_effect_type(candidate.effect.effect);
  bool sized = false, least = false;
  ModelChange less = structure.fit.model;
  for (std::size_t p = 0; p < type.parameters.size(); ++p) {
    const double none = type.parameters[p].none;
    if (std::isnan(none)) continue;
    sized = true;
    const Bounds& b = candidate.bounds[p];
    const double value = candidate.effect.parameters[p];
    if (candidate.logarithmic(p)) {  // the least that is tried is not nothing
      const double place = candidate.to_coordinate(p, value);
      if (std::isinf(none) ? place < 1 - kAtEnd : place > kAtEnd) return false;
      less.effects.back().parameters[p] = std::isinf(none) ? value / kMuchLess : none + kMuchLess * (value - none);
      least = true;
    } else if (!(std::abs(value - none) <= kNoSize * (b.maximum - b.minimum))) {
      return false;
    }
  }
  return sized && (!least || work.learned_gain(structure, less) > kWinsAsMuch * work.learned_gain(structure));
}

bool gains(const GapTrials& work, const EffectSearch& now, const Structure& best) {
  const std::vector<double> gain = minus(now.score, best.score);
  return !has_no_size(work, best) &&
         sum(gain) > work.options().search.significance_standard_errors * work.standard_error(gain) &&
         !from_input_noise(work, now.base, best);
}

double closes(const GapTrials& work, const EffectSearch& now, const Structure& best) {
  const double values = work.held_out_values();
  return 1 - mean_excess(best.held_out, values) / std::max(mean_excess(now.losses, values), 1e-12);
}

bool pays(const GapTrials& work, const EffectSearch& certain, const EffectSearch& now, const Structure& best,
          double quiet_variances) {
  const GapOptions::Search& options = work.options().search;
  const GapOptions::Verdict& verdict = work.options().verdict;
  const bool first = now.base.effects.empty(), hidden = !restarts_freely(best.fit.effects.back().effect);
  const double share = closes(work, now, best), left = mean_excess(best.held_out, work.held_out_values());
  const double loss = loss_of(work, now.noise, best);
  // Beside others a cause closes a good part of what they leave: of all, of a typical segment and of the likelihood,
  // or of one output. Less is what a cause leaves that is not quite what the rig has. Of what restarts hide the
  // likelihood says too much: it must close as much as a first one must of the gap.
  if (!first && hidden && share < verdict.hidden_shrink_fraction) return false;
  if (!first && !hidden &&
      std::max(share, std::min(closes_typically(work, now, best), part_won(now, loss))) <
          options.further_closed_fraction &&
      most_closed(work, best) < options.further_output_closed_fraction)
    return false;
  if (&certain != &now && closes(work, certain, best) < verdict.hidden_shrink_fraction) return false;
  // The likelihood takes each step of the model as straight. What a play does with what it remembers is not, and it
  // may be unlikely from sample to sample that closes all of a large gap, or all that others leave, over segments which
  // its fit did not see.
  const bool large = mean_excess(now.losses, work.held_out_values()) > verdict.material_excess_variances;
  if (hidden && (large || !first) && left < quiet_variances && share > verdict.closed_shrink_fraction) return true;
  const double nearly =
      left < verdict.material_excess_variances ? verdict.closed_shrink_fraction : verdict.nearly_closed_fraction;
  if (hidden && large && first && share > nearly) return true;
  const double won = certain.after.loss - loss, before = certain.before.loss - certain.after.loss;
  // Where readings differ from the model's in ways that no place explains - noise with far outliers, a clock that
  // jitters - a perfect model is no measure: half of a large gap is closed by what is likelier than a free signal
  // anywhere.
  const double least_closed = verdict.hidden_shrink_fraction;
  const bool beyond_free = !hidden && large && closes(work, certain, best) > least_closed &&
                           closes_typically(work, certain, best) > least_closed && won > most_free(certain.after);
  return (beyond_free || won > options.evidence_fraction * certain.after.loss) &&
         won > options.further_evidence_fraction * before;
}

bool worth_a_trial(const GapTrials& work, const EffectSearch& now, const Structure& best) {
  const double before = typical_excess(now.score, work.held_out_values());
  const double after = typical_excess(best.score, work.held_out_values());
  return after > work.options().verdict.material_excess_variances &&
         after < (1 - work.options().verdict.material_shrink_fraction) * before;
}

bool more_to_find(const GapOptions::Search& options, const EffectSearch& now, bool large) {
  if (now.after.places.empty()) return false;
  if (large) return true;
  const double most = now.after.places.front().gain;
  if (now.base.effects.empty()) return most > options.least_free_fraction * now.before.loss;
  const double won = now.before.loss - now.after.loss;
  return most > options.further_evidence_fraction * won &&
         most > options.further_free_fraction * std::min(won, now.after.loss);
}

}  // namespace faultline
