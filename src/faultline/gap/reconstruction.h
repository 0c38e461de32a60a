// A missing signal over time: the free signal of discrepancy.h at one place, smoothed beside a process noise of its
// own.
#pragma once

#include <string>
#include <vector>

#include "faultline/gap/discrepancy.h"
#include "faultline/gap/signal_terms.h"

namespace faultline {

using SignalCourses = std::vector<Eigen::VectorXd>;  // per stretch, per row, in the port's unit

struct Reconstruction {
  StochasticModel model;  // linear around the states as smoothed with the signal; one port
  Eigen::VectorXd q;      // variances of the process noise, likeliest with the signal
  FreeSignal signal;
  Smoothing course;
  double unit() const { return model.unit.front(); }
};

Reconstruction reconstruct(const ResidualModel& residuals, const ModelChange& change, const FreePlace& place,
                           const std::vector<std::size_t>& runs, int jobs);

// The model with a known course of the signal beside the free one.
StochasticModel with_signal(StochasticModel model, const SignalCourses& known);

// On what the signal may depend: what passes the port first, then the states, then commands and inputs; each once.
std::vector<SignalVariable> find_variables(const ResidualModel& residuals, const ModelChange& change,
                                           const Reconstruction& at);

}  // namespace faultline
