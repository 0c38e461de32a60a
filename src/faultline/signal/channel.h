// A channel: one named signal of a rig, with its SI unit and what its transducer and converter do to it.
#pragma once

#include <string>
#include <vector>

namespace faultline {

enum class Role {
  setpoint,  // what a controller is asked for
  command,   // what is sent to the plant; held from its sample to the next
  input,     // measured, and drives the model
  output,    // measured, and predicted by the model
};

struct Channel {
  std::string name;
  std::string symbol;
  std::string unit;  // SI, as written in the datasheet
  Role role = Role::output;
  double minimum = 0;  // what transducer and converter can show, in `unit`
  double maximum = 0;
  double noise_std = 0;       // white, per sample, in `unit`
  double resolution = 0;      // rounding after the noise, in `unit`; 0: none
  bool ground_truth = false;  // a simulator knows it; no diagnosis may use it
  std::string predicted_by;   // for an input that the model also predicts: the command it follows; else empty
  std::string meaning;
};

// Position of the channel called `name`, or -1.
int find_channel(const std::vector<Channel>& channels, const std::string& name);

std::string to_string(Role role);

}  // namespace faultline
