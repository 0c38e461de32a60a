// The shape of what a model misses: the signal that would have to enter at a place, reconstructed over time, and what
// it looks like a function of.
//
// The signal is the free one of discrepancy.h at that place, smoothed beside a process noise of its own (EM). Its
// dependence is found by sparse regression on signal_terms.h, by generalised least squares on the readings themselves
// (free_signal_filter.h), so that neither the noise nor the smoothing's own shrinkage bends it. The score is
// 1 - sum r^2/sum u^2 on runs that the fit did not see: u the reconstruction, r that of what the formula leaves.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "faultline/gap/discrepancy.h"
#include "faultline/rig/curve_grid.h"

namespace faultline {

struct Fold;

// A tabulated function of one variable: straight between the nodes of rig/curve_grid.h.
struct SignalCurve {
  std::string variable, unit;
  int passes = -1;  // position in passing() of the port's kind: what free_curve calls `of`; -1: nothing it sees
  CurveValues at{}, value{}, standard_error{};
  double score = 0;
};

// Thinned for pictures: rows of a window, and single ones from everywhere.
struct SignalCourse {
  std::string run;
  std::vector<double> time, value, standard_error, formula;  // s from the start of the run, else the signal's unit
};
struct SignalPoints {
  std::vector<double> at, value;  // over the curve's variable
};

struct MissingSignal {
  std::string port;
  std::string unit;                      // of the signal; 1: a factor of what passes, less one
  std::string beside;                    // refit | explained: the model to which it would have to be added
  double size = 0, memory = 0;           // standard deviation, s
  double readings = 0;                   // on which all this rests
  std::string formula;                   // in SI units; empty: no function of the model's variables explains it
  double score = 0;                      // of the formula, or of the best that was tried
  std::optional<SignalCurve> curve;      // over the single variable that explains most
  std::optional<SignalCurve> adoptable;  // likewise among what an effect at the port sees
  std::vector<double> parameters;        // of the rig beside that curve, in the datasheet's order
  double adopted_shrink = 0;             // of the excess that the model leaves, what that curve closes over segments
  SignalCourse course;
  SignalPoints points;
};

// A signal at `place` beside `change`, over the runs of all folds: everything, or the adoptable curve only.
enum class Sought { all, adoptable };
MissingSignal find_missing_signal(const ResidualModel& residuals, const ModelChange& change, const FreePlace& place,
                                  const std::vector<Fold>& folds, int jobs, Sought sought = Sought::all);

// The effect that puts a curve at its port.
EffectSpec curve_effect(const std::string& port, const SignalCurve& curve);

}  // namespace faultline
