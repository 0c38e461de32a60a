// From a rig's channels to what a network takes: filters, first differences, and scaling by mean and standard
// deviation.
//
// .smooth is late by the filter's lag (Butterworth::lag), .rate by half a period more.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/networks/shape.h"
#include "faultline/signal/butterworth.h"
#include "faultline/signal/sample.h"

namespace faultline {

// scaled = (value - centre)/scale
struct Scaling {
  std::vector<double> centre, scale;
};

class NetworkSignals {
 public:
  explicit NetworkSignals(const NetworkShape& shape);
  // As if the channels had always been these.
  void start(const double* channels);
  // At the next sample; allocates nothing.
  void step(const double* channels);
  const Eigen::VectorXd& inputs() const { return inputs_; }

 private:
  std::vector<NetworkInput> spec_;
  double period_;
  std::vector<Butterworth> filters_;  // one per input that needs one
  std::vector<double> before_;        // what each gave
  Eigen::VectorXd inputs_;
};

// A stretch of a recording without a hole, one column a sample.
struct NetworkRun {
  Eigen::MatrixXd inputs, outputs;
};

// Values that are missing or out of range hold the last good one, as a stage does live. A hole in time begins a new
// run; InputError, which begins with `where`, if nothing of any length is left.
std::vector<NetworkRun> network_runs(const NetworkShape& shape, const Recording& recording, const std::string& where);

Scaling scaling_of(const std::vector<NetworkRun>& runs, Eigen::MatrixXd NetworkRun::*signals);
void scale(const Scaling& inputs, const Scaling& outputs, std::vector<NetworkRun>& runs);

}  // namespace faultline
