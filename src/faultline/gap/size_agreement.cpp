#include "faultline/gap/size_agreement.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/fault_hypothesis.h"

namespace faultline {
namespace {

constexpr double kStep = 0.05;             // of the amplitude, for the derivative
constexpr double kShown = 0.1;             // of the largest information of a part, from which a part counts
constexpr std::size_t kPieces = 4;         // that a run is cut into, at most,
constexpr std::size_t kPieceSegments = 6;  // ... each of so many segments, at least

// Number of parts up to each run.
std::vector<std::size_t> pieces_of(const ResidualModel& residuals, const Linearisation& linear) {
  std::vector<std::size_t> result;
  for (const std::size_t run : linear.runs())
    result.push_back(std::clamp<std::size_t>(residuals.runs()[run].segments() / kPieceSegments, 1, kPieces));
  return result;
}

SizeAgreement agreement_of(const std::vector<double>& information, const std::vector<double>& pull, double alike) {
  SizeAgreement result;
  const double most = *std::max_element(information.begin(), information.end());
  double sum = 0, squares = 0, noise = 0;
  for (std::size_t p = 0; p < information.size(); ++p) {
    if (!(information[p] > kShown * most) || information[p] <= alike) continue;
    const double move = -pull[p] / information[p], a = 1 + move;
    result.least = result.parts == 0 ? a : std::min(result.least, a);
    result.most = result.parts == 0 ? a : std::max(result.most, a);
    sum += move;
    squares += move * move;
    noise += alike / information[p];
    ++result.parts;
  }
  if (result.parts < 2) return result;
  const double n = result.parts, variance = (squares - sum * sum / n) / (n - 1);
  result.spread = std::sqrt(std::max(0.0, variance - noise / n));
  return result;
}

}  // namespace

std::vector<SizeAgreement> size_agreement(const ResidualModel& residuals, const FitResult& at,
                                          const Linearisation& linear, int jobs) {
  std::vector<SizeAgreement> result(at.effects.size());
  if (at.effects.empty()) return result;
  Linearisation::Columns columns(at.effects.size());
  const std::vector<Eigen::MatrixXf> now = residuals_of(residuals, at.model, linear.runs(), jobs);
  for (std::size_t e = 0; e < at.effects.size(); ++e) {
    ModelChange less = at.model;
    less.effects[e].parameters = scaled(less.effects[e], 1 - kStep);
    columns[e] = difference(now, residuals_of(residuals, less, linear.runs(), jobs), kStep);
  }
  const std::vector<std::size_t> pieces = pieces_of(residuals, linear);
  std::size_t parts = 0;
  for (const std::size_t count : pieces) parts += count;
  std::vector<std::vector<double>> information(columns.size(), std::vector<double>(parts, 0)), pull = information;
  const auto first = static_cast<Eigen::Index>(1 + linear.free_parameters().size());
  const std::vector<Eigen::MatrixXd> products = linear.products(now, columns);
  std::size_t segment = 0, before = 0;
  for (std::size_t r = 0; r < pieces.size(); ++r) {
    const std::size_t segments = residuals.runs()[linear.runs()[r]].segments();
    for (std::size_t s = 0; s < segments; ++s, ++segment) {
      const Eigen::MatrixXd& p = products[segment];
      const double weight = linear.robust_weight(0.5 * p(0, 0));
      const std::size_t part = before + s * pieces[r] / segments;
      for (std::size_t e = 0; e < columns.size(); ++e) {
        const Eigen::Index at_e = first + static_cast<Eigen::Index>(e);
        information[e][part] += weight * p(at_e, at_e);
        pull[e][part] += weight * p(at_e, 0);
      }
    }
    before += pieces[r];
  }
  const double alike = std::max(
      1.0, residuals.options().trials.correlated_fraction * static_cast<double>(fewest_rows(residuals.runs())));
  for (std::size_t e = 0; e < result.size(); ++e)
    if (*std::max_element(information[e].begin(), information[e].end()) > 0)
      result[e] = agreement_of(information[e], pull[e], alike);
  return result;
}

}  // namespace faultline
