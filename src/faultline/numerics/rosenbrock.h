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
// Beside one another (integrator.h): with N = (2/h I - J)^-1 and M = N/h the four stages on d' = J d + g are
//
//   W = N (I + 14/3 M - 20/3 M^2 + 8/3 M^3),   y_m = y + 3/2 u_1 - u_2/6 + u_3/3 + u_4/2
//
// Where f is linear, f(y_m) is the mean rate of the step: what is not of J (a stiffer oil, a heavier body) is right
// even where the rates swing within a step.
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
