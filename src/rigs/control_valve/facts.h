// What the modules of the control valve are made of: numbers of the datasheet or of one drawn valve, by name, and what
// acts at the ports. And how a body without mass moves: as fast as viscous friction lets the force that leaves its
// Coulomb band, but not out of its stops.
#pragma once

#include <string>
#include <vector>

#include <fmt/format.h>

#include "faultline/rig/rig.h"
#include "faultline/signal/error.h"

namespace faultline {

constexpr double kPi = 3.14159265358979323846;

struct ValveFacts {
  const Datasheet& sheet;
  const std::vector<double>& parameters;
  const EffectSet& effects;

  double parameter(const char* name) const { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; }
  double constant(const char* name) const {  // InputError where the datasheet lacks it
    const auto found = sheet.constants.find(name);
    if (found != sheet.constants.end()) return found->second;
    throw InputError(
        fmt::format("{}: 'constants' lacks '{}', which the equations of {} ask for", sheet.file, name, sheet.rig));
  }
};

// dz of the equations: how far a force lies outside the band.
inline double outside(double force, double low, double high) {
  return force > high ? force - high : force < low ? force - low : 0;
}

inline double within_stops(double speed, double position, double low, double high) {
  return (position <= low && speed < 0) || (position >= high && speed > 0) ? 0 : speed;
}

}  // namespace faultline
