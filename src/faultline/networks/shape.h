// What a network is made of: which signals enter, through which taps, how many neurons; and how it is read from a
// stage's settings. Two kinds, by the settings:
//
//   black box     one hidden layer for all outputs; taps on `lags` samples of every input, the latest included, and on
//                 the `lags` samples before of every output (Kilic et al. 2014, (32))
//   structured    a unit per output: y(k) = y(k-1) + gain W2 tanh(W1 [theta' s; d] + b), where the linear neuron theta
//                 sums the signals s, and d enter beside it (33)-(35); outputs enter with their sample before
//
// Settings of both:
//   inputs      channels, "a, b"; c.smooth is c behind a low pass (signal/butterworth.h), c.rate its first difference
//               over the sample period, in units per second
//   outputs     channels that are estimated
//   feedback    which outputs before this sample are the network's own estimates, not measured: none (one step ahead,
//               NARX), own (a unit's own; those of other units are measured), all (no output is measured, NOE)
//   hidden      neurons of a hidden layer, tanh
//   cut_off     Hz, of .smooth and .rate
//   lags        of a black box
//   OUTPUT_sum, OUTPUT_beside, OUTPUT_gain [1]    of a structured network: inputs and outputs, by name
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

enum class Feedback { none, own, all };

// InputError that begins with `where` and says what there is.
Feedback feedback_of(const std::string& word, const std::string& where);

struct NetworkInput {
  enum class Kind { plain, smooth, rate };
  std::string name;  // as in the settings
  std::size_t channel = 0;
  Kind kind = Kind::plain;
};

struct NetworkOutput {
  std::string name;
  std::size_t channel = 0;
};

// One sample of one signal, `lag` samples before the present one. Of outputs at least 1.
struct Tap {
  bool output = false;
  std::size_t signal = 0;  // its place among inputs or outputs
  std::size_t lag = 0;
};

struct NetworkUnit {
  std::vector<std::size_t> outputs;
  std::vector<Tap> sum;     // through the linear neuron; empty: there is none
  std::vector<Tap> beside;  // straight to the hidden layer
  std::size_t hidden = 1;
  bool integrating = false;  // adds to the output before; has no output bias
  double gain = 1;

  std::size_t entries() const { return beside.size() + (sum.empty() ? 0 : 1); }  // of the hidden layer
  std::size_t weights() const {
    return sum.size() + hidden * (entries() + 1) + outputs.size() * (hidden + (integrating ? 0 : 1));
  }
};

struct NetworkShape {
  std::vector<NetworkInput> inputs;
  std::vector<NetworkOutput> outputs;
  std::vector<NetworkUnit> units;  // every output belongs to one
  Feedback feedback = Feedback::all;
  double period = 0;   // s, between samples
  double cut_off = 0;  // Hz; 0: nothing is filtered

  std::size_t weights() const;
  std::size_t lags() const;  // the longest
  // A word per weight, of the signals it joins: weights of one network fit another if these are the same.
  std::vector<std::string> weight_names() const;
};

// InputError that names the key where something is missing or names no channel.
NetworkShape network_shape(const Datasheet& sheet, const Settings& settings);

}  // namespace faultline
