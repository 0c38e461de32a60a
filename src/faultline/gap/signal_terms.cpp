#include "faultline/gap/signal_terms.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr std::array<double, 4> kSoftSigns = {0.3, 0.1, 0.03, 0.01};  // widths, of a variable's scale
constexpr std::array<double, 3> kLags = {3, 10, 50};                  // rows
constexpr std::array<double, 3> kPlays = {0.03, 0.1, 0.3};            // widths, of a variable's scale
constexpr double kProductSign = 0.03;
constexpr double kSameFraction = 0.03;  // of their spread, that two variables which are the same may differ by
constexpr double kTail = 0.002;         // of the rows, on each side, outside a variable's range
constexpr double kNothing = 1e-20;      // SI units: what has decayed to less is rest, whatever is made of it

double spread_of(const SignalVariable& variable) {
  double sum = 0, squares = 0, count = 0;
  for (const Eigen::VectorXd& values : variable.values) {
    sum += values.sum();
    squares += values.squaredNorm();
    count += static_cast<double>(values.size());
  }
  return std::sqrt(std::max(0.0, squares / count - std::pow(sum / count, 2)));
}

Eigen::VectorXd lagged(const Eigen::VectorXd& values, double rows) {
  Eigen::VectorXd result = values;
  const double keep = std::exp(-1 / rows);
  for (Eigen::Index i = 1; i < values.size(); ++i) result[i] = keep * result[i - 1] + (1 - keep) * values[i];
  return result;
}

Eigen::VectorXd played(const Eigen::VectorXd& values, double width) {
  Eigen::VectorXd result = values;
  for (Eigen::Index i = 1; i < values.size(); ++i)
    result[i] = std::clamp(result[i - 1], values[i] - width / 2, values[i] + width / 2);
  return result;
}

}  // namespace

bool SignalVariable::same(const SignalVariable& other) const {
  double squares = 0, count = 0;
  for (std::size_t n = 0; n < values.size(); ++n) {
    squares += (values[n] - other.values[n]).squaredNorm();
    count += static_cast<double>(values[n].size());
  }
  return std::sqrt(squares / count) < kSameFraction * spread_of(*this);
}

bool settle_variable(SignalVariable& variable) {
  std::vector<double> all;
  for (Eigen::VectorXd& values : variable.values) {
    double last = std::nan("");
    for (Eigen::Index i = values.size(); i-- > 0;)
      if (std::isfinite(values[i])) last = values[i];
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      if (std::isfinite(values[i])) last = values[i];
      values[i] = last;
      if (std::isfinite(last)) all.push_back(last);
    }
    if (!values.allFinite()) return false;
  }
  const auto quantile = [&](double share) {
    const auto at = all.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(all.size() - 1));
    std::nth_element(all.begin(), at, all.end());
    return *at;
  };
  if (all.empty()) return false;
  variable.low = quantile(kTail);
  variable.high = quantile(1 - kTail);
  for (double& value : all) value = std::abs(value);
  variable.scale = quantile(0.95);
  return spread_of(variable) > std::max(kNothing, 1e-6 * variable.scale) && variable.low < variable.high;
}

SignalTerms::SignalTerms(const std::vector<SignalVariable>& variables, double step)
    : variables_(variables), step_(step) {}

void SignalTerms::add(const std::string& text, std::size_t variable, const Make& make) {
  std::vector<Eigen::VectorXd> columns;
  double squares = 0, count = 0;
  for (std::size_t n = 0; n < variables_.front().values.size(); ++n) {
    columns.push_back(make(n));
    squares += columns.back().squaredNorm();
    count += static_cast<double>(columns.back().size());
  }
  const double norm = std::sqrt(squares / count);
  if (!(norm > 0) || !std::isfinite(norm)) return;
  for (Eigen::VectorXd& column : columns) column /= norm;
  terms_.push_back({text, variable, norm, -1});
  columns_.push_back(std::move(columns));
}

