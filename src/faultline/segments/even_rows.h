// A recording's rows on the even grid that a model is driven over.
//
//   T       sum of steps / sum of n, of rows with n up to 4 at T~    T~: the median over eight steps, each
//   e_k     time of the grid at row k: e_(k-1) + n T + 0.1 d_k,  n = round((t_k - e_(k-1)) / T),
//           d_k = t_k - e_(k-1) - n T; where the grid begins: the mean of 25 stamps there
//
// Stamps that jitter about the grid by less than `period_error_fraction` of a period are taken as lying on it: the time
// at which a stamp was written is less even than that at which its sample was taken. Up to 3 rows that are missing are
// put in: commands and inputs between their neighbours, everything else not a number, so that it does not count. What
// is farther off is a break.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/segments/segment_options.h"
#include "faultline/signal/sample.h"

namespace faultline {

// T [s] of a recording. The datasheet's, where it is the same within what a DAQ's clock is off, or where there are
// fewer than two rows.
double fitted_period(const Datasheet& sheet, const Recording& recording);

struct EvenRows {
  Recording recording;              // with the rows that were missing
  std::vector<std::size_t> breaks;  // rows before which there is a break, rising
  std::size_t filled = 0;           // rows that were put in
  std::string first_break;          // in words; empty: none
};

// Whether a sample `step` s after another goes on with its course: at most 3 rows lie between.
bool goes_on(double step, double period, double error_fraction);

// Of the readings that `rows` rows of the grid would have of the outputs that are compared with a model, how many there
// are: below kLeastMeasured a live stretch is not worth judging.
double measured_share(const Datasheet& sheet, const Recording& recording, std::size_t rows);
constexpr double kLeastMeasured = 0.8;

// `period`: T. Channels of the recording in the datasheet's order.
EvenRows even_rows(const Datasheet& sheet, Recording recording, double period, const SegmentOptions& options);

}  // namespace faultline
