#include "faultline/networks/signals.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kHole = 1.5;            // periods
constexpr Eigen::Index kShortest = 100;  // samples of a run

using Index = Eigen::Index;

}  // namespace

NetworkSignals::NetworkSignals(const NetworkShape& shape)
    : spec_(shape.inputs), period_(shape.period), before_(shape.inputs.size(), 0) {
  for (const NetworkInput& input : spec_)
    if (input.kind != NetworkInput::Kind::plain) filters_.emplace_back(shape.cut_off, shape.period);
  inputs_.setZero(static_cast<Index>(spec_.size()));
}

void NetworkSignals::start(const double* channels) {
  std::size_t filter = 0;
  for (std::size_t i = 0; i < spec_.size(); ++i) {
    const double value = channels[spec_[i].channel];
    if (spec_[i].kind != NetworkInput::Kind::plain) filters_[filter++].start(value);
    before_[i] = value;
    inputs_[static_cast<Index>(i)] = spec_[i].kind == NetworkInput::Kind::rate ? 0 : value;
  }
}

void NetworkSignals::step(const double* channels) {
  std::size_t filter = 0;
  for (std::size_t i = 0; i < spec_.size(); ++i) {
    double value = channels[spec_[i].channel];
    if (spec_[i].kind != NetworkInput::Kind::plain) value = filters_[filter++].step(value);
    inputs_[static_cast<Index>(i)] = spec_[i].kind == NetworkInput::Kind::rate ? (value - before_[i]) / period_ : value;
    before_[i] = value;
  }
}

std::vector<NetworkRun> network_runs(const NetworkShape& shape, const Recording& recording, const std::string& where) {
  std::vector<NetworkRun> runs;
  NetworkSignals signals(shape);
  std::vector<double> held(recording.columns(), std::nan(""));
  const auto complete = [&] {
    for (const NetworkInput& input : shape.inputs)
      if (!std::isfinite(held[input.channel])) return false;
    for (const NetworkOutput& output : shape.outputs)
      if (!std::isfinite(held[output.channel])) return false;
    return true;
  };
  for (std::size_t row = 0; row < recording.rows();) {
    const std::size_t begin = row;
    while (++row < recording.rows() &&
           std::abs(recording.time[row] - recording.time[row - 1] - shape.period) < (kHole - 1) * shape.period) {
    }
    if (static_cast<Index>(row - begin) < kShortest) continue;
    NetworkRun run;
    run.inputs.resize(static_cast<Index>(shape.inputs.size()), static_cast<Index>(row - begin));
    run.outputs.resize(static_cast<Index>(shape.outputs.size()), run.inputs.cols());
    Index used = 0;
    for (std::size_t k = begin; k < row; ++k) {
      for (std::size_t c = 0; c < held.size(); ++c)
        if (recording.at(k, c) >= recording.channels[c].minimum && recording.at(k, c) <= recording.channels[c].maximum)
          held[c] = recording.at(k, c);
      if (!complete()) continue;  // channels that begin late
      if (used == 0)
        signals.start(held.data());
      else
        signals.step(held.data());
      run.inputs.col(used) = signals.inputs();
      for (std::size_t o = 0; o < shape.outputs.size(); ++o)
        run.outputs(static_cast<Index>(o), used) = held[shape.outputs[o].channel];
      ++used;
    }
    if (used < kShortest) continue;
    run.inputs.conservativeResize(Eigen::NoChange, used);
    run.outputs.conservativeResize(Eigen::NoChange, used);
    runs.push_back(std::move(run));
  }
  if (runs.empty())
    throw InputError(
        fmt::format("{}: no {} samples in a row, {:g} s apart, hold all channels of the network; record longer", where,
                    kShortest, shape.period));
  return runs;
}

Scaling scaling_of(const std::vector<NetworkRun>& runs, Eigen::MatrixXd NetworkRun::*signals) {
  const Index rows = (runs.front().*signals).rows();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(rows), square = sum;
  double count = 0;
  for (const NetworkRun& run : runs) {
    sum += (run.*signals).rowwise().sum();
    count += static_cast<double>((run.*signals).cols());
  }
  sum /= count;
  for (const NetworkRun& run : runs) square += ((run.*signals).colwise() - sum).rowwise().squaredNorm();
  Scaling scaling;
  for (Index i = 0; i < rows; ++i) {
    const double std = std::sqrt(square[i] / count);
    scaling.centre.push_back(sum[i]);
    // A signal that never moved says nothing, whatever its size.
    scaling.scale.push_back(std > 1e-12 * std::abs(sum[i]) && std > 0 ? std : std::max(1.0, std::abs(sum[i])));
  }
  return scaling;
}

void scale(const Scaling& inputs, const Scaling& outputs, std::vector<NetworkRun>& runs) {
  const auto each = [](const Scaling& s, Eigen::MatrixXd& signals) {
    const auto rows = static_cast<Index>(s.centre.size());
    signals.colwise() -= Eigen::Map<const Eigen::VectorXd>(s.centre.data(), rows);
    signals.array().colwise() /= Eigen::Map<const Eigen::ArrayXd>(s.scale.data(), rows);
  };
  for (NetworkRun& run : runs) {
    each(inputs, run.inputs);
    each(outputs, run.outputs);
  }
}

}  // namespace faultline
