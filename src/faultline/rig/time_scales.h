// A step test of a rig's model: all commands step through their ranges, each level held until the states rest, and
// what was seen on the way is kept: how fast the rig is, which values its states take, which levels its sensors can
// show. Lengths, amplitudes and noise that a datasheet does not give are taken from it.
//
//   levels        0.5, 0.3, 0.7, 0.2, 0.8, 0.4, 0.6, 0.1, 0.9 of each command's range, all commands alike; inputs at
//                 the datasheet's value, else in the middle of their range; ground truth commands as near 0 as they go
//   rest          no state moved in the second half of the level by more than 2 % of what it moved through in the test;
//                 else the level ends after 2000 sample periods
//   J             d(rate)/d(state) by central differences of 1e-5 of a state's size, at 4, 16, 64, 256, 1024 sample
//                 periods after a step and at its end; per point its modes, the eigenvalues lambda of J
//
// Time scales [s] are medians over the points of the slowest and the fastest mode of each:
//   slowest       1/|Re lambda|, how long the rig remembers, of modes that decay within 1e5 sample periods. What is
//                 slower, does not decay or grows is an integrator: no recording shows where it would end. Without any
//                 mode that decays: 100 sample periods.
//   fastest       1/|lambda|, of modes that a sample period can follow (1/|lambda| >= period); faster ones are over
//                 within a sample and say nothing of lengths. Without any: the sample period.
//   hidden        the slowest of the states that no channel shows, the others held: the slowest mode of J without the
//                 rows and columns of those. 0: there are none, or none that decays.
//   settling      after a step, until every state that it moved stays within 5 % of its way; median over the levels
//                 that came to rest. Of one mode three times its scale, of a chain of equal modes, which no eigenvalue
//                 shows to be slow together, many times. Where no level comes to rest: three times the slowest scale.
// period <= fastest <= slowest. Good within a factor of two: a nonlinear rig has a scale of its own at every level.
// Fails where the rig needs a controller to stay where it works: levels then end at its stops.
// Deterministic; takes up to 18000 sample periods of the model (0.01 to 0.5 s).
#pragma once

#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

struct TimeScales {
  double slowest_s = 0, fastest_s = 0, settling_s = 0, hidden_s = 0;
  int integrators = 0;  // most at any point
};

// Of a watch of a transducer's noise by second differences (detectors/noisy.cpp), as it is set for any rig.
constexpr double kNoisyLimit = 3, kNoisyWindow = 10;  // samples

// What such a watch sees of the model's own motion: set for `noise` times the channel's it is beyond its limit for no
// longer than `samples`. The least noise of 1, 2, 4, ... of which that is no more than 50.
struct Bends {
  double noise = 1, samples = 0;
};

struct StepTest {
  struct Point {
    std::vector<double> state;     // the datasheet's states
    std::vector<double> channels;  // commands and inputs; outputs as the model shows them
  };
  TimeScales scales;
  std::vector<Point> points;            // at which J was taken
  std::vector<double> lowest, highest;  // per state of the datasheet, over the test
  std::vector<Bends> bends;             // per channel
  double low_fraction = 0.1,
         high_fraction = 0.9;  // of the commands' ranges: levels that leave every output in its range
};

// InputError where this build has no equations for the rig.
StepTest step_test(const Datasheet& sheet);
TimeScales time_scales(const Datasheet& sheet);

// What an input is in a run that no recording gives: the datasheet's value, else the middle of its range.
double input_value(const Datasheet& sheet, const Channel& channel);

}  // namespace faultline
