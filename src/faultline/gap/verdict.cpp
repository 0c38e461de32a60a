#include "faultline/gap/verdict.h"

#include <algorithm>

namespace faultline {
namespace {

constexpr double kBeyondDoubt = 2;  // of effects that are a part at most: clearly above 1

}  // namespace

GapEvidence gap_evidence(const Discrepancy& before, const Discrepancy& after, bool found) {
  GapEvidence evidence;
  evidence.found = found;
  evidence.effects = found ? before.loss - after.loss : 0;
  // The loss of a perfect model is about 0, and less where the noise was taken too large.
  evidence.perfect = std::max(before.loss, evidence.effects);
  evidence.free_before = most_free(before);
  evidence.readings = before.readings;
  evidence.free_after = found ? most_free(after) : evidence.free_before;
  return evidence;
}

GapVerdict judge_gap(const GapEvidence& evidence, double matters, const GapOptions::Verdict& options) {
  GapVerdict result;
  const double perfect = std::max(evidence.perfect, 1e-9), effects = std::max(evidence.effects, 1e-9);
  // Next to nothing is left of the gap, in a typical segment neither: whatever a free signal wins more, it is not what
  // was missing. Nor is it where little is left, and the less the smaller the gap, and the effects win more than a free
  // signal anywhere, before or after.
  const double closes_all = std::min(evidence.shrink, evidence.typical_shrink);
  const bool foremost = evidence.effects > std::max(evidence.free_before, evidence.free_after);
  const double enough = evidence.left < options.little_left_variances ? options.little_left_shrink_fraction
                                                                      : options.closed_shrink_fraction;
  const bool nearly = closes_all > (foremost ? enough : options.nearly_closed_fraction);
  // What stands against a name: a free signal that wins much beside it, or a size that is not the same everywhere.
  const double little = std::min(options.place_evidence_fraction * perfect, options.beside_log_likelihood);
  const double free_beside =
      nearly ? 0 : evidence.free_after / std::max(options.free_evidence_fraction * effects, little);
  // Or that it leaves most of a large gap: of all, of a typical segment, and in every output.
  const bool large = evidence.size > matters && evidence.excess > options.material_excess_variances;
  const double closes_most = std::max(evidence.shrink, evidence.typical_shrink);
  const bool leaves_most = large && closes_most < options.named_shrink_fraction &&
                           evidence.output_shrink < options.named_output_shrink_fraction;
  const double beside = std::max({free_beside, evidence.spread / options.size_spread, leaves_most ? kBeyondDoubt : 0});
  const double shrink = evidence.plain ? options.material_shrink_fraction : options.hidden_shrink_fraction;
  // Of all that is left, or of what is left in most segments, where a few in which the model goes astray hold it all.
  const bool closes = (evidence.shrink > shrink && evidence.shrink_low > 0) ||
                      (evidence.typical_shrink > shrink && evidence.typical_shrink_low > 0);
  // As little is left as on a rig in which nothing is missing, or next to nothing of what restarts hide: whatever wins
  // more there is no cause of this gap.
  const double hidden_enough = evidence.left < options.material_excess_variances ? options.closed_shrink_fraction
                                                                                 : options.nearly_closed_fraction;
  const bool closed = (evidence.left < evidence.quiet && evidence.shrink > options.closed_shrink_fraction) ||
                      (!evidence.plain && evidence.shrink > hidden_enough);
  // What restarts hide may be unlikely from sample to sample and close all, and a perfect model is no measure where no
  // place explains much (pays() of effect_worth.cpp).
  const bool beyond_free = evidence.plain && foremost && closes_all > options.hidden_shrink_fraction;
  const bool likely = evidence.effects > options.material_evidence_fraction * perfect ||
                      (evidence.excess > options.material_excess_variances && (evidence.plain ? beyond_free : closed));
  // A gap that need not have a cause, or hides in the noise, has one only where that is most of it.
  const bool most = closes_most >= options.small_gap_shrink_fraction;
  result.names =
      evidence.found && evidence.size > options.named_matters_fraction * matters && closes && likely && (most || large);
  // Without a name that holds: a signal at one place that wins much of a gap that matters tells a cause, or a gap that
  // is too large for a model whose structure fits.
  // What effects take of a free signal is no sign of another place, though they may close too little to be told.
  const double free = evidence.found ? std::min(evidence.free_before, evidence.free_after) : evidence.free_before;
  const double place = free / std::max(options.place_evidence_fraction * perfect,
                                       options.place_log_likelihood * std::max(evidence.readings, 1.0));
  const double misfit = std::min(evidence.size / (options.silent_matters_ratio * std::max(matters, 1e-9)),
                                 evidence.excess / options.silent_excess_variances);
  const double silent = std::max(large ? place : std::min(place, 0.5), misfit);
  // What would have to be larger than anything that is tried acts like the cause and is another one.
  if (result.names && (beside <= 1 || closed) && !evidence.beyond) {
    result.verdict = "named";
    result.doubt = std::min(beside, 1.0);
    return result;
  }
  // Effects that win much and leave much are a part of the cause, in a gap that must have one.
  const bool part = result.names && evidence.size > matters &&
                    (large || evidence.effects > options.partial_evidence_fraction * perfect);
  result.doubt = part ? std::max({beside, silent, evidence.beyond ? kBeyondDoubt : 0}) : silent;
  result.names = part || (result.names && silent > 1);
  result.placed = result.names || place > 1;
  if (result.doubt > 1)
    result.verdict = "unknown";
  else
    result.verdict = evidence.calibrated > options.miscalibrated_excess_variances ? "miscalibrated" : "none";
  return result;
}

}  // namespace faultline
