#include "faultline/gap/onset.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

// Of the values that follow, or of the others: how many, their mean, and the scatter around it.
struct Group {
  double count = 0, mean = 0, squares = 0;
};

Group group(const std::vector<double>& values, const std::vector<bool>& follows, bool later) {
  Group result;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (follows[i] == later) ++result.count, result.mean += values[i];
  result.mean /= std::max(result.count, 1.0);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (follows[i] == later) result.squares += (values[i] - result.mean) * (values[i] - result.mean);
  return result;
}

double excess(const Group& losses, double values) { return std::max(0.0, 2 * losses.mean / values - 1); }

std::vector<Eigen::MatrixXd> those_before(const std::vector<Eigen::MatrixXd>& products,
                                          const std::vector<bool>& follows) {
  std::vector<Eigen::MatrixXd> result;
  for (std::size_t i = 0; i < products.size(); ++i)
    if (!follows[i]) result.push_back(products[i]);
  return result;
}

// As they are in a run that began `seconds` earlier: since when a signal is stuck is a time.
std::vector<EffectSpec> moved(std::vector<EffectSpec> effects, double seconds) {
  for (EffectSpec& effect : effects)
    if (find_effect_type(effect.effect)->family == "stuck") effect.parameters.front() += seconds;
  return effects;
}

}  // namespace

double Onset::begins(std::size_t run) const {
  for (const Since::Moment& moment : moments)
    if (moment.run == run) return moment.time;
  return 0;
}

OnsetSearch::OnsetSearch(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options, int jobs)
    : jobs_(jobs), residuals_(sheet, std::move(runs), options) {
  for (std::size_t i = 0; i < residuals_.runs().size(); ++i) every_.push_back(i);
}

std::vector<bool> OnsetSearch::follows(const Firsts& firsts) const {
  std::vector<bool> result;
  for (std::size_t r = 0; r < every_.size(); ++r)
    for (std::size_t i = 0; i < residuals_.runs()[r].segments(); ++i) result.push_back(i >= firsts[r]);
  return result;
}

void OnsetSearch::settle(const ModelChange& at) {
  std::vector<std::vector<Eigen::MatrixXf>> starts(every_.size());
  in_parallel(every_.size(), jobs_,
              [&](std::size_t i) { starts[i] = residuals_.settle_starts(at, every_[i], {}, jobs_); });
  linear_ = std::make_shared<Linearisation>(residuals_, at, every_, jobs_, std::move(starts));
}

std::vector<double> OnsetSearch::levels(const Products& products, const Eigen::VectorXd& move) const {
  Eigen::VectorXd at = Eigen::VectorXd::Ones(1 + move.size());
  at.tail(move.size()) = move;
  std::vector<double> result;
  for (const Eigen::MatrixXd& segment : products) result.push_back(linear_->robust(0.5 * at.dot(segment * at)));
  return result;
}

double OnsetSearch::score(const std::vector<double>& level, const Firsts& firsts) const {
  const GapOptions::Onset& options = residuals_.options().onset;
  const std::vector<bool> later = follows(firsts);
  const Group first = group(level, later, false), second = group(level, later, true);
  if (first.count < static_cast<double>(options.least_segments) ||
      second.count < static_cast<double>(options.least_segments))
    return 0;
  const double step = second.mean - first.mean, least = options.least_step_variances * linear_->segment_values();
  return first.count * second.count / (first.count + second.count) * step * std::abs(step) /
         (first.squares + second.squares + least * least);
}

// Each moment between two segments of that order.
void OnsetSearch::try_order(const std::vector<std::size_t>& order, const Products& products, const Eigen::VectorXd& z,
                            std::optional<Split>& best) const {
  std::vector<std::size_t> run_of;
  for (std::size_t r = 0; r < every_.size(); ++r) run_of.insert(run_of.end(), residuals_.runs()[r].segments(), r);
  const std::size_t least = residuals_.options().onset.least_segments;
  Split split;
  split.firsts.assign(every_.size(), 0);
  Products before;
  for (const std::size_t i : order) {
    if (before.size() >= least && before.size() + least <= order.size()) {
      split.before = adjusted(*linear_, before, z);
      split.score = score(levels(products, split.before.move), split.firsts);
      if (split.score > (best ? best->score : 0)) best = split;
    }
    before.push_back(products[i]);
    ++split.firsts[run_of[i]];
  }
}

std::optional<OnsetSearch::Split> OnsetSearch::best_split(const Products& products, const Eigen::VectorXd& z) const {
  std::vector<std::size_t> order(products.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::optional<Split> best;
  try_order(order, products, z, best);
  if (every_.size() > 1) {
    std::vector<double> time;
    for (const SegmentedRun& run : residuals_.runs())
      for (const std::size_t restart : run.restarts)
        time.push_back(run.recording.time[restart] - run.recording.time.front());
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return time[a] < time[b]; });
    try_order(order, products, z, best);
    if (best) part_runs(products, z, *best);
  }
  return best;
}

// With parameters as they are, then those of what is before.
void OnsetSearch::part_runs(const Products& products, const Eigen::VectorXd& z, Split& split) const {
  const std::size_t inside = residuals_.options().onset.inside_segments;
  const std::vector<double> level = levels(products, split.before.move);
  split.score = score(level, split.firsts);
  const Firsts given = split.firsts;
  for (bool better = true; better;) {
    better = false;
    for (std::size_t r = 0; r < every_.size(); ++r) {
      const std::size_t all = residuals_.runs()[r].segments();
      for (std::size_t first = 0; first <= all; ++first) {
        if (first > 0 && first < all && (first < inside || first + inside > all)) continue;
        Firsts tried = split.firsts;
        tried[r] = first;
        const double reached = score(level, tried);
        if (reached <= split.score) continue;
        split.score = reached;
        split.firsts = tried;
        better = true;
      }
    }
  }
  if (split.firsts != given) split.before = adjusted(*linear_, those_before(products, follows(split.firsts)), z);
}

