// Hypotheses of what is wrong, weighed on stretches of samples: to first order all at once (attribution/screening.h),
// then by running the model with the effect in it, at a few sizes of each, and for the best by parabolas through
// three losses.
#pragma once

#include <map>
#include <vector>

#include "faultline/estimators/stretch_model.h"

namespace faultline {

struct RankedFault {
  std::size_t hypothesis = 0;
  double amplitude = 0, std = 0;
  double evidence = 0;
};

// What hypotheses are weighed on.
struct Scene {
  Eigen::MatrixXd prior;  // [r T]'[r T] of what is known of theta
  Stretches stretches;
  ModelPoint point;
  double healthy_loss;  // without any fault beside those of the point
};

// To first order, best first. `gram`: [r T D]'[r T D], what is known of theta in it.
std::vector<RankedFault> screen(const StretchModel& model, const Eigen::MatrixXd& gram);

// Steps towards the amplitude of the least loss: robust where the response bends. `loss`: at the start, where known.
RankedFault refine(const StretchModel& model, const Scene& scene, RankedFault start, double loss = kInfinity);

// Of `screened` the best, refined, best first. `before`: amplitudes of those that explained best what is still there;
// empty: all are tried anew at a few sizes each, since the first order misses what only a large fault does (a piston
// that no longer breaks away). What explains less than `alternative_evidence_fraction` of what the first to first order
// does is neither followed nor refined. `closely`, if given, takes the amplitudes of the best before they are refined.
std::vector<RankedFault> best_of(const StretchModel& model, const Scene& scene, std::vector<RankedFault> screened,
                                 const std::map<std::size_t, double>& before,
                                 std::map<std::size_t, double>* closely = nullptr);

// What is wrong beside the best of `found`: all looked for anew around the model with that in it, so that segments
// count by what is left of them. Empty where nothing has more evidence than `limit`.
std::vector<RankedFault> beside(const StretchModel& model, Scene scene, const std::vector<RankedFault>& found,
                                double limit, const std::map<std::size_t, double>& before);

// s, when effects began that `shows` is the first stretch to show: at the beginning of the segment in it from which on
// they explain most, if those before say clearly that they were not there, else of the stretch; or likewise in the
// stretch before, if that has one, when its last segments say clearly that they were.
double onset(const StretchModel& model, const Scene& scene, const Stretch* before, const Stretch& shows,
             const std::vector<EffectSpec>& effects);

// What a fault was found by: its cause then, and the stretch that says most for that.
struct Found {
  RankedFault cause;
  Recording stretch;
};

Found found_in(const StretchModel& model, const Scene& scene, const RankedFault& cause);

// Whether a cause says nothing of the stretch in which a fault was found, whatever its size was then, and is not that
// fault grown: it came later, and what was found then is another.
bool came_later(const StretchModel& model, const Scene& scene, const Found& found, const RankedFault& cause);

// Puts a hypothesis first of `ranked` where it explains as much as the best but for `margin`. False: it does not, or
// is the best.
bool put_first(std::vector<RankedFault>& ranked, std::size_t hypothesis, double margin);

// How many of the latest stretches, one after the other, speak for a cause alone; at least one.
std::size_t speaking_alone(const StretchModel& model, const Scene& scene, const RankedFault& cause);

}  // namespace faultline
