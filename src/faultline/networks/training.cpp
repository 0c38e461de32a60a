#include "faultline/networks/training.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "faultline/networks/one_step.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Index = Eigen::Index;

constexpr Index kBlock = 512;  // columns of J' that are multiplied at once: they stay in the cache
constexpr double kLeastDamping = 1e-12, kMostDamping = 1e6;
constexpr double kLeastScale = 1e-3;  // of the largest diagonal entry
constexpr double kRunaway = 1e6;      // of a scaled output
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// J' J of the rows of one unit's outputs, over the columns where they can differ from 0.
class Gram {
 public:
  Gram(Index first, Index width)
      : first_(first),
        square_(Eigen::MatrixXd::Zero(width, width)),
        gradient_(Eigen::VectorXd::Zero(width)),
        rows_(width, kBlock),
        errors_(kBlock) {}
  template <class Row>
  void add(const Row& row, double error) {
    rows_.col(used_) = row.segment(first_, rows_.rows()).transpose();
    errors_[used_] = error;
    if (++used_ == kBlock) multiply();
  }
  void finish(NormalEquations& equations) {
    multiply();
    equations.square.block(first_, first_, rows_.rows(), rows_.rows()) += square_;
    equations.gradient.segment(first_, rows_.rows()) += gradient_;
  }

 private:
  void multiply() {
    square_.selfadjointView<Eigen::Lower>().rankUpdate(rows_.leftCols(used_));
    gradient_.noalias() += rows_.leftCols(used_) * errors_.head(used_);
    used_ = 0;
  }
  Index first_, used_ = 0;
  Eigen::MatrixXd square_;
  Eigen::VectorXd gradient_;
  Eigen::MatrixXd rows_;
  Eigen::VectorXd errors_;
};

// Calls `each` with the network after every sample but a run's first; false where an output runs away.
template <class Each>
bool run_through(Network& network, const Eigen::VectorXd& weights, const std::vector<NetworkRun>& runs,
                 const Beginnings& beginnings, Each each) {
  for (const NetworkRun& run : runs) {
    network.start(run.inputs.col(0).data(), run.outputs.col(0).data());
    Index since = 0;
    for (Index k = 1; k < run.inputs.cols(); ++k, ++since) {
      if (beginnings.horizon > 0 && since == static_cast<Index>(beginnings.horizon)) since = 0;
      if (since == 0 && k > 1 && beginnings.cold == 0) network.restart_measured();
      if (since == 0 && beginnings.cold > 0) network.restart_cold();
      network.step(weights.data(), run.inputs.col(k).data());
      if (!(network.outputs().lpNorm<Eigen::Infinity>() < kRunaway)) return false;
      if (since >= static_cast<Index>(beginnings.cold)) each(run.outputs.col(k));
      network.take(run.outputs.col(k).data());
    }
  }
  return true;
}

void check(NormalEquations& equations) {
  if (!equations.gradient.allFinite() || !equations.square.diagonal().allFinite()) equations.error = kInfinity;
}

}  // namespace

Eigen::VectorXd initial_weights(const NetworkShape& shape, std::uint64_t seed) {
  Random random(seed);
  Eigen::VectorXd weights(static_cast<Index>(shape.weights()));
  Index next = 0;
  const auto fill = [&](std::size_t count, double size) {
    for (std::size_t i = 0; i < count; ++i) weights[next++] = size * random.normal();
  };
  for (const NetworkUnit& unit : shape.units) {
    fill(unit.sum.size(), 1 / std::sqrt(std::max<double>(1, static_cast<double>(unit.sum.size()))));
    fill(unit.hidden * unit.entries(), 1 / std::sqrt(static_cast<double>(unit.entries())));
    fill(unit.hidden, 1);
    for (std::size_t o = 0; o < unit.outputs.size(); ++o) {
      fill(unit.hidden, 0.1 / std::sqrt(static_cast<double>(unit.hidden)));
      if (!unit.integrating) fill(1, 0);
    }
  }
  return weights;
}

