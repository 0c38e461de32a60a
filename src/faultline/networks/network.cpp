#include "faultline/networks/network.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/quick_tanh.h"

namespace faultline {
namespace {

using RowMap = Eigen::Map<const Network::Rows>;
using VectorMap = Eigen::Map<const Eigen::VectorXd>;

// Where the parts of a unit's weights lie.
struct Parts {
  explicit Parts(const NetworkUnit& unit)
      : sum(static_cast<Eigen::Index>(unit.sum.size())),
        entries(static_cast<Eigen::Index>(unit.entries())),
        hidden(static_cast<Eigen::Index>(unit.hidden)),
        first_layer(sum),
        first_bias(first_layer + hidden * entries),
        second_layer(first_bias + hidden),
        per_output(hidden + (unit.integrating ? 0 : 1)) {}
  Eigen::Index sum, entries, hidden, first_layer, first_bias, second_layer, per_output;
};

void shift(Eigen::MatrixXd& past) {
  for (Eigen::Index lag = past.cols() - 1; lag > 0; --lag) past.col(lag) = past.col(lag - 1);
}

}  // namespace

Network::Network(const NetworkShape& shape, bool sensitive)
    : shape_(shape), sensitive_(sensitive), lags_(shape.lags()), offset_{0} {
  const auto columns = static_cast<Eigen::Index>(lags_ + 1);
  past_inputs_.setZero(static_cast<Eigen::Index>(shape.inputs.size()), columns);
  past_measured_.setZero(static_cast<Eigen::Index>(shape.outputs.size()), columns);
  past_own_ = past_measured_;
  y_.setZero(past_own_.rows());
  for (const NetworkUnit& unit : shape.units) {
    offset_.push_back(offset_.back() + unit.weights());
    const Parts p(unit);
    work_.push_back({Eigen::VectorXd(p.sum), Eigen::VectorXd(p.entries), Eigen::VectorXd(p.hidden),
                     Eigen::VectorXd(p.hidden), Eigen::VectorXd(p.entries)});
  }
  if (sensitive)
    history_.assign(shape.feedback == Feedback::none ? 1 : lags_ + 1,
                    Rows::Zero(y_.size(), static_cast<Eigen::Index>(offset_.back())));
}

void Network::start(const double* inputs, const double* outputs) {
  past_inputs_.colwise() = VectorMap(inputs, past_inputs_.rows());
  past_measured_.colwise() = VectorMap(outputs, past_measured_.rows());
  past_own_ = past_measured_;
  y_ = past_measured_.col(0);
  for (Rows& rows : history_) rows.setZero();
}

void Network::restart(const Eigen::MatrixXd& past) {
  past_own_ = past;
  for (Rows& rows : history_) rows.setZero();
}

bool Network::fed_back(const Tap& tap, const NetworkUnit& unit) const {
  if (!tap.output || shape_.feedback == Feedback::none) return false;
  return shape_.feedback == Feedback::all ||
         std::find(unit.outputs.begin(), unit.outputs.end(), tap.signal) != unit.outputs.end();
}

double Network::value(const Tap& tap, const NetworkUnit& unit) const {
  const auto signal = static_cast<Eigen::Index>(tap.signal), lag = static_cast<Eigen::Index>(tap.lag);
  if (!tap.output) return past_inputs_(signal, lag);
  return fed_back(tap, unit) ? past_own_(signal, lag) : past_measured_(signal, lag);
}

void Network::step(const double* weights, const double* inputs) {
  shift(past_inputs_);
  shift(past_measured_);
  shift(past_own_);
  if (history_.size() > 1) std::rotate(history_.begin(), history_.end() - 1, history_.end());
  past_inputs_.col(0) = VectorMap(inputs, past_inputs_.rows());
  for (std::size_t place = 0; place < shape_.units.size(); ++place) {
    const NetworkUnit& unit = shape_.units[place];
    const Parts p(unit);
    const double* w = weights + offset_[place];
    Work& work = work_[place];
    Eigen::Index next = 0;
    if (p.sum > 0) {
      for (Eigen::Index t = 0; t < p.sum; ++t) work.sum[t] = value(unit.sum[static_cast<std::size_t>(t)], unit);
      work.z[next++] = VectorMap(w, p.sum).dot(work.sum);
    }
    for (const Tap& tap : unit.beside) work.z[next++] = value(tap, unit);
    work.h.noalias() = RowMap(w + p.first_layer, p.hidden, p.entries).lazyProduct(work.z);
    work.h += VectorMap(w + p.first_bias, p.hidden);
    for (double& h : work.h) h = quick_tanh(h);
    for (std::size_t i = 0; i < unit.outputs.size(); ++i) {
      const double* own = w + p.second_layer + static_cast<Eigen::Index>(i) * p.per_output;
      double y = VectorMap(own, p.hidden).dot(work.h);
      if (!unit.integrating) y += own[p.hidden];
      y *= unit.gain;
      if (unit.integrating) y += before(unit.outputs[i], unit);
      y_[static_cast<Eigen::Index>(unit.outputs[i])] = y;
    }
    if (sensitive_) differentiate(place, weights);
  }
}

void Network::differentiate(std::size_t place, const double* weights) {
  const NetworkUnit& unit = shape_.units[place];
  const Parts p(unit);
  const auto offset = static_cast<Eigen::Index>(offset_[place]);
  const auto first = static_cast<Eigen::Index>(this->first(place));
  const auto width = static_cast<Eigen::Index>(end(place)) - first;
  const double* w = weights + offset;
  Work& work = work_[place];
  const RowMap first_layer(w + p.first_layer, p.hidden, p.entries);
  for (std::size_t i = 0; i < unit.outputs.size(); ++i) {
    const auto output = static_cast<Eigen::Index>(unit.outputs[i]);
    const Eigen::Index own = p.second_layer + static_cast<Eigen::Index>(i) * p.per_output;
    work.g = unit.gain * VectorMap(w + own, p.hidden).array() * (1 - work.h.array().square());
    work.c.noalias() = first_layer.transpose() * work.g;
    auto row = history_[0].row(output);
    row.segment(first, width).setZero();
    if (p.sum > 0) row.segment(offset, p.sum) = work.c[0] * work.sum.transpose();
    for (Eigen::Index j = 0; j < p.hidden; ++j)
      row.segment(offset + p.first_layer + j * p.entries, p.entries) = work.g[j] * work.z.transpose();
    row.segment(offset + p.first_bias, p.hidden) = work.g.transpose();
    row.segment(offset + own, p.hidden) = unit.gain * work.h.transpose();
    if (!unit.integrating) row[offset + own + p.hidden] = unit.gain;

    const auto through = [&](const Tap& tap, double slope) {
      if (fed_back(tap, unit))
        row.segment(first, width) +=
            slope * history_[tap.lag].row(static_cast<Eigen::Index>(tap.signal)).segment(first, width);
    };
    for (Eigen::Index t = 0; t < p.sum; ++t) through(unit.sum[static_cast<std::size_t>(t)], work.c[0] * w[t]);
    for (std::size_t b = 0; b < unit.beside.size(); ++b)
      through(unit.beside[b], work.c[static_cast<Eigen::Index>(b) + (p.sum > 0 ? 1 : 0)]);
    if (unit.integrating) through({true, unit.outputs[i], 1}, 1);
  }
}

void Network::bound(const double* low, const double* high) {
  for (Eigen::Index o = 0; o < y_.size(); ++o) y_[o] = std::clamp(y_[o], low[o], high[o]);
}

void Network::take(const double* measured) {
  past_measured_.col(0) = VectorMap(measured, past_measured_.rows());
  past_own_.col(0) = y_;
}

}  // namespace faultline