void SignalTerms::add_function(const std::string& text, std::size_t variable, const std::function<double(double)>& f) {
  add(text, variable, [&](std::size_t n) { return variables_[variable].values[n].unaryExpr(f).eval(); });
}

void SignalTerms::add_singles() {
  add("1", variables_.size(),
      [&](std::size_t n) { return Eigen::VectorXd::Ones(variables_.front().values[n].size()).eval(); });
  for (std::size_t v = 0; v < variables_.size(); ++v) {
    const std::string& x = variables_[v].name;
    const std::size_t first = terms_.size();
    add_function(x, v, [](double value) { return value; });
    add_function("|" + x + "|", v, [](double value) { return std::abs(value); });
    add_function(x + "^2", v, [](double value) { return value * value; });
    add_function(x + " |" + x + "|", v, [](double value) { return value * std::abs(value); });
    add_function(x + "^3", v, [](double value) { return value * value * value; });
    if (variables_[v].low < 0 && variables_[v].high > 0) {
      for (const double width : kSoftSigns) {
        const double size = width * variables_[v].scale;
        add_function(fmt::format("tanh({}/{:.2g})", x, size), v,
                     [size](double value) { return std::tanh(value / size); });
      }
    }
    for (std::size_t t = first + 1; t < terms_.size(); ++t) terms_[t].like = static_cast<int>(first);
  }
}

void SignalTerms::add_memories() {
  for (std::size_t v = 0; v < variables_.size(); ++v) {
    const SignalVariable& x = variables_[v];
    // What comes late shows as what it lags behind: neither part of that explains anything alone.
    for (const double rows : kLags) {
      const std::string lag = fmt::format("lag({}, {:.2g} s)", x.name, rows * step_);
      add(lag, v, [&](std::size_t n) { return lagged(x.values[n], rows); });
      add(fmt::format("({} - {})", lag, x.name), v,
          [&](std::size_t n) { return (lagged(x.values[n], rows) - x.values[n]).eval(); });
    }
    for (const double width : kPlays) {
      const std::string play = fmt::format("play({}, {:.2g})", x.name, width * x.scale);
      add(play, v, [&](std::size_t n) { return played(x.values[n], width * x.scale); });
      add(fmt::format("({} - {})", play, x.name), v,
          [&](std::size_t n) { return (played(x.values[n], width * x.scale) - x.values[n]).eval(); });
    }
  }
}

void SignalTerms::add_products(const std::vector<std::size_t>& chosen) {
  for (std::size_t i = 0; i < chosen.size(); ++i)
    for (std::size_t j = 0; j < chosen.size(); ++j) {
      if (i == j) continue;
      const SignalVariable &a = variables_[chosen[i]], &b = variables_[chosen[j]];
      if (i < j)
        add(a.name + " " + b.name, chosen[i],
            [&](std::size_t n) { return a.values[n].cwiseProduct(b.values[n]).eval(); });
      if (a.low >= 0 || a.high <= 0) continue;
      const double size = kProductSign * a.scale;
      add(fmt::format("tanh({}/{:.2g}) {}", a.name, size, b.name), chosen[i],
          [&](std::size_t n) { return (a.values[n].array() / size).tanh().matrix().cwiseProduct(b.values[n]).eval(); });
    }
}

std::vector<Eigen::MatrixXd> SignalTerms::courses() const {
  std::vector<Eigen::MatrixXd> result;
  for (std::size_t n = 0; n < variables_.front().values.size(); ++n) {
    Eigen::MatrixXd courses(variables_.front().values[n].size(), static_cast<Eigen::Index>(terms_.size()));
    for (std::size_t t = 0; t < terms_.size(); ++t) courses.col(static_cast<Eigen::Index>(t)) = columns_[t][n];
    result.push_back(std::move(courses));
  }
  return result;
}

}  // namespace faultline
