// Which effects may explain what a model misses: every effect at every port of the datasheet where it fits, with the
// range of its parameters and a coordinate that runs evenly over that range.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

// Units as in segments/segment_options.h; coordinates run from 0 to 1 over a range.
struct CandidateOptions {
  // Ratio of a range's bounds from which its coordinate is logarithmic.
  double logarithmic_ratio = 20;
  // Starting points of a shape (a second parameter), coordinates.
  std::array<double, 3> shape_coordinates = {0.15, 0.5, 0.85};
  // ... of a size over a logarithmic range, coordinates,
  std::array<double, 5> logarithmic_coordinates = {0.1, 0.3, 0.5, 0.7, 0.9};
  // ... and of other sizes: fractions of the range on each side of no effect. Small effects are the more frequent.
  std::array<double, 3> size_fractions = {0.06, 0.25, 0.7};
  // ... of the time from which a signal is stuck, evenly spread: its loss has a narrow valley.
  std::size_t stuck_times = 12;
};

// An effect at a port with the range of each of its parameters.
struct Candidate {
  EffectSpec effect;  // parameters filled while fitting
  std::string family;
  std::vector<Bounds> bounds;               // per parameter of the type
  bool widened = false;                     // beyond what the datasheet says
  std::vector<std::vector<double>> starts;  // values to begin from, where those are known; else over the bounds
  double logarithmic_ratio = CandidateOptions().logarithmic_ratio;
  bool logarithmic(std::size_t parameter) const;
  double to_coordinate(std::size_t parameter, double value) const;  // 0..1 over the bounds
  double from_coordinate(std::size_t parameter, double coordinate) const;
};

// Of the same kind at the same port, whatever its size.
bool same_effect(const Candidate& a, const Candidate& b);

// Every effect at every fitting port of the datasheet, but for those in `without` ("effect" or "effect@port").
// `duration`: s, of the longest run: where an unbounded time may lie.
std::vector<Candidate> candidates(const Datasheet& sheet, const std::vector<std::string>& without, double duration = 60,
                                  const CandidateOptions& options = {});

// The same with shapes that have a usual value, and no range in the datasheet, over all that physics allows.
std::vector<Candidate> with_open_shapes(std::vector<Candidate> all);

// Candidate::starts, or starting points over the range: few for the size, few for a shape.
std::vector<std::vector<double>> starting_points(const Candidate& candidate, const CandidateOptions& options = {});

}  // namespace faultline
