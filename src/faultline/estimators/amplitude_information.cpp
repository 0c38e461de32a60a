#include "faultline/estimators/amplitude_information.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "faultline/attribution/screening.h"

namespace faultline {

Eigen::MatrixXd amplitude_information(Eigen::MatrixXd sums, Eigen::Index parameters) {
  sums.block(1, 1, parameters, parameters) =
      Eigen::MatrixXd::Identity(parameters, parameters) + 2 * sums.block(1, 1, parameters, parameters).eval();
  const Eigen::Index hypotheses = sums.cols() - 1 - parameters;
  return without_parameters(sums, parameters).bottomRightCorner(hypotheses, hypotheses);
}

std::vector<double> amplitude_errors(const Eigen::MatrixXd& information, double least) {
  std::vector<double> result;
  for (const double left : Eigen::VectorXd(information.diagonal()))
    result.push_back(left > least ? 1 / std::sqrt(left) : std::numeric_limits<double>::infinity());
  return result;
}

Eigen::MatrixXd response_cosines(const Eigen::MatrixXd& information, double least) {
  const Eigen::VectorXd scale = information.diagonal().unaryExpr(
      [&](double square) { return square > 1.02 * least ? 1 / std::sqrt(square) : 0.0; });
  return scale.asDiagonal() * information * scale.asDiagonal();
}

bool every_place_shows(const std::vector<FaultHypothesis>& hypotheses, const std::vector<double>& errors,
                       double evidence) {
  std::map<std::string, bool> places;
  for (std::size_t h = 0; h < errors.size(); ++h) {
    const FaultHypothesis& fault = hypotheses[h];
    if (fault.kind != AlarmKind::fault) continue;
    bool& seen = places[fault.port];
    seen = seen || std::sqrt(evidence) * errors[h] <= std::max(std::abs(fault.lowest), fault.highest);
  }
  return std::all_of(places.begin(), places.end(), [](const auto& place) { return place.second; });
}

}  // namespace faultline
