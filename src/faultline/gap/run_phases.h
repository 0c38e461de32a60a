// In which phase an effect swings in each run: a pump that pulses pulses on between recordings, and no run begins at
// the phase of another one.
//
//   r_run + a_run s + b_run c ~ 0,   phase_run = atan2(b_run, a_run)
//
// r: residuals of the model that stands; s, c: what the effect adds to them as a sine and as a cosine of the frequency
// at a line of their spectrum. Least squares run by run, each segment over its own noise level.
#pragma once

#include <vector>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// s, by which what swings is ahead in each run of where it is in the first, less than half a period: of the candidate
// with a frequency and a phase (at_lines()) that wins most so. All 0 where there is none, or one phase wins nearly as
// much; as they are where the model that stands swings already.
std::vector<double> run_phases(const ResidualModel& model, const ModelChange& standing,
                               const std::vector<Candidate>& candidates, int jobs);

}  // namespace faultline
