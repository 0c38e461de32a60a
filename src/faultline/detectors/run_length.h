// How long tests on white Gaussian residuals run until they alarm, and thresholds from a wanted rate of false alarms.
// Sources: Brook, Evans, "An approach to the probability distribution of CUSUM run length", Biometrika 59 (1972), with
// the integral equation solved at Gauss-Legendre nodes (Goel, Wu, Technometrics 13, 1971); van Dobben de Bruyn (1968)
// for the two sides together.
//
// All in units of the residual's sigma: k = delta/(2 sigma), h = lambda/sigma, shift = mean of the residual/sigma.
//   one side:  L(s) = 1 + L(0) Phi(-s + k - shift) + integral_0^h L(x) phi(x - s + k - shift) dx, at s = 0
//   both:      1/L = 1/L(shift) + 1/L(-shift)
// Holds for white residuals only: a residual that is filtered or drifts crosses more often.
#pragma once

namespace faultline {

// Mean number of samples until one side alarms.
double cusum_run_length(double k, double h, double shift);
double two_sided_run_length(double k, double h, double shift);
// h with which a two-sided test alarms falsely once in `samples` samples on average. InputError where none up to 1e4
// does.
double cusum_threshold(double k, double samples);
// The same by Siegmund's approximation (Sequential Analysis, 1985), L = (exp(2 k b) - 1 - 2 k b)/(2 k^2), b = h +
// 1.166: within 2 % of h, in a microsecond.
double siegmund_threshold(double k, double samples);

}  // namespace faultline
