// Quantiles of distributions, by Boost.Math, and the one number that all 90 % bounds share.
#pragma once

namespace faultline {

// Half-width of two-sided 90 % bounds of a normal distribution, in standard deviations: its quantile at 0.95.
constexpr double kNinetyPercentSigmas = 1.6448536269514722;

// x with P(chi-squared of `freedom` degrees > x) = p, for freedom > 0 and 0 < p < 1.
double chi_squared_quantile_above(double freedom, double p);

// x with P(|T| < x) = 0.9 for Student's T with `freedom` > 0 degrees: half-width of 90 % bounds in standard errors
// that were themselves estimated from few values.
double student_ninety_percent(double freedom);

}  // namespace faultline