Eigen::VectorXd mean_squares(const NetworkShape& shape, const Eigen::VectorXd& weights,
                             const std::vector<NetworkRun>& runs, const Beginnings& beginnings) {
  if (is_one_step(shape) && beginnings.cold == 0) {
    const Eigen::VectorXd found = one_step_mean_squares(shape, weights, runs);
    return found.allFinite() ? found : Eigen::VectorXd::Constant(found.size(), kInfinity);
  }
  Network network(shape);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Index>(shape.outputs.size()));
  double count = 0;
  const bool stays = run_through(network, weights, runs, beginnings, [&](const auto& measured) {
    sum += (measured - network.outputs()).cwiseAbs2();
    ++count;
  });
  if (!stays) return Eigen::VectorXd::Constant(sum.size(), kInfinity);
  return sum / std::max(1.0, count);
}

NormalEquations normal_equations(const NetworkShape& shape, const Eigen::VectorXd& weights,
                                 const std::vector<NetworkRun>& runs, const Beginnings& beginnings) {
  NormalEquations equations;
  if (is_one_step(shape) && beginnings.cold == 0) {
    equations = one_step_equations(shape, weights, runs);
    check(equations);
    return equations;
  }
  Network network(shape, true);
  equations.square.setZero(weights.size(), weights.size());
  equations.gradient.setZero(weights.size());
  std::vector<Gram> grams;
  std::vector<std::pair<Index, std::size_t>> rows;  // output, and whose
  double count = 0;
  const bool together = shape.feedback == Feedback::all;
  for (std::size_t u = 0; u < shape.units.size(); ++u) {
    if (!together || u == 0)
      grams.emplace_back(static_cast<Index>(network.first(u)), static_cast<Index>(network.end(u) - network.first(u)));
    for (const std::size_t output : shape.units[u].outputs) rows.emplace_back(output, grams.size() - 1);
  }
  const bool stays = run_through(network, weights, runs, beginnings, [&](const auto& measured) {
    ++count;
    for (const auto& [output, gram] : rows) {
      const double error = measured[output] - network.outputs()[output];
      equations.error += error * error;
      grams[gram].add(network.sensitivities().row(output), error);
    }
  });
  for (Gram& gram : grams) gram.finish(equations);
  count = std::max(1.0, count);
  equations.square /= count;
  equations.gradient /= count;
  equations.error /= count;
  if (!stays) equations.error = kInfinity;
  check(equations);
  return equations;
}

Trainer::Trainer(NetworkShape shape, std::vector<NetworkRun> training, std::vector<NetworkRun> validation,
                 const Beginnings& beginnings)
    : shape_(std::move(shape)),
      training_(std::move(training)),
      validation_(std::move(validation)),
      beginnings_(beginnings),
      whole_{0, beginnings.cold} {}

double Trainer::samples() const {
  double count = 0;
  for (const NetworkRun& run : training_) count += static_cast<double>(run.inputs.cols());
  return count;
}

TrainingState Trainer::begin(const Eigen::VectorXd& weights) const {
  TrainingState state;
  state.weights = state.best = weights;
  state.error = mean_squares(shape_, weights, training_, beginnings_).sum();
  state.best_error = mean_squares(shape_, weights, judged(), validation_.empty() ? beginnings_ : whole_).sum();
  if (!std::isfinite(state.error))
    throw InputError("the network runs away with its initial weights; train it one step ahead first (--feedback none)");
  return state;
}

bool Trainer::epoch(TrainingState& state) const {
  const NormalEquations equations = normal_equations(shape_, state.weights, training_, beginnings_);
  if (!std::isfinite(equations.error)) return false;
  // Diagonal entries that are almost 0 would let weights that say little run away.
  const Eigen::VectorXd scale =
      (equations.square.diagonal().array() + kLeastScale * equations.square.diagonal().maxCoeff()).matrix();
  for (double damping = state.damping; damping <= kMostDamping; damping *= 10) {
    Eigen::MatrixXd damped = equations.square;
    damped.diagonal().array() += damping * scale.array();
    const Eigen::VectorXd weights =
        state.weights + damped.selfadjointView<Eigen::Lower>().llt().solve(equations.gradient);
    if (!weights.allFinite()) continue;
    const double error = mean_squares(shape_, weights, training_, beginnings_).sum();
    if (!(error < equations.error)) continue;
    state.weights = weights;
    state.error = error;
    state.damping = std::max(kLeastDamping, damping / 10);
    ++state.epoch;
    const double judged = validation_.empty() ? error : mean_squares(shape_, weights, validation_, whole_).sum();
    if (judged < state.best_error || !std::isfinite(state.best_error)) {
      state.best = weights;
      state.best_error = judged;
      state.best_epoch = state.epoch;
    }
    return true;
  }
  return false;
}

}  // namespace faultline
