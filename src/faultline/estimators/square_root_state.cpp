#include "faultline/estimators/square_root_state.h"

#include <cmath>
#include <type_traits>

#include <fmt/format.h>

#include "faultline/estimators/row_correction.h"
#include "faultline/numerics/triangle.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// Loops whose length the compiler knows, for the sizes that filters here have: calls work(N) with N a constant,
// Eigen::Dynamic for others.
template <class Work>
void with_states(int n, Work&& work) {
  switch (n) {
    case 2:
      return work(std::integral_constant<int, 2>());
    case 3:
      return work(std::integral_constant<int, 3>());
    case 4:
      return work(std::integral_constant<int, 4>());
    case 5:
      return work(std::integral_constant<int, 5>());
    case 6:
      return work(std::integral_constant<int, 6>());
    default:
      return work(std::integral_constant<int, Eigen::Dynamic>());
  }
}

template <int N>
using Roots = Eigen::Map<Eigen::Matrix<double, N, N, Eigen::RowMajor, N == Eigen::Dynamic ? kMaximumStates : N,
                                       N == Eigen::Dynamic ? kMaximumStates : N>>;
template <int N>
using Column = Eigen::Matrix<double, N, 1, 0, N == Eigen::Dynamic ? kMaximumStates : N, 1>;

// Whether `wide` has kColumns columns, and then its root.
template <int N, int kColumns>
bool reduced(SquareRootState::Wide& wide, SquareRootState::Square& root) {
  if (wide.cols() != kColumns) return false;
  Eigen::Map<Eigen::Matrix<double, N, kColumns, Eigen::RowMajor>> fixed(wide.data());
  reduce_beside_diagonal(fixed);
  Roots<N>(root.data(), N, N) = fixed.template leftCols<N>();
  return true;
}

}  // namespace

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
  // Beside the diagonal there are zeros: the last reduction has left them.
  const double scale = std::sqrt(noise_scale);
  for (int i = 0; i < n; ++i) wide(i, columns + inputs + i) = scale * process_root[i];
  with_states(n, [this](auto size) {
    constexpr int kStates = size();
    if constexpr (kStates != Eigen::Dynamic)
      if (reduced<kStates, 2 * kStates>(wide, root) || reduced<kStates, 2 * kStates + 2>(wide, root) ||
          reduced<kStates, 3 * kStates>(wide, root))
        return;
    reduce_beside_diagonal(wide);
    root = wide.leftCols(n);
  });
}

void SquareRootState::propagate(const Square& a) {
  with_states(n, [&](auto size) {
    constexpr int kStates = size();
    using Const = Eigen::Map<const typename Roots<kStates>::PlainObject>;
    constexpr int kMost = kStates == Eigen::Dynamic ? kMaximumStates : kStates;
    Eigen::Map<Eigen::Matrix<double, kStates, kStates, Eigen::RowMajor, kMost, kMost>, 0, Eigen::OuterStride<>>(
        wide.data(), n, n, Eigen::OuterStride<>(wide.cols()))
        .noalias() = Const(a.data(), n, n).lazyProduct(Const(root.data(), n, n));
  });
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

// As correct_rows() with rows that are one where the state stands and zero elsewhere: S'h is a row of S.
void SquareRootState::correct_observed(const double* y, const bool* use) {
  innovation.setZero();
  innovation_std.setZero();
  normalised_innovation = 0;
  with_states(n, [&](auto size) {
    constexpr int kStates = size();
    Roots<kStates> s(root.data(), n, n);
    for (int i = 0; i < m; ++i) {
      const int at = observed[static_cast<std::size_t>(i)];
      predicted[i] = state[at];
      if (!use[i]) continue;
      innovation[i] = y[i] - predicted[i];
      innovation_std[i] = std::sqrt(s.row(at).squaredNorm() + measurement_variance[i]);
    }
    Eigen::Map<Column<kStates>> x(state.data(), n);
    for (int i = 0; i < m; ++i) {
      if (!use[i]) continue;
      const int at = observed[static_cast<std::size_t>(i)];
      normalised_innovation +=
          correct_along(x, s, Column<kStates>(s.row(at).transpose()), y[i] - x[at], measurement_variance[i]);
    }
  });
}

void SquareRootState::covariance(double* row_major) const {
  with_states(n, [&](auto size) {
    constexpr int kStates = size();
    const Eigen::Map<const typename Roots<kStates>::PlainObject> s(root.data(), n, n);
    Roots<kStates>(row_major, n, n).noalias() = s.lazyProduct(s.transpose());
  });
}

}  // namespace faultline
