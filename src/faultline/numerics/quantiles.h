// Quantiles of distributions, by Boost.Math, the one number that all 90 % bounds share, and the median of values.
#pragma once

#include <vector>

namespace faultline {

// Half-width of two-sided 90 % bounds of a normal distribution, in standard deviations: its quantile at 0.95.
constexpr double kNinetyPercentSigmas = 1.6448536269514722;

// x with P(chi-squared of `freedom` degrees > x) = p, for freedom > 0 and 0 < p < 1.
double chi_squared_quantile_above(double freedom, double p);

// x with P(|T| < x) = 0.9 for Student's T with `freedom` > 0 degrees: half-width of 90 % bounds in standard errors
// that were themselves estimated from few values.
double student_ninety_percent(double freedom);

// The middle of the values in order, the upper of two; there must be one.
double median(std::vector<double> values);

}  // namespace faultline
