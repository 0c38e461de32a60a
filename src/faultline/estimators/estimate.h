// What an estimator says about one sample: state with covariance, innovation, quantities derived from them, and a
// ranking of what may be wrong. Most estimators fill some of these only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/rig/alarm_kind.h"

namespace faultline {

enum class ChannelStatus : std::uint8_t {
  good = 0,
  missing = 1,       // NaN or infinite
  out_of_range = 2,  // outside what the transducer can show
  // Numbers that are not like its transducer's (channel_watch.h); only the rig's first stage tells these. They are used
  // all the same: what they are worth is for the alarms to say.
  frozen = 3,
  noisy = 4,
  spiky = 5,
  quiet = 6,
  at_end = 7,  // nothing but an end of its range for a while: such readings show no noise
  last = at_end
};

struct Quantity {
  std::string name;
  std::string unit;
  double value = 0;
  double std = 0;  // one sigma, of the estimate; 0 where it is a plain measurement
};

struct SizeInterval {
  double low = 0, high = 0;
};

// A fault that may be there: an effect at a port, how much of it, and how well it explains what was measured. Its
// errors are normal in the amplitude, so intervals are taken there.
struct RankedHypothesis {
  std::string effect, port;           // of the datasheet
  AlarmKind kind = AlarmKind::fault;  // or sensor
  std::string size_name, size_unit;   // of the effect's parameter that is its size
  std::uint32_t order = 0;            // its place among the hypotheses of the datasheet, in which every one occurs once
  double none = 0, full = 0;          // size at amplitude 0 (infinite for some effects) and 1
  double lowest = 0;                  // amplitude that the datasheet's bounds allow at least
  double amplitude = 0, std = 0;      // estimate and one sigma
  double evidence = 0;                // log-likelihood ratio against no fault, times two

  std::string name() const { return effect + "@" + port; }
  double size() const { return effect_size(none, full, amplitude); }
  SizeInterval sizes(double amplitude_std) const;  // two-sided 90 %, within what the datasheet allows
};

// The causes that explain what was measured, best first, as judged last. Times on the samples' clock.
struct Ranking {
  double since = 0;         // s, when the fault began to show; the judgement's own time while nothing is wrong
  double judged_until = 0;  // s, end of the samples that were judged
  double threshold = 0;     // evidence from which there is a fault
  double evidence = 0;      // of the best of all hypotheses
  bool shows = true;        // faults at every place of the rig would have shown; no: it stood still
  std::vector<RankedHypothesis> first;      // what is wrong; empty: nothing is
  std::vector<RankedHypothesis> suspected;  // while first is empty: what is wrong, if stretches to come confirm it
  std::vector<RankedHypothesis> second;     // what else is wrong, beside the best of the first
  std::string doubt;  // a channel that is not what it is called explains more than all of them; empty: none does
  std::string stuck;  // port of the transducer or the command that is stuck, where that is the doubt
};

struct Estimate {
  double time = 0;  // s
  std::uint64_t sequence = 0;
  bool restarted = false;              // the estimator began anew with this sample (first sample, time jump, long gap)
  std::vector<double> state;           // in the model's units
  std::vector<double> covariance;      // states x states, row after row
  std::vector<double> innovation;      // measured minus predicted, in the model's units; 0 where not observed
  std::vector<double> innovation_std;  // predicted standard deviation of each
  double normalised_innovation = 0;    // innovation' S^-1 innovation over the observed rows
  int observed = 0;                    // how many rows were used
  std::vector<ChannelStatus> channel_status;  // one per channel of the rig
  std::vector<Quantity> quantities;
  std::shared_ptr<const Ranking> ranking;  // another one after each judgement; null: this estimator ranks nothing
};

}  // namespace faultline
