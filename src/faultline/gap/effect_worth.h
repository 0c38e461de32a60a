// Whether an effect is worth having in the model: on held-out data, against the noise of measured inputs, and in how
// likely it leaves the recording from sample to sample. The search asks this in every round.
#pragma once

#include "faultline/gap/effect_search.h"

namespace faultline {

// Minus log likelihood of the learnt segments, sample to sample. Around the start states of its own: those of
// hidden states may lie far from what fits the model that stands.
double loss_of(const GapTrials& work, const std::vector<FreePlace>& noise, const Structure& structure);

// Whether much of what a structure wins is the noise's of measured inputs. What the rig has wins S here and loses it
// where it is not there; the noise gives N in both: the gains are S + N and N - S.
bool from_input_noise(const GapTrials& work, const FitResult& base, const Structure& structure);

// Whether the last effect of a structure has a size of nothing, or the least that is tried and much less wins as much:
// what it wins its port alone brings into the model, as the two bodies of a play without a gap, or finer steps.
bool has_no_size(const GapTrials& work, const Structure& structure);

// Whether a structure gains over what it was added to on runs that its fit did not see, and more than noise of inputs
// would give it.
bool gains(const GapTrials& work, const EffectSearch& now, const Structure& best);

// The part of what `now` leaves on held-out data that a structure closes.
double closes(const GapTrials& work, const EffectSearch& now, const Structure& best);

// The most that is closed of what is left in one output, among those where that is more than `least_excess` noise
// variances. Residuals per run, rows x outputs; 0 where a reading does not count.
double closes_one_output(const std::vector<Eigen::MatrixXf>& before, const std::vector<Eigen::MatrixXf>& after,
                         double least_excess);

// Whether a structure that gains over `now` is worth what it has more than `certain` against what that leaves.
bool pays(const GapTrials& work, const EffectSearch& certain, const EffectSearch& now, const Structure& best,
          double quiet_variances);

// Whether a structure that gains and does not pay leaves so much that another effect is missing beside it.
bool worth_a_trial(const GapTrials& work, const EffectSearch& now, const Structure& best);

// Whether what is left is worth a search: a gap that is large, or a free signal somewhere that would win much. Ripple,
// friction that sticks and what acts in a part of the runs only are hardly like a free signal.
bool more_to_find(const GapOptions::Search& options, const EffectSearch& now, bool large);

}  // namespace faultline
