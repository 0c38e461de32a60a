#include "faultline/attribution/screening.h"

#include <algorithm>
#include <limits>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {

Eigen::MatrixXd known_to_tolerance(const Eigen::VectorXd& z) {
  Eigen::MatrixXd gram = Eigen::MatrixXd::Identity(1 + z.size(), 1 + z.size());
  gram(0, 0) = z.squaredNorm();
  gram.col(0).tail(z.size()) = gram.row(0).tail(z.size()) = z;
  return gram;
}

Eigen::MatrixXd without_parameters(const Eigen::MatrixXd& gram, Eigen::Index parameters) {
  const Eigen::Index hypotheses = gram.rows() - 1 - parameters;
  // [r D] against T, and against itself.
  Eigen::MatrixXd across(parameters, 1 + hypotheses), left(1 + hypotheses, 1 + hypotheses);
  across << gram.block(1, 0, parameters, 1), gram.block(1, 1 + parameters, parameters, hypotheses);
  left << gram(0, 0), gram.row(0).tail(hypotheses), gram.col(0).tail(hypotheses),
      gram.bottomRightCorner(hypotheses, hypotheses);
  left.noalias() -= across.transpose() * gram.block(1, 1, parameters, parameters).ldlt().solve(across);
  return left;
}

Eigen::VectorXd best_parameters(const Eigen::MatrixXd& gram, Eigen::Index parameters) {
  return -gram.block(1, 1, parameters, parameters).ldlt().solve(gram.block(1, 0, parameters, 1));
}

double least_loss(const Eigen::MatrixXd& gram, Eigen::Index parameters) {
  return gram(0, 0) + gram.block(1, 0, parameters, 1).col(0).dot(best_parameters(gram, parameters));
}

BestSize best_size(const Eigen::MatrixXd& left, Eigen::Index h, double lowest, double highest, double least) {
  BestSize best;
  const double slope = left(0, h);
  if (!(left(h, h) > least)) return best;
  best.information = left(h, h);
  best.size = std::clamp(-slope / best.information, lowest, highest);
  best.gain = -best.size * (2 * slope + best.size * best.information);
  return best;
}

std::vector<std::size_t> try_sizes(std::vector<Trial>& trials, std::size_t followed, int jobs,
                                   const std::function<double(std::size_t, double)>& loss) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<std::size_t> begins;  // of each hypothesis' trials
  for (std::size_t i = 0; i < trials.size(); ++i) {
    trials[i].loss = kNone;
    if (i == 0 || trials[i].hypothesis != trials[i - 1].hypothesis) begins.push_back(i);
  }
  std::vector<std::size_t> best = begins;
  begins.push_back(trials.size());
  double enough = kNone;
  for (const bool first : {true, false}) {
    in_parallel(best.size(), jobs, [&](std::size_t h) {
      const bool tried = trials[best[h]].loss < kNone;
      if (tried && trials[best[h]].loss > enough) return;
      for (std::size_t i = begins[h]; i < begins[h + 1]; ++i) {
        if (trials[i].first != first) continue;
        const double least = std::min(enough, trials[best[h]].loss), found = loss(i, least);
        if (!(found < least)) continue;
        trials[i].loss = found;
        best[h] = i;
      }
    });
    std::vector<double> reached;
    for (const std::size_t i : best)
      if (trials[i].loss < kNone) reached.push_back(trials[i].loss);
    std::sort(reached.begin(), reached.end());
    if (!reached.empty()) enough = reached[std::min(std::max<std::size_t>(followed, 1), reached.size()) - 1];
  }
  best.erase(std::remove_if(best.begin(), best.end(), [&](std::size_t i) { return !(trials[i].loss < kNone); }),
             best.end());
  std::stable_sort(best.begin(), best.end(),
                   [&](std::size_t a, std::size_t b) { return trials[a].loss < trials[b].loss; });
  return best;
}

}  // namespace faultline
