// Which effects may explain a gap: every effect at every port of the datasheet where it fits, with the range of its
// parameters and a coordinate that runs evenly over that range.
#pragma once

#include <string>
#include <vector>

#include "faultline/gap/gap_options.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

// An effect at a port with the range of each of its parameters.
struct Candidate {
  EffectSpec effect;  // parameters filled while fitting
  std::string family;
  std::vector<Bounds> bounds;  // per parameter of the type
  double logarithmic_ratio = GapOptions::Candidates().logarithmic_ratio;
  bool logarithmic(std::size_t parameter) const;
  double to_coordinate(std::size_t parameter, double value) const;  // 0..1 over the bounds
  double from_coordinate(std::size_t parameter, double coordinate) const;
};

// Of the same kind at the same port, whatever its size.
bool same_effect(const Candidate& a, const Candidate& b);

// Every effect at every fitting port of the datasheet, but for those in `without` ("effect" or "effect@port").
// `duration`: s, of the longest run: where an unbounded time may lie.
std::vector<Candidate> candidates(const Datasheet& sheet, const std::vector<std::string>& without, double duration = 60,
                                  const GapOptions::Candidates& options = {});

// Starting points over a candidate's range: few for the size, few for a shape.
std::vector<std::vector<double>> starting_points(const Candidate& candidate,
                                                 const GapOptions::Candidates& options = {});

}  // namespace faultline
