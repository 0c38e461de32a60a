// Fixed-step integration of a stiff rig by Rosenbrock methods, implicit through one Jacobian a step and without iteration:
//
//   (1/(h g) I - J) u_i = f(t + a_i h, y + sum_j A_ij u_j) + sum_j C_ij/h u_j + g_i h df/dt,   y(t + h) = y + sum_i m_i u_i
//
// (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.7.) Both schemes are L-stable, so that what settles within
// microseconds is simply settled at the end of a step of any size. Nothing is allocated after construction.
//   accurate  RODAS3: four stages, order 3, stiffly accurate (Sandu, Verwer, Blom, Spee, Carmichael, Potra 1997)
//   quick     ROS2, g = 1 - 1/sqrt2: two stages, order 2 (Verwer, Spee, Blom, Hundsdorfer 1999)
#pragma once

#include <array>
#include <vector>

#include "faultline/rig/integrator.h"
#include "faultline/rig/sparse_lu.h"

namespace faultline {

class Rosenbrock : public Integrator {
 public:
  Rosenbrock(Rig& rig, Scheme scheme);
  void start(const double* channels) override;
  void start_at(const double* nominal_state, const double* channels) override;
  void step(double time, double dt, const double* channels) override;
  const double* state() const override { return state_.data(); }

 private:
  static constexpr std::size_t kStages = 4;
  struct Tableau {
    std::size_t stages;
    double gamma;
    std::array<double, kStages> alpha, gammas, weights;
    std::array<std::array<double, kStages>, kStages> a, c;
    std::array<bool, kStages> new_rate;  // whether the stage needs f anew, or takes that of the stage before
  };
  static const Tableau& tableau(Scheme scheme);

  Rig& rig_;
  const Tableau& tableau_;
  std::size_t states_;
  SparseLu lu_;
  std::vector<double> state_, stage_state_, rate_, time_rate_, jacobian_;
  std::array<std::vector<double>, kStages> u_;
};

// Brings `state` to rest for held channels at time 0: implicit Euler steps that grow until they are Newton steps.
void settle(Rig& rig, const double* channels, double* state);

}  // namespace faultline
