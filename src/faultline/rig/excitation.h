// Raw set points over time, the same for every rig: one shape and its settings (of a profile in the datasheet), and a
// seed.
//
//   constant    value
//   square      low, high, period, duty [0.5], start [0]
//   triangle    amplitude, mean [0], period
//   sines       count, base, span, amplitude, roll_off, spread [0.03], fade [1]: sum of sines at f_k = base + span
//   k/count Hz
//               (each off by +-spread), amplitude exp(-(f/roll_off)^2), random phases
//   multisine   count, lowest, highest [Hz], amplitude [peak], mean [0], corner [1 Hz], fade [1 s]: random phases;
//               amplitudes as sqrt(lowest/f)/(1 + f/corner), so that the speed stays within what the rig can do;
//               repeats after 10/lowest s
//   chirp       lowest, highest [Hz], sweep [s], amplitude, mean [0]: sine whose frequency rises linearly from lowest
//               to highest over sweep, its amplitude from 0; starts over after sweep
//   steps       low, high, shortest, longest: random levels held for random times; with smallest, largest each is
//               that far from the last, up or down
//   prbs        low, high (magnitude), clock, longest: random sign and magnitude, held for 1..longest clocks
//   cycle       low, high, move, dwell: machine cycle, ramps with rests between
//   table       time [...], value [...]: linear in between
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

class Excitation {
 public:
  virtual ~Excitation() = default;
  virtual double value(double time) = 0;  // called with rising times; a smaller time starts over
};

std::unique_ptr<Excitation> make_excitation(const std::string& shape, const Settings& settings, std::uint64_t seed);
std::vector<std::string> excitation_shapes();

}  // namespace faultline
