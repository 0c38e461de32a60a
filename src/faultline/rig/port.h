// A port: a named place of a rig, with a kind. What passes through each kind of port stands here as one small struct
// (or a plain number); effects that sit at the port change it, and the rig's equations use what comes out.
//
//   command.X, sensor.Y   a signal: one number per integration step
//   force.BODY            Motion in, BodyForces out
//   flow.FROM_TO          Gap in, volume flow out
//   restriction.PLACE     an opening (area, coefficient, spool travel), one number; one edge; the pressure difference
//   compliance.VOLUME     bulk modulus of a volume at an absolute pressure
//   source.NAME           a boundary value, given the flow drawn from it and the time
//   transmission.NAME     Coupling
//   line.NAME             Line
//   heat.VOLUME           HeatPath
#pragma once

#include <array>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace faultline {

enum class PortKind { command, sensor, force, flow, restriction, compliance, source, transmission, line, heat };

std::string to_string(PortKind kind);
PortKind port_kind(const std::string& port_name);  // from the part before the dot; InputError if there is no such kind

struct Bounds {
  double minimum = 0;
  double maximum = 0;
};

// Which effect makes sense at a port, and within which bounds of its parameters.
struct FittingEffect {
  std::string effect;
  std::map<std::string, Bounds> bounds;
};

struct Port {
  std::string name;  // kind.place
  PortKind kind = PortKind::command;
  std::string component;
  std::string meaning;
  std::string channel;                       // command and sensor ports: the channel that passes; else empty
  std::string unit;                          // of what passes, where no channel says it; else empty
  std::string drop_unit;                     // of pressure differences, where that is not Pa; else empty
  std::map<std::string, std::string> units;  // of sizes ("elasticity.compliance"), where they are not the effect's
  double range = 1;                          // what a curve at this port calls full scale, in the unit of what passes
  std::vector<FittingEffect> effects;
};

struct Motion {
  double position = 0;  // m or rad
  double velocity = 0;  // m/s or rad/s
  double load = 0;      // what load-dependent friction grows with; the datasheet says what (Pa or N)
  bool rubs = true;     // false: of a second body of the place, on which loads act and no friction
};

// Forces on a body that its port's effects add, in N (or N m). All resist: the rig subtracts them.
struct BodyForces {
  double applied = 0;         // loads and stops: sign as they come, against positive motion
  double viscous = 0;         // smooth friction and bristles, already with their sign
  double sliding_plus = 0;    // Coulomb level while the body moves to +
  double sliding_minus = 0;   // Coulomb level while it moves to - (as a magnitude)
  double breakaway_plus = 0;  // level that must be exceeded to leave standstill to +
  double breakaway_minus = 0;
  double mass = 0;  // kg or kg m^2 that moves with the body
};

struct LeakPath {
  double pressure_drop = 0;  // Pa, from minus to
  double upstream = 0;       // Pa gauge, pressure at the FROM side
  double shaft_speed = 0;    // rad/s, where a pump or motor is the place
};

struct Coupling {
  double factor = 1;      // what is handed on, times factor
  double gap = 0;         // m or rad, total play
  double compliance = 0;  // m/N or rad/(N m)
  double damping = 0;     // N s/m or N m s/rad
};

struct Line {
  double inertance = 0;  // Pa s^2/m^3
};

struct HeatPath {
  double loss = 0;      // W/K to ambient
  double capacity = 0;  // J/K that must be warmed with the fluid
  double factor = 1;    // heat flux times factor
};

struct Viscosity {
  double factor = 1;  // viscous friction times factor, laminar leakage divided by it
};

// What an effect at a port sees of what passes: quantities on which it may depend. `unit` as in EffectParameter.
struct PassingQuantity {
  std::string name;
  std::string unit;
};
constexpr std::size_t kMostPassing = 3;
using Passed = std::array<double, kMostPassing>;      // NaN: nothing
std::vector<PassingQuantity> passing(PortKind kind);  // at most kMostPassing
constexpr Passed nothing_passed() {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return {kNone, kNone, kNone};
}

}  // namespace faultline
