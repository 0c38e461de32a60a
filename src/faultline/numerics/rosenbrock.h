// Fixed-step integration of a stiff system by RODAS3, a Rosenbrock method: implicit through one Jacobian a step, no
// iteration.
//
//   (2/h I - J) u_i = f(t + a_i h, y + sum_j A_ij u_j) + sum_j C_ij/h u_j + g_i h df/dt
//   y(t + h) = y + 2 u_1 + u_3 + u_4
//
// Four stages, order 3, L-stable and stiffly accurate, so that what settles within microseconds is settled at the end
// of a step of any size, moving boundary values included (Sandu, Verwer, Blom, Spee, Carmichael, Potra, Atmospheric
// Environment 31, 1997). Nothing is allocated after construction.
//
// A system that is nearly another one, f* near f, is integrated beside it by what the other's step is made of anyway:
//
//   y* = y + d,   d' = J d + g,   g = f*(t + h/2, y_m + d) - f(t + h/2, y_m) - J d,   d as at the step's beginning
//   y_m = y + 3/2 u_1 - u_2/6 + u_3/3 + u_4/2
//
// with the same method, J and factors: second order in h, for one evaluation of f* and four solutions a step. Where d
// stays small that is how a course changes with parameters, effects and start states. y_m lies in the middle; where f
// is linear, f(y_m) is the mean rate of the step. So what g takes of the rates (a stiffer oil, a heavier body) is right
// even where they swing within a step. Where J changes by a good part (a quarter of the mass more), half of the
// answer may be wrong.
#pragma once

#include <memory>
#include <vector>

#include "faultline/numerics/integrator.h"

namespace faultline {

// The system must outlive it. Up to kFewStates states the matrix counts as full.
std::unique_ptr<Integrator> make_rosenbrock(OdeSystem& system);

// Brings `state` to rest for held inputs at time 0: implicit Euler steps that grow until they are Newton steps.
// Returns the states that did not come to rest, none if all did: those whose last step was not below 1e-6 of the
// largest value they had on the way.
std::vector<int> settle(OdeSystem& system, const double* inputs, double* state);

}  // namespace faultline
