#include "faultline/estimators/square_root_state.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/estimators/row_correction.h"
#include "faultline/numerics/triangle.h"
#include "faultline/signal/error.h"

namespace faultline {

SquareRootState::SquareRootState(const ProcessModel& of, int propagated, int extra)
    : model(of),
      n(static_cast<int>(of.states().size())),
      m(static_cast<int>(of.measured_channels().size())),
      inputs(static_cast<int>(of.input_noise().size())),
      columns(propagated * n + extra),
      observed(of.observed_states()) {
  if (n > kMaximumStates || m > kMaximumOutputs || inputs > kMaximumNoisyInputs)
    throw InputError(
        fmt::format("a filter takes up to {} states, {} outputs and {} noisy inputs; the model has {}, {}, {}",
                    kMaximumStates, kMaximumOutputs, kMaximumNoisyInputs, n, m, inputs));
  const std::vector<double> q = of.process_noise(), r = of.measurement_noise(), u = of.input_noise();
  process_root = Eigen::Map<const Eigen::VectorXd>(q.data(), n).cwiseSqrt();
  measurement_variance = Eigen::Map<const Eigen::VectorXd>(r.data(), m);
  input_root = Eigen::Map<const Eigen::VectorXd>(u.data(), inputs).cwiseSqrt();
  state.setZero(n);
  root.setZero(n, n);
  g.setZero(n, inputs);
  wide.setZero(n, columns + inputs + n);
  for (Outputs* v : {&predicted, &innovation, &innovation_std}) v->setZero(m);
  selection_.setZero(m, n);
  for (int i = 0; i < static_cast<int>(observed.size()); ++i) selection_(i, observed[static_cast<std::size_t>(i)]) = 1;
}

void SquareRootState::reset(const double* first, const double* variance) {
  state = Eigen::Map<const Eigen::VectorXd>(first, n);
  root.setZero();
  for (int i = 0; i < n; ++i) root(i, i) = std::sqrt(variance[i]);
  innovation.setZero();
  innovation_std.setZero();
  normalised_innovation = 0;
}

void SquareRootState::add_noise(double dt, double noise_scale) {
  if (inputs > 0) {
    model.input_jacobian(state.data(), dt, g.data());
    for (int j = 0; j < inputs; ++j) wide.col(columns + j) = g.col(j) * input_root[j];
  }
  wide.rightCols(n).setZero();
  const double scale = std::sqrt(noise_scale);
  for (int i = 0; i < n; ++i) wide(i, columns + inputs + i) = scale * process_root[i];
  reduce_to_triangle(wide);
  root = wide.leftCols(n);
}

void SquareRootState::correct_rows(const double* y, const bool* use, const Observation& c) {
  innovation.setZero();
  innovation_std.setZero();
  normalised_innovation = 0;
  // Innovations are told against the prediction, all rows of it, before the first of them corrects anything.
  for (int i = 0; i < m; ++i) {
    if (!use[i]) continue;
    innovation[i] = y[i] - predicted[i];
    innovation_std[i] =
        std::sqrt((root.transpose().lazyProduct(c.row(i).transpose())).squaredNorm() + measurement_variance[i]);
  }
  const State before = state;
  for (int i = 0; i < m; ++i) {
    if (!use[i]) continue;
    const double off = innovation[i] - c.row(i).dot(state - before);
    normalised_innovation += correct_row(state, root, c.row(i).transpose(), off, measurement_variance[i]);
  }
}

void SquareRootState::correct_observed(const double* y, const bool* use) {
  for (int i = 0; i < m; ++i) predicted[i] = state[observed[static_cast<std::size_t>(i)]];
  correct_rows(y, use, selection_);
}

void SquareRootState::covariance(double* row_major) const {
  Eigen::Map<Square>(row_major, n, n).noalias() = root.lazyProduct(root.transpose());
}

}  // namespace faultline