std::vector<double> OnsetSearch::uncertainty(const Products& products) const {
  const std::vector<std::size_t>& free = linear_->free_parameters();
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(n, n);
  for (const Eigen::MatrixXd& segment : products)
    hessian += linear_->robust_weight(0.5 * segment(0, 0)) * segment.bottomRightCorner(n, n);
  const Eigen::VectorXd variance = hessian.ldlt().solve(Eigen::MatrixXd::Identity(n, n)).diagonal();
  std::vector<double> result(residuals_.sheet().parameters.size(), 1.0);
  for (Eigen::Index i = 0; i < n; ++i) result[free[static_cast<std::size_t>(i)]] = std::sqrt(variance[i]);
  return result;
}

std::optional<Onset> OnsetSearch::find() {
  const GapOptions::Onset& options = residuals_.options().onset;
  const Datasheet& sheet = residuals_.sheet();
  ModelChange model{sheet.nominal(), {}};
  std::optional<Split> split;
  Products products;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    settle(model);
    products = linear_->products(linear_->at_model());
    const Firsts before = split ? split->firsts : Firsts();
    const Eigen::VectorXd z = deviations(sheet, linear_->free_parameters(), model.parameters);
    split = best_split(products, z);
    if (!split) return std::nullopt;
    const Eigen::VectorXd move = split->before.move;
    if (split->firsts == before && move.lpNorm<Eigen::Infinity>() < options.settled_tolerances) break;
    shift_parameters(residuals_, linear_->free_parameters(), move, model.parameters);
  }
  settle(model);
  products = linear_->products(linear_->at_model());
  const std::vector<bool> later = follows(split->firsts);
  const std::vector<double> losses = linear_->segment_losses(linear_->at_model());
  const double values = linear_->segment_values();
  const double following = excess(group(losses, later, true), values);
  if (following < options.least_excess_variances ||
      excess(group(losses, later, false), values) > options.before_fraction * following)
    return std::nullopt;
  // A rig that only begins to move then has told nothing before.
  std::vector<double> shown;
  for (const Eigen::MatrixXd& segment : products) shown.push_back(segment.diagonal().tail(segment.rows() - 1).sum());
  if (group(shown, later, false).mean < options.shown_fraction * group(shown, later, true).mean) return std::nullopt;

  Onset onset;
  onset.segments = split->firsts;
  onset.parameters = model.parameters;
  onset.uncertainty = uncertainty(those_before(products, later));
  onset.following = following;
  for (std::size_t r = 0; r < every_.size(); ++r) {
    const SegmentedRun& run = residuals_.runs()[r];
    const std::size_t first = onset.segments[r];
    if (first == 0 || first == run.segments()) continue;
    if (first < options.inside_segments || first + options.inside_segments > run.segments()) return std::nullopt;
    onset.moments.push_back({r, run.recording.time[run.restarts[first]] - run.recording.time.front()});
  }
  if (!onset.moments.empty()) return onset;
  for (std::size_t r = 0; r < every_.size(); ++r)
    if (onset.segments[r] == 0) onset.moments.push_back({r, 0});
  return onset;
}

double OnsetSearch::contradicted(const Onset& onset, const std::vector<EffectSpec>& effects) const {
  const std::vector<bool> follow = follows(onset.segments);
  const Eigen::VectorXd z = deviations(residuals_.sheet(), linear_->free_parameters(), onset.parameters);
  const Products without = linear_->products(linear_->at_model());
  const Products with = linear_->products(residuals_of(residuals_, {onset.parameters, effects}, every_, jobs_));
  std::vector<Eigen::MatrixXf> there;
  for (std::size_t r = 0; r < every_.size(); ++r)
    there.push_back(
        residuals_of(residuals_, {onset.parameters, moved(effects, onset.begins(r))}, {every_[r]}, jobs_)[0]);
  Products later = without;
  const Products those = linear_->products(there);
  for (std::size_t i = 0; i < later.size(); ++i)
    if (follow[i]) later[i] = those[i];
  const double never = adjusted(*linear_, without, z).loss, always = adjusted(*linear_, with, z).loss,
               since = adjusted(*linear_, later, z).loss;
  return never > since ? std::max(0.0, always - since) / (never - since) : 0.0;
}

SegmentedRun rest_of(const Datasheet& sheet, const SegmentedRun& run, std::size_t segment,
                     const SegmentOptions& options) {
  Recording rest;
  rest.rig = run.recording.rig;
  rest.channels = run.recording.channels;
  for (std::size_t k = run.restarts[segment]; k < run.recording.rows(); ++k) rest.append(run.measured(k));
  return cut_run(sheet, run.name, std::move(rest), static_cast<double>(run.segment) * run.period, options);
}

Datasheet calibrated(const Datasheet& sheet, const Onset& onset, const GapOptions::Onset& options) {
  Datasheet result = sheet;
  for (std::size_t i = 0; i < result.parameters.size(); ++i) {
    Parameter& p = result.parameters[i];
    if (!(p.tolerance > 0)) continue;
    p.nominal = onset.parameters[i];
    if (onset.uncertainty[i] < options.untold_tolerances) p.tolerance *= options.tolerance_fraction;
  }
  return result;
}

}  // namespace faultline
