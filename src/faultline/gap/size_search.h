// Searches along one coordinate at a time, for effects whose loss has valleys that no derivative finds from afar.
#pragma once

#include <functional>

#include "faultline/gap/fit_gap.h"

namespace faultline {

// Where f is smallest on [low, high]: the best of `points` evenly spaced values, narrowed down to `width` by golden
// sections.
double narrow(const std::function<double(double)>& f, double low, double high, std::size_t points, double width);

// Looks for a better value of each of the last effect's coordinates (candidates.h) within `span` of where it is, the
// parameters adjusted to first order: what sticks, rings or plays. Returns the gain in log-likelihood; `fit` changes
// if there is one.
double search_effect(const ResidualModel& model, const Linearisation& linear, FitResult& fit, double span,
                     std::size_t points, int jobs = 1);

}  // namespace faultline
