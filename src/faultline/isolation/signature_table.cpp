#include "faultline/isolation/signature_table.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr double kLeastFactor = 1e-3;  // e^s of a size that may fall to nothing

}  // namespace

SignatureTable::SignatureTable(const Datasheet& sheet, const Settings& settings, int parameters)
    : fit_(settings.number("fit", 0, 1e9)), relative_error_(settings.number("relative_error", 0, 1)) {
  const std::vector<FaultHypothesis> all = fault_hypotheses(sheet);
  for (const std::string& label : split_words(settings.word("signatures"))) {
    const std::string name = settings.word("fault_" + label);
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const FaultHypothesis& h) { return h.effect + "@" + h.port == name; });
    if (found == all.end())
      throw InputError(fmt::format("{}: 'fault_{}' is '{}', which is no effect with a size at a port of the datasheet",
                                   settings.where(), label, name));
    Signature s;
    const std::vector<double> exponents =
        settings.list("exponents_" + label, static_cast<std::size_t>(parameters), -100, 100);
    s.exponents = Eigen::Map<const Eigen::VectorXd>(exponents.data(), parameters);
    if (s.exponents.isZero(0))
      throw InputError(fmt::format("{}: 'exponents_{}' changes no parameter", settings.where(), label));
    double unit = settings.word_or("opposite_" + label, "no") == "yes" ? -1 : 1;
    const std::string of = settings.word_or("unit_" + label, "");
    if (!of.empty()) {
      const Parameter& p = sheet.parameters[static_cast<std::size_t>(sheet.parameter(of))];
      unit *= p.nominal;
      s.unit_error = p.tolerance;
    }
    RankedHypothesis& h = s.hypothesis;
    h.effect = found->effect;
    h.port = found->port;
    h.kind = found->kind;
    h.size_name = found->size_name;
    h.size_unit = found->size_unit;
    h.order = static_cast<std::uint32_t>(signatures_.size());
    h.none = found->none;
    h.full = found->none + unit;
    const double one = (found->size(found->lowest) - h.none) / unit,
                 other = (found->size(found->highest) - h.none) / unit;
    h.lowest = std::min(one, other);
    s.low = std::log(std::max(1 + h.lowest, kLeastFactor));
    s.high = std::log(std::max(1 + std::max(one, other), kLeastFactor));
    signatures_.push_back(std::move(s));
  }
  if (signatures_.empty()) throw InputError(settings.where() + ": 'signatures' names none");
}

SignatureTable::Match SignatureTable::match(const std::vector<std::size_t>& which, const Eigen::VectorXd& change,
                                            const Eigen::MatrixXd& weight) const {
  const auto n = static_cast<Eigen::Index>(which.size());
  Eigen::MatrixXd e(change.size(), n);
  for (Eigen::Index i = 0; i < n; ++i) e.col(i) = signatures_[which[static_cast<std::size_t>(i)]].exponents;
  const Eigen::MatrixXd normal = e.transpose() * weight * e;
  Match m;
  m.which = which;
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  m.sizes = solver.solve(e.transpose() * weight * change);
  m.stds = solver.solve(Eigen::MatrixXd::Identity(n, n)).diagonal().cwiseMax(0).cwiseSqrt();
  // At a bound of one, the other is sought anew.
  for (Eigen::Index i = 0; i < n; ++i) {
    const Signature& s = signatures_[which[static_cast<std::size_t>(i)]];
    const double held = std::clamp(m.sizes[i], s.low, s.high);
    if (held == m.sizes[i]) continue;
    m.sizes[i] = held;
    for (Eigen::Index j = 0; j < n; ++j) {
      if (j == i) continue;
      const Signature& other = signatures_[which[static_cast<std::size_t>(j)]];
      m.sizes[j] = std::clamp(e.col(j).dot(weight * (change - e.col(i) * held)) / normal(j, j), other.low, other.high);
    }
  }
  const Eigen::VectorXd left = change - e * m.sizes;
  m.chi2 = left.dot(weight * left);
  return m;
}

RankedHypothesis SignatureTable::told(const Match& m, std::size_t place, double evidence) const {
  RankedHypothesis h = signatures_[m.which[place]].hypothesis;
  const double s = m.sizes[static_cast<Eigen::Index>(place)];
  h.amplitude = std::exp(s) - 1;
  h.std = std::hypot(std::exp(s) * m.stds[static_cast<Eigen::Index>(place)],
                     signatures_[m.which[place]].unit_error * h.amplitude);
  h.evidence = evidence;
  return h;
}

SignatureTable::Answer SignatureTable::explain(const Eigen::VectorXd& change, const Eigen::MatrixXd& covariance) const {
  Eigen::MatrixXd v = covariance;
  v.diagonal().array() += std::pow(relative_error_ * change.cwiseAbs().maxCoeff(), 2);
  const Eigen::MatrixXd weight = v.ldlt().solve(Eigen::MatrixXd::Identity(v.rows(), v.cols()));
  const double all = change.dot(weight * change);
  const auto better = [](const Match& a, const Match& b) { return a.chi2 < b.chi2; };
  const auto more = [](const RankedHypothesis& a, const RankedHypothesis& b) { return a.evidence > b.evidence; };

  Answer answer;
  std::vector<Match> singles;
  for (std::size_t h = 0; h < signatures_.size(); ++h) singles.push_back(match({h}, change, weight));
  const Match& best = *std::min_element(singles.begin(), singles.end(), better);
  answer.nearest = signatures_[best.which[0]].hypothesis.name();
  if (best.chi2 <= fit_) {
    answer.explained = true;
    for (const Match& m : singles) answer.first.push_back(told(m, 0, all - m.chi2));
    std::stable_sort(answer.first.begin(), answer.first.end(), more);
    return answer;
  }

  std::vector<Match> pairs;
  for (std::size_t g = 0; g < signatures_.size(); ++g)
    for (std::size_t h = g + 1; h < signatures_.size(); ++h) pairs.push_back(match({g, h}, change, weight));
  if (pairs.empty()) return answer;
  std::stable_sort(pairs.begin(), pairs.end(), better);
  if (pairs.front().chi2 > fit_) return answer;
  answer.explained = true;
  // The larger of the best pair first. A pair that shares one of them offers its other in the place of what it leaves
  // out.
  const Match& pair = pairs.front();
  const std::size_t lead = std::abs(pair.sizes[0]) >= std::abs(pair.sizes[1]) ? 0 : 1;
  const std::size_t one = pair.which[lead], two = pair.which[1 - lead];
  const auto offer = [](std::vector<RankedHypothesis>& list, RankedHypothesis h) {
    for (const RankedHypothesis& known : list)
      if (known.order == h.order) return;
    list.push_back(std::move(h));
  };
  for (const Match& m : pairs) {
    const double evidence = all - m.chi2;
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t own = m.which[k], beside = m.which[1 - k];
      if (own != two && (beside == two || (beside != one && k == 0))) offer(answer.first, told(m, k, evidence));
      if (own != one && (beside == one || (beside != two && k == 1))) offer(answer.second, told(m, k, evidence));
    }
  }
  return answer;
}

}  // namespace faultline
