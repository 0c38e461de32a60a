// A recorded signal without its white noise, and how much of that it has.
//
//   y(x) = a + b x + c x^2  least squares over 2 w + 1 samples around a row; a is the signal there (Savitzky, Golay,
//   Anal. Chem. 36, 1964); the widest window of those given whose misfit is no more than noise is taken
//   noise = median |y_k - 3 y_k-1 + 3 y_k-2 - y_k-3| / 0.6745 / sqrt(20)   third differences of white noise
//
// Readings that were resampled (interpolated between samples, averaged over some) have noise that is not white, which
// third differences show too little of. With the covariances g_j of noise that has none beyond lag 2, and those w_k of
// the weights 1, -3, 3, -1, third differences have at lag k
//
//   d_k = w_k g_0 + sum over j = 1, 2 of (w_(k-j) + w_(k+j)) g_j
//
// Least squares over lags 0 to 6 give the g_j. Where they describe all lags, as they do of no signal that moves, and
// the noise so found has a spectrum that nearly vanishes somewhere, as interpolation makes it, sqrt(g_0) is the noise.
//
// Samples that are missing (not a number) or at an end of their channel's range - the sensor can show no more: what it
// says is a bound - measure nothing: windows with one are passed over, and so are third differences.
#pragma once

#include "faultline/rig/datasheet.h"
#include "faultline/segments/segment_options.h"
#include "faultline/signal/sample.h"

namespace faultline {

// Whether a reading of the channel says what the value is; else it is missing, or a bound.
bool measures(const Channel& channel, double value);

struct Smoothed {
  double value = 0;
  double std = 0;                                  // of the value, from the noise alone
  double slope = 0, slope_std = 0, curvature = 0;  // per row: b and c, and how well b is known
};

// At a row, from rows first .. last - 1 only. Where no window around it describes the signal (a spool that jumps, an
// end of the rows), the sample itself, with the slope at the end of a window on one side that does. A sample that is
// missing is what the quadratic beside it says it was. Not a number where there is none, and at an end of the range.
// `widest`: samples on each side, at most. `noise`: of a sample.
Smoothed smoothed(const Recording& recording, std::size_t row, std::size_t column, std::size_t first, std::size_t last,
                  double noise, std::size_t widest, const SegmentOptions& options);

// The same where its slope counts: what is behind a sensor with a memory is what it shows and a multiple of the slope.
// From the widest window around or beside the row, up to `widest`, that describes the signal as well as noise alone
// would. slope_std holds what a quadratic may be off by unseen: a noise over half the window.
Smoothed smoothed_course(const Recording& recording, std::size_t row, std::size_t column, std::size_t first,
                         std::size_t last, double noise, std::size_t widest, const SegmentOptions& options);

// Smooths the recorded inputs (role input) in place within rows first .. last - 1, as far as what is taken away is
// white: their noise would break a stuck body loose too early. `noise`: per channel.
void smooth_inputs(const Datasheet& sheet, Recording& recording, std::size_t first, std::size_t last,
                   std::size_t widest, const std::vector<double>& noise, const SegmentOptions& options);

// Standard deviation of the noise on a signal, white or resampled; robust. 0 where there are too few samples.
double noise_floor(const Recording& recording, std::size_t column);

}  // namespace faultline
