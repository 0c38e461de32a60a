// Drives one effect through everything that can pass a port of one kind, and returns all numbers that come out.
// Signals run from 0 to 2 s at full scale 1 (a multisine, steps, zero); other kinds walk over a grid that includes
// zero, both signs and, for pressures, vacuum.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "faultline/rig/effect.h"

namespace faultline {

constexpr double kProbeStep = 1e-3;     // s
constexpr double kProbeDuration = 2.0;  // s

// One size of each effect at which it plainly changes what the probe sends; `name=value,...`. Empty: not known here.
inline std::string typical_size(const std::string& effect) {
  static const std::vector<std::pair<std::string, std::string>> sizes = {
      {"added_mass", "mass=2"},
      {"area_curve", "exponent=1.4"},
      {"asymmetric_friction", "difference=30"},
      {"backlash", "gap=1e-3"},
      {"clogging", "fraction=0.2"},
      {"compliance_factor", "factor=0.5"},
      {"coulomb_friction", "force=50"},
      {"deadband", "width=0.2"},
      {"delay", "time=0.0123"},
      {"displacement_ripple", "amplitude=0.05,order=9"},
      {"drift", "rate=0.1"},
      {"droop", "resistance=1e9"},
      {"elasticity", "compliance=1e-6,damping=200"},
      {"end_stop", "position=0.02,stiffness=1e5"},
      {"entrained_air", "fraction=0.02"},
      {"flow_exponent", "exponent=0.6,nominal_drop=1e5"},
      {"free_curve", "of=0,low=-2,high=2,v1=0.02,v3=-0.03,v4=0.05,v5=0.1,v8=0.3"},
      {"free_signal", "value=0.1"},
      {"gain_curve", "curvature=0.3"},
      {"heat_capacity", "capacity=500"},
      {"heat_loss", "coefficient=100"},
      {"hysteresis", "width=0.1"},
      {"lag", "time_constant=0.02"},
      {"laminar_leakage", "coefficient=1e-12"},
      {"line_inertia", "inertance=1e7"},
      {"load_dependent_friction", "coefficient=1e-4"},
      {"load_force", "constant=100,stiffness=2000"},
      {"noise", "std=0.01"},
      {"offset", "value=0.1"},
      {"orifice_leakage", "coefficient=1e-9"},
      {"overflow", "rim=5e6,slope=1e-11,share=0.4"},
      {"presliding_friction", "force=50,stiffness=1e4"},
      {"quantisation", "step=0.05"},
      {"rate_limit", "rate=3"},
      {"relief_opening", "cracking_pressure=5e6,slope=1e-11"},
      {"ripple", "amplitude=1e5,frequency=7"},
      {"saturation", "limit=0.5"},
      {"scale", "factor=1.2"},
      {"second_order_lag", "natural_frequency=50,damping=0.4"},
      {"speed_leakage", "coefficient=1e-14"},
      {"stribeck_friction", "static_excess=40,velocity=0.02"},
      {"stuck", "from=0.7"},
      {"underlap", "width=0.2"},
      {"viscosity_drift", "factor=0.8"},
      {"viscous_friction", "coefficient=300"},
  };
  for (const auto& [name, size] : sizes)
    if (name == effect) return size;
  return "";
}

inline std::vector<double> typical_parameters(const EffectType& type) {
  return parse_effect(type.name + "@" + to_string(type.fits.front()) + ".probe:" + typical_size(type.name)).parameters;
}

inline std::unique_ptr<Effect> made(const EffectType& type, const std::vector<double>& parameters,
                                    double step = kProbeStep) {
  std::vector<double> none;
  for (const auto& p : type.parameters) none.push_back(p.none);
  PortContext context;
  context.range = 1;
  context.noise_std = 0.01;
  context.step = step;
  context.seed = 7;
  auto effect = type.make();
  effect->configure(parameters, none, context);
  return effect;
}

// Each step takes `ramp` s; 0: it is a jump.
inline double probe_signal(double time, double ramp = 0) {
  if (time < 1.2)
    return 0.5 * std::sin(6.1 * time + 0.3) + 0.3 * std::sin(19.7 * time + 1.1) + 0.15 * std::sin(47.3 * time + 2.0);
  double from = probe_signal(1.2 - 1e-12), value = from;
  for (const auto& [start, level] :
       {std::pair{1.2, 0.8}, std::pair{1.4, -0.9}, std::pair{1.6, 0.0}, std::pair{1.8, 0.25}}) {
    if (time < start) break;
    const double done = ramp > 0 ? std::min(1.0, (time - start) / ramp) : 1;
    value = from + done * (level - from);
    from = level;
  }
  return value;
}

// Signal after the effect, at multiples of `every` steps.
inline std::vector<double> probe_signals(Effect& effect, double step, int every, double ramp = 0) {
  std::vector<double> out;
  const int count = static_cast<int>(std::lround(kProbeDuration / step));
  for (int k = 0; k <= count; ++k) {
    const double time = k * step;
    const double y = effect.signal(probe_signal(time, ramp), time);
    if (k % every == 0) out.push_back(y);
  }
  return out;
}

inline std::vector<double> probe(Effect& effect, PortKind kind) {
  std::vector<double> out;
  switch (kind) {
    case PortKind::command:
    case PortKind::sensor:
      return probe_signals(effect, kProbeStep, 1);
    case PortKind::force:
      for (double load : {-5e6, 0.0, 2e6})
        for (double velocity : {-0.5, -0.01, 0.0, 0.003, 0.2})
          for (double position : {-0.06, 0.0, 0.03, 0.06, 0.01}) {
            BodyForces f;
            effect.force({position, velocity, load}, f);
            out.insert(out.end(), {f.applied, f.viscous, f.sliding_plus, f.sliding_minus, f.breakaway_plus,
                                   f.breakaway_minus, f.mass});
          }
      return out;
    case PortKind::flow:
      for (double drop : {-7e6, -2e4, -300.0, 0.0, 100.0, 1e5, 7e6})
        for (double speed : {-100.0, 0.0, 300.0}) {
          LeakPath path;
          path.pressure_drop = drop;
          path.upstream = drop > 0 ? drop : 0;
          path.shaft_speed = speed;
          out.push_back(effect.flow(path) * 1e4);  // in units of 0.1 l/s, so that all probes are of order one
          out.push_back(out.back() * effect.arriving_share());
        }
      return out;
    case PortKind::restriction:
      for (int i = -24; i <= 24; ++i) out.insert(out.end(), {effect.opening(i / 20.0), effect.edge(i / 20.0)});
      for (double drop : {-7e6, -100.0, 0.0, 1e5, 7e6}) out.push_back(effect.drop(drop) * 1e-6);
      return out;
    case PortKind::compliance:
      for (double modulus : {1e5, 2e8, 1.4e9})
        for (double pressure : {-1e5, 0.0, 1e4, 101325.0, 1e6, 1.4e7})
          out.push_back(effect.bulk_modulus(modulus, pressure) / modulus);
      return out;
    case PortKind::source: {
      for (double value : {0.0, 7e6})
        for (double flow : {-1e-4, 0.0, 4e-4})
          for (double time : {0.0, 0.01, 0.33, 40.0}) out.push_back(effect.boundary(value, flow, time));
      for (double angle : {-2.0, 0.0, 0.1, 50.0}) out.push_back(effect.delivery(3e-4, angle) * 1e4);
      Viscosity viscosity;
      effect.viscosity(viscosity);
      out.push_back(viscosity.factor);
      return out;
    }
    case PortKind::transmission: {
      Coupling c;
      effect.coupling(c);
      return {c.factor, c.gap, c.compliance, c.compliance * c.damping};
    }
    case PortKind::line: {
      Line line;
      effect.line(line);
      return {line.inertance};
    }
    case PortKind::heat: {
      HeatPath h;
      effect.heat(h);
      return {h.loss, h.capacity, h.factor};
    }
  }
  return out;
}

inline double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = a.size() == b.size() ? 0 : kInfinity;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) largest = std::max(largest, std::fabs(a[i] - b[i]));
  return largest;
}

}  // namespace faultline
