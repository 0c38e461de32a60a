// Sharp lines in the spectrum of residuals: where an effect that swings would have to swing. Its frequency is a
// valley as narrow as one over the length of the run, which no coarse search meets.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/gap_options.h"

namespace faultline {

// Up to options.lines frequencies [Hz] between `low` and `high` at which the residuals' power, summed over columns
// and runs, stands out most from its neighbourhood (median), strongest first. `periods`: s, between rows, of each run;
// a run says nothing above half its sample rate.
std::vector<double> spectral_lines(const std::vector<Eigen::MatrixXf>& residuals, const std::vector<double>& periods,
                                   double low, double high, const GapOptions::Spectrum& options = {});

// The candidates, those with a frequency once for each line within its range, narrowed to that line's width, with any
// phase.
std::vector<Candidate> at_lines(const std::vector<Candidate>& candidates, const std::vector<Eigen::MatrixXf>& residuals,
                                const std::vector<double>& periods, const GapOptions::Spectrum& options = {});

}  // namespace faultline
