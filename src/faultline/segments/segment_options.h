// Every constant of the segments (segmented_run.h, segment_model.h) on which an answer depends: what it means, its
// unit (in the name), why it has this value. docs/options.md has how much the answers change when each is halved and
// doubled. Lengths of segments are no option: they are the rig's (segment_length.h).
//
// Units: _samples; _s; _sigma: standard deviations of the noise, or of what the comment names; _variances: noise
// variances; _fraction and _ratio of what the comment names. Numbers without a unit count.
#pragma once

#include <array>
#include <cstddef>

namespace faultline {

struct SegmentOptions {
  // Samples on each side of the quadratic that gives a start state, widest first: averages 13 or 7 samples.
  std::array<std::size_t, 2> start_half_width_samples = {6, 3};
  // Mean squared misfit up to which that quadratic describes the signal: twice the noise, which white noise exceeds
  // rarely.
  double start_misfit_variances = 2;
  // Least standard deviation of the prior of a start state, in noise of its channel: smoothing within a bend is biased
  // by about this.
  double start_prior_sigma = 2;
  // Step of the differences by the start state, in standard deviations of that prior: large against rounding, small
  // against bends.
  double start_difference_sigma = 0.5;
  // Largest shift of a start state, in the same: beyond, the segment's misfit is not the start's.
  double start_shift_limit_sigma = 20;
  // Samples on each side of the smoothing of measured inputs, widest first.
  std::array<std::size_t, 4> input_half_width_samples = {12, 6, 3, 2};
  // What smoothing may take away, as a ratio to what it takes of white noise: a tenth more is scatter of the estimate,
  // not signal.
  double input_removed_variance_ratio = 1.1;
  // Largest half width of any smoothing, as a fraction of a segment: samples average noise, but must be short against
  // the motion that a segment is made to show.
  double smoothing_segment_fraction = 0.1;
  // Residuals are cut at this many sigmas, or at a channel's range where that is more: finite where a model diverges.
  double largest_residual_sigma = 1e4;
  // Least noise of a channel as a fraction of the datasheet's: a signal that stood still must not count without limit,
  // and a transducer that is five times better than its datasheet must.
  double least_noise_fraction = 0.1;
  // What a model may leave of an output's noise, as a ratio, for the rest to be motion: a model that explains nothing
  // of it leaves all of it, give or take a tenth.
  double model_noise_ratio = 0.7;
  // Noise of a measured input, in what the datasheet says of it, beyond which it is motion: transducers are up to some
  // ten times noisier than their datasheets.
  double most_input_noise_ratio = 20;
  // Distinct values from which those of a signal tell the grid it was rounded to.
  std::size_t grid_least_levels = 3;
  // Of the largest value, up to which two are the same but for the digits of a file.
  double grid_same_fraction = 1e-9;
  // Deviation of a stamp from the grid of the run's period, as a fraction of it, up to which it is jitter: beyond a
  // half it would be nearer to the next place.
  double period_error_fraction = 0.45;
  // Readings of a segment that count, as a fraction of all: fewer are not taken to speak for all of them.
  double least_counted_fraction = 0.25;
  // Run ahead of each piece of a recording of which only pieces are run, where the model has memories to fill (a play
  // is used up when the motion has turned once or twice) or states that no start puts back, which go on.
  std::size_t ahead_segments = 2;
  // Whether the model takes long steps where its motion is even: for answers that are asked for many times over. Not
  // where small differences between models are weighed over long recordings.
  bool long_steps = false;
  // Whether its long steps may go beside those of another (integrator.h), for derivatives that may be off by 5 %, where
  // dry friction switches by 10 %: forward differences.
  bool beside = false;
  bool rough = false;  // ... and steps of what is fast may be longer
};

template <class Visit>
void for_each_option(SegmentOptions& options, Visit&& visit) {
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(start_half_width_samples);
  FAULTLINE_OPTION(start_misfit_variances);
  FAULTLINE_OPTION(start_prior_sigma);
  FAULTLINE_OPTION(start_difference_sigma);
  FAULTLINE_OPTION(start_shift_limit_sigma);
  FAULTLINE_OPTION(input_half_width_samples);
  FAULTLINE_OPTION(input_removed_variance_ratio);
  FAULTLINE_OPTION(smoothing_segment_fraction);
  FAULTLINE_OPTION(largest_residual_sigma);
  FAULTLINE_OPTION(least_noise_fraction);
  FAULTLINE_OPTION(model_noise_ratio);
  FAULTLINE_OPTION(most_input_noise_ratio);
  FAULTLINE_OPTION(grid_least_levels);
  FAULTLINE_OPTION(grid_same_fraction);
  FAULTLINE_OPTION(period_error_fraction);
  FAULTLINE_OPTION(least_counted_fraction);
  FAULTLINE_OPTION(ahead_segments);
#undef FAULTLINE_OPTION
}

}  // namespace faultline
