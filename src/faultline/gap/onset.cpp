#include "faultline/gap/onset.h"
#include "faultline/numerics/in_parallel.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

double mean(const std::vector<double>& values, std::size_t first, std::size_t last) {
  double sum = 0;
  for (std::size_t i = first; i < last; ++i) sum += values[i];
  return sum / static_cast<double>(last - first);
}

double squares(const std::vector<double>& values, std::size_t first, std::size_t last) {
  const double middle = mean(values, first, last);
  double sum = 0;
  for (std::size_t i = first; i < last; ++i) sum += (values[i] - middle) * (values[i] - middle);
  return sum;
}

double excess(const std::vector<double>& losses, std::size_t first, std::size_t last, double values) {
  return std::max(0.0, 2 * mean(losses, first, last) / values - 1);
}

std::vector<Eigen::MatrixXd> part(const std::vector<Eigen::MatrixXd>& products, std::size_t first, std::size_t last) {
  return {products.begin() + static_cast<std::ptrdiff_t>(first), products.begin() + static_cast<std::ptrdiff_t>(last)};
}

}  // namespace

OnsetSearch::OnsetSearch(const Datasheet& sheet, std::vector<SegmentedRun> runs, const GapOptions& options, int jobs)
    : jobs_(jobs), residuals_(sheet, std::move(runs), options) {
  for (std::size_t i = 0; i < residuals_.runs().size(); ++i) every_.push_back(i);
}

std::size_t OnsetSearch::first_segment(std::size_t run) const {
  std::size_t first = 0;
  for (std::size_t r = 0; r < run; ++r) first += residuals_.runs()[r].segments();
  return first;
}

void OnsetSearch::settle(const ModelChange& at) {
  std::vector<std::vector<Eigen::MatrixXf>> starts(every_.size());
  in_parallel(every_.size(), jobs_,
              [&](std::size_t i) { starts[i] = residuals_.settle_starts(at, every_[i], {}, jobs_); });
  linear_ = std::make_shared<Linearisation>(residuals_, at, every_, jobs_, std::move(starts));
}

std::optional<OnsetSearch::Split> OnsetSearch::best_split(const std::vector<Eigen::MatrixXd>& products,
                                                          const Eigen::VectorXd& z) const {
  const GapOptions::Onset& options = residuals_.options().onset;
  const std::size_t all = products.size();
  const Eigen::Index n = z.size();
  std::optional<Split> best;
  double most = 0;
  std::vector<double> level(all);
  Eigen::VectorXd at = Eigen::VectorXd::Ones(1 + n);
  for (std::size_t t = options.least_segments; t + options.least_segments <= all; ++t) {
    Split split{t, adjusted(*linear_, part(products, 0, t), z)};
    at.tail(n) = split.before.move;
    for (std::size_t i = 0; i < all; ++i) level[i] = linear_->robust(0.5 * at.dot(products[i] * at));
    const double step = mean(level, t, all) - mean(level, 0, t);
    const double scatter = squares(level, 0, t) + squares(level, t, all);
    const double first = static_cast<double>(t), second = static_cast<double>(all - t);
    const double least = options.least_step_variances * linear_->segment_values();
    const double score = first * second / (first + second) * step * std::abs(step) / (scatter + least * least);
    if (score <= most) continue;
    most = score;
    best = std::move(split);
  }
  return best;
}

std::optional<Onset> OnsetSearch::find() {
  const GapOptions::Onset& options = residuals_.options().onset;
  const Datasheet& sheet = residuals_.sheet();
  ModelChange model{sheet.nominal(), {}};
  std::optional<Split> split;
  std::vector<Eigen::MatrixXd> products;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    settle(model);
    products = linear_->products(linear_->at_model());
    const std::size_t before = split ? split->segment : 0;
    const Eigen::VectorXd z = deviations(sheet, linear_->free_parameters(), model.parameters);
    split = best_split(products, z);
    if (!split) return std::nullopt;
    const Eigen::VectorXd move = split->before.move;
    if (round > 0 && split->segment == before && move.lpNorm<Eigen::Infinity>() < options.settled_tolerances) break;
    shift_parameters(residuals_, linear_->free_parameters(), move, model.parameters);
  }
  settle(model);
  products = linear_->products(linear_->at_model());
  const std::vector<double> losses = linear_->segment_losses(linear_->at_model());
  const double values = linear_->segment_values();
  const double earlier = excess(losses, 0, split->segment, values);
  const double later = excess(losses, split->segment, losses.size(), values);
  if (later < options.least_excess_variances || earlier > options.before_fraction * later) return std::nullopt;
  // A rig that only begins to move then has told nothing before.
  std::vector<double> shown;
  for (const Eigen::MatrixXd& segment : products) shown.push_back(segment.diagonal().tail(segment.rows() - 1).sum());
  if (mean(shown, 0, split->segment) < options.shown_fraction * mean(shown, split->segment, shown.size()))
    return std::nullopt;

  Onset onset;
  while (onset.run + 1 < every_.size() && first_segment(onset.run + 1) <= split->segment) ++onset.run;
  onset.segment = split->segment - first_segment(onset.run);
  const SegmentedRun& run = residuals_.runs()[onset.run];
  if (onset.segment < options.inside_segments || onset.segment + options.inside_segments > run.segments())
    return std::nullopt;
  onset.time = run.recording.time[run.restarts[onset.segment]] - run.recording.time.front();
  onset.parameters = model.parameters;
  return onset;
}

double OnsetSearch::contradicted(const Onset& onset, const std::vector<EffectSpec>& effects) const {
  const std::size_t t = first_segment(onset.run) + onset.segment;
  const Eigen::VectorXd z = deviations(residuals_.sheet(), linear_->free_parameters(), onset.parameters);
  const std::vector<Eigen::MatrixXd> without = linear_->products(linear_->at_model());
  const std::vector<Eigen::MatrixXd> with =
      linear_->products(residuals_of(residuals_, {onset.parameters, effects}, every_, jobs_));
  std::vector<Eigen::MatrixXd> later = part(without, 0, t);
  later.insert(later.end(), with.begin() + static_cast<std::ptrdiff_t>(t), with.end());
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

Datasheet calibrated(const Datasheet& sheet, const Onset& onset, double tolerance_fraction) {
  Datasheet result = sheet;
  for (std::size_t i = 0; i < result.parameters.size(); ++i) {
    Parameter& p = result.parameters[i];
    if (!(p.tolerance > 0)) continue;
    p.nominal = onset.parameters[i];
    p.tolerance *= tolerance_fraction;
  }
  return result;
}

}  // namespace faultline
