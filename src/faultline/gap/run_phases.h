// In which phase an effect swings in each run: a pump that pulses pulses on between recordings, and no run begins at
// the phase of another one.
//
//   r_run + a_run s + b_run c ~ 0,   phase_run = atan2(b_run, a_run)
//
// r: residuals of the model that stands; s, c: what the effect adds to them as a sine and as a cosine of the frequency
// at a line of their spectrum, or of a whole order of a shaft's angle. Least squares run by run, each segment over its
// own noise level.
#pragma once

#include <vector>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// Per candidate that swings with a shaft and whose order is open, the whole order by which it wins most, each run in a
// phase of its own; NaN of all others, and where the model that stands swings already.
std::vector<double> likeliest_orders(const ResidualModel& model, const ModelChange& standing,
                                     const std::vector<Candidate>& candidates, int jobs);
// The candidates with these orders, where they are known.
std::vector<Candidate> at_orders(std::vector<Candidate> candidates, const std::vector<double>& orders);

// By how much what swings is ahead in each run of where it is in the first, less than half a period: of the candidate
// (at_orders(), at_lines()) that wins most so. All 0 where there is none, or one phase wins nearly as much; as they are
// where the model that stands swings already. Of each effect that swings only the two frequencies remain in
// `candidates` by which it wins most in these phases, and it begins at the size and phase by which it does
// (Candidate::starts).
RunPhases run_phases(const ResidualModel& model, const ModelChange& standing, std::vector<Candidate>& candidates,
                     int jobs);

}  // namespace faultline
