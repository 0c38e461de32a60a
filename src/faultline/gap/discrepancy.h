// How wrong a model is on a rig, by place: the process noise at its state equations that makes the recording likeliest,
// and what a free signal at each port would win beside that (stochastic_model.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "faultline/gap/free_signal_filter.h"

namespace faultline {

struct FreePlace {
  std::string port;
  double level = 0;   // of the likeliest free signal, in the unit of what passes
  double memory = 0;  // s
  double gain = 0;    // log likelihood that it wins
};

struct Discrepancy {
  std::vector<double> losses;     // per block: minus log likelihood
  double loss = 0;                // their sum
  double readings = 0;            // that were held against the model
  std::vector<double> noise;      // per state: standard deviation of the process noise in a step, in its unit
  std::vector<FreePlace> places;  // best first
};

// What the best free signal wins; 0 where none was tried or wins.
inline double most_free(const Discrepancy& d) { return d.places.empty() ? 0 : d.places.front().gain; }

// A stochastic model, and the variances of its process noise per step (in sizes squared) that make the recording
// likeliest.
struct FittedProcess {
  StochasticModel model;
  Eigen::VectorXd q;
};
FittedProcess fit_process(const ResidualModel& residuals, const ModelChange& change,
                          const std::vector<std::size_t>& runs, int jobs);

enum class Places { none, free };  // whether free signals are tried
// `noise`: signals at sensors that belong to the model as it is, for a transducer's noise may have a memory. An input's
// drives the model.
Discrepancy find_discrepancy(const ResidualModel& residuals, const ModelChange& change,
                             const std::vector<std::size_t>& runs, int jobs, Places places,
                             const std::vector<FreePlace>& noise = {});

// Which of the outputs a sensor's port shows; nothing for other ports.
std::optional<std::size_t> output_of(const ResidualModel& residuals, const std::string& port);

// Whether restarts in every step leave an effect as it is: no state of its own, no memory behind which a state shows.
// Of others the likelihood says too much.
bool restarts_freely(const EffectSpec& effect);

}  // namespace faultline
