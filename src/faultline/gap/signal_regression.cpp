#include "faultline/gap/signal_regression.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/gap/gap_trials.h"

namespace faultline {
namespace {

constexpr double kRidge = 1e-9;         // of a column's own information: keeps columns that say the same solvable
constexpr double kSimplerLoses = 0.05;  // of what the best next term adds, that a simpler one may fall short of
constexpr double kLeastRise = 0.1;      // of what stands, that a further term must add

bool holds(const std::vector<std::size_t>& runs, std::size_t run) {
  return std::find(runs.begin(), runs.end(), run) != runs.end();
}

Eigen::MatrixXd taken(const Eigen::MatrixXd& a, const SignalRegression::Columns& columns) {
  const auto count = static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd result(count, count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j < count; ++j)
      result(i, j) = a(columns[static_cast<std::size_t>(i)], columns[static_cast<std::size_t>(j)]);
  return result;
}

Eigen::VectorXd taken(const Eigen::VectorXd& b, const SignalRegression::Columns& columns) {
  Eigen::VectorXd result(static_cast<Eigen::Index>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) result[static_cast<Eigen::Index>(i)] = b[columns[i]];
  return result;
}

}  // namespace

SignalRegression::SignalRegression(std::vector<SignalEquations> parts, const std::vector<Fold>& folds)
    : parts_(std::move(parts)) {
  const Eigen::Index count = parts_.front().b.size();
  const Sums none{Eigen::MatrixXd::Zero(count, count), Eigen::VectorXd::Zero(count)};
  all_ = none;
  for (const SignalEquations& part : parts_) all_.a += part.a, all_.b += part.b;
  for (const Fold& fold : folds) {
    tests_.emplace_back();
    train_.push_back(none);
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      if (holds(fold.train, parts_[p].run)) train_.back().a += parts_[p].a, train_.back().b += parts_[p].b;
      if (holds(fold.test, parts_[p].run)) tests_.back().push_back(p);
    }
  }
}

SignalRegression::Fit SignalRegression::solve(const Sums& sums, const Columns& columns,
                                              const Eigen::MatrixXd& penalty) const {
  Eigen::MatrixXd a = taken(sums.a, columns);
  a.diagonal() += (kRidge * a.diagonal()).array().max(1e-300).matrix();
  if (penalty.size() > 0) a += a.diagonal().maxCoeff() * penalty;
  const Eigen::LDLT<Eigen::MatrixXd> root(a);
  const Eigen::MatrixXd inverse = root.solve(Eigen::MatrixXd::Identity(a.rows(), a.cols()));
  return {root.solve(taken(sums.b, columns)), inverse.diagonal().cwiseMax(0).cwiseSqrt()};
}

SignalRegression::Fit SignalRegression::fit(const Columns& columns, const Eigen::MatrixXd& penalty) const {
  return solve(all_, columns, penalty);
}

SignalRegression::Fit SignalRegression::fit(const Columns& columns, std::size_t fold,
                                            const Eigen::MatrixXd& penalty) const {
  return solve(train_[fold], columns, penalty);
}

SignalRegression::Gain SignalRegression::held_out(const Columns& columns, const Eigen::MatrixXd& penalty) const {
  Gain gain;
  for (std::size_t f = 0; f < train_.size(); ++f) {
    const Eigen::VectorXd size = fit(columns, f, penalty).size;
    for (const std::size_t p : tests_[f]) {
      gain.parts.push_back(size.dot(taken(parts_[p].b, columns)) - 0.5 * size.dot(taken(parts_[p].a, columns) * size));
      gain.sum += gain.parts.back();
    }
  }
  return gain;
}

SignalRegression::Columns SignalRegression::select(const std::vector<Columns>& candidates, std::size_t most) const {
  Columns chosen;
  Gain now;
  while (chosen.size() < most) {
    std::vector<Gain> gains;
    std::vector<Columns> wider;
    double best = -1e300;
    for (const Columns& candidate : candidates) {
      Columns with = chosen;
      for (const Eigen::Index column : candidate)
        if (std::find(with.begin(), with.end(), column) == with.end()) with.push_back(column);
      if (with.size() > most) continue;
      gains.push_back(held_out(with));
      wider.push_back(std::move(with));
      best = std::max(best, gains.back().sum);
    }
    if (!(best > now.sum)) break;
    std::size_t next = 0;
    while (!(gains[next].sum >= best - kSimplerLoses * (best - now.sum))) ++next;
    if (wider[next].size() > chosen.size() + 1)  // none of several columns is simpler than another
      for (std::size_t k = next; k < gains.size(); ++k)
        if (gains[k].sum > gains[next].sum) next = k;
    double squares = 0;
    const double rise = gains[next].sum - now.sum, mean = rise / static_cast<double>(gains[next].parts.size());
    for (std::size_t p = 0; p < gains[next].parts.size(); ++p)
      squares += std::pow(gains[next].parts[p] - (now.parts.empty() ? 0 : now.parts[p]) - mean, 2);
    if (!(rise > std::sqrt(squares)) || rise < kLeastRise * now.sum) break;
    chosen = wider[next];
    now = gains[next];
  }
  for (std::size_t k = 0; chosen.size() > 1 && k < chosen.size();) {
    Columns without = chosen;
    without.erase(without.begin() + static_cast<std::ptrdiff_t>(k));
    const Gain gain = held_out(without);
    if (!(now.sum < (1 + kLeastRise) * gain.sum)) {
      ++k;
      continue;
    }
    chosen = without;
    now = gain;
    k = 0;
  }
  return chosen;
}

}  // namespace faultline
