#include "faultline/gap/least_squares.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace faultline {
namespace {

constexpr double kBound = 3.5;        // tolerances a parameter may move
constexpr double kStep = 0.1;         // tolerances, for differences
constexpr double kEffectStep = 2e-3;  // of a coordinate, for differences

std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& model, const GapModel& at,
                                          const std::vector<std::size_t>& runs) {
  std::vector<Eigen::MatrixXf> result;
  for (const std::size_t run : runs) result.push_back(model.residuals(at, run));
  return result;
}

std::vector<Eigen::MatrixXf> difference(const std::vector<Eigen::MatrixXf>& a, const std::vector<Eigen::MatrixXf>& b,
                                        double step) {
  std::vector<Eigen::MatrixXf> result;
  for (std::size_t i = 0; i < a.size(); ++i) result.push_back((a[i] - b[i]) / static_cast<float>(step));
  return result;
}

void shift_parameters(const Datasheet& sheet, const std::vector<std::size_t>& free, const Eigen::VectorXd& step,
                      std::vector<double>& parameters) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    const Parameter& p = sheet.parameters[free[i]];
    const double unit = p.nominal * p.tolerance;
    const double z =
        std::clamp((parameters[free[i]] - p.nominal) / unit + step[static_cast<Eigen::Index>(i)], -kBound, kBound);
    parameters[free[i]] = p.nominal + z * unit;
  }
}

}  // namespace

void parallel(std::size_t count, int jobs, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex guard;
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(guard);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < jobs && static_cast<std::size_t>(i) < count; ++i) threads.emplace_back(run);
  run();
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

bool Candidate::logarithmic(std::size_t i) const {
  return bounds[i].minimum > 0 && bounds[i].maximum / bounds[i].minimum > 20;
}

double Candidate::to_coordinate(std::size_t i, double value) const {
  const Bounds& b = bounds[i];
  if (logarithmic(i)) return std::log(std::max(value, 1e-300) / b.minimum) / std::log(b.maximum / b.minimum);
  return (value - b.minimum) / (b.maximum - b.minimum);
}

double Candidate::from_coordinate(std::size_t i, double coordinate) const {
  const Bounds& b = bounds[i];
  const double c = std::clamp(coordinate, 0.0, 1.0);
  if (logarithmic(i)) return b.minimum * std::pow(b.maximum / b.minimum, c);
  return b.minimum + c * (b.maximum - b.minimum);
}

std::vector<Candidate> candidates(const Datasheet& sheet, const std::vector<std::string>& without, double duration) {
  std::vector<Candidate> result;
  for (const Port& port : sheet.ports)
    for (const FittingEffect& fitting : port.effects) {
      const EffectType* type = find_effect_type(fitting.effect);
      if (!type) continue;
      const std::string whole = fitting.effect + "@" + port.name;
      if (std::any_of(without.begin(), without.end(),
                      [&](const std::string& w) { return w == whole || w == fitting.effect; }))
        continue;
      Candidate candidate;
      candidate.effect.effect = fitting.effect;
      candidate.effect.port = port.name;
      candidate.family = type->family;
      for (const EffectParameter& parameter : type->parameters) {
        const auto found = fitting.bounds.find(parameter.name);
        // A parameter without a range here keeps its no-effect value.
        Bounds bounds = found == fitting.bounds.end() ? Bounds{parameter.none, parameter.none} : found->second;
        if (!std::isfinite(bounds.maximum)) bounds.maximum = duration;  // "from" of a stuck sensor: any time of the run
        candidate.bounds.push_back(bounds);
        candidate.effect.parameters.push_back(parameter.none);
      }
      result.push_back(candidate);
    }
  return result;
}

std::vector<std::vector<double>> starting_points(const Candidate& candidate) {
  // Sizes over the range on both sides of no effect; a second parameter is a shape and gets three values.
  const EffectType* type = find_effect_type(candidate.effect.effect);
  std::vector<std::vector<double>> points = {{}};
  for (std::size_t i = 0; i < candidate.bounds.size(); ++i) {
    const Bounds& b = candidate.bounds[i];
    const double none = type->parameters[i].none;
    std::vector<double> values;
    if (b.minimum >= b.maximum) {
      values = {b.minimum};
    } else if (i > 0 || std::isnan(none)) {
      for (const double c : {0.15, 0.5, 0.85}) values.push_back(candidate.from_coordinate(i, c));
      if (i > 0 && !std::isnan(none)) values.push_back(std::clamp(none, b.minimum, b.maximum));
    } else if (candidate.family == "stuck") {  // a time: its loss has a narrow valley
      for (int k = 0; k < 12; ++k) values.push_back(candidate.from_coordinate(i, (k + 0.5) / 12));
    } else if (candidate.logarithmic(i) || std::isinf(none)) {
      for (const double c : {0.1, 0.3, 0.5, 0.7, 0.9}) values.push_back(candidate.from_coordinate(i, c));
    } else {
      for (const double share : {0.06, 0.25, 0.7}) {
        if (b.minimum < none) values.push_back(none + share * (b.minimum - none));
        if (b.maximum > none) values.push_back(none + share * (b.maximum - none));
      }
    }
    std::vector<std::vector<double>> grown;
    for (const auto& point : points)
      for (const double value : values) {
        grown.push_back(point);
        grown.back().push_back(value);
      }
    points = std::move(grown);
  }
  return points;
}

Eigen::VectorXd deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                           const std::vector<double>& parameters) {
  Eigen::VectorXd z(static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i) {
    const Parameter& p = sheet.parameters[free[i]];
    z[static_cast<Eigen::Index>(i)] = (parameters[free[i]] - p.nominal) / (p.nominal * p.tolerance);
  }
  return z;
}

Linearisation::Linearisation(const ResidualModel& residuals, const GapModel& model, std::vector<std::size_t> runs,
                             int jobs)
    : residuals_(residuals), runs_(std::move(runs)) {
  const Datasheet& sheet = residuals.sheet();
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].tolerance > 0) free_.push_back(i);
  at_model_ = residuals_of(residuals, model, runs_);
  columns_.resize(free_.size());
  starts_.resize(runs_.size());
  parallel(free_.size() + runs_.size(), jobs, [&](std::size_t i) {
    if (i >= free_.size()) {
      starts_[i - free_.size()] = residuals.start_sensitivity(model, runs_[i - free_.size()]);
      return;
    }
    const Parameter& p = sheet.parameters[free_[i]];
    GapModel moved = model;
    const double unit = p.nominal * p.tolerance;
    const double z = (model.parameters[free_[i]] - p.nominal) / unit;
    const double step = z > 0 ? -kStep : kStep;
    moved.parameters[free_[i]] = model.parameters[free_[i]] + step * unit;
    columns_[i] = difference(residuals_of(residuals, moved, runs_), at_model_, step);
  });
  prepare();
}

void Linearisation::prepare() {
  inverse_.resize(runs_.size());
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto& s = starts_[r];
    const auto n = static_cast<Eigen::Index>(s.size());
    for (std::size_t g = 0; g < residuals_.runs()[runs_[r]].segments(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
      for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j <= i; ++j) {
          const double sum =
              static_cast<double>(s[static_cast<std::size_t>(i)]
                                      .middleRows(first, length)
                                      .cwiseProduct(s[static_cast<std::size_t>(j)].middleRows(first, length))
                                      .sum());
          information(i, j) += sum;
          if (i != j) information(j, i) += sum;
        }
      inverse_[r].push_back(information.inverse());
    }
  }
  weights_.clear();
  const double count = static_cast<double>(residuals_.segment() * residuals_.outputs().size());
  for (const double loss : segment_losses(at_model_)) weights_.push_back(1 / std::max(1.0, 2 * loss / count));
  cross_.assign(runs_.size(), {});
  const auto parameters = static_cast<Eigen::Index>(columns_.size());
  for (std::size_t r = 0; r < runs_.size(); ++r)
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      Eigen::MatrixXd cross(static_cast<Eigen::Index>(starts_[r].size()), parameters);
      for (Eigen::Index i = 0; i < cross.rows(); ++i)
        for (Eigen::Index j = 0; j < parameters; ++j)
          cross(i, j) =
              static_cast<double>(starts_[r][static_cast<std::size_t>(i)]
                                      .middleRows(first, length)
                                      .cwiseProduct(columns_[static_cast<std::size_t>(j)][r].middleRows(first, length))
                                      .sum());
      cross_[r].push_back(cross);
    }
  std::vector<const std::vector<Eigen::MatrixXf>*> all;
  for (const auto& column : columns_) all.push_back(&column);
  parameter_gram_ = gram(all);
}

Linearisation Linearisation::subset(const std::vector<std::size_t>& positions) const {
  Linearisation part(residuals_);
  part.free_ = free_;
  part.columns_.resize(columns_.size());
  for (const std::size_t i : positions) {
    part.runs_.push_back(runs_[i]);
    part.at_model_.push_back(at_model_[i]);
    part.starts_.push_back(starts_[i]);
    for (std::size_t c = 0; c < columns_.size(); ++c) part.columns_[c].push_back(columns_[c][i]);
  }
  part.prepare();
  return part;
}

double Linearisation::square(const std::vector<Eigen::MatrixXf>& residuals, Eigen::VectorXd& against_parameters) const {
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  const auto parameters = static_cast<Eigen::Index>(columns_.size());
  against_parameters.setZero(parameters);
  double total = 0;
  auto weight = weights_.begin();
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto n = static_cast<Eigen::Index>(starts_[r].size());
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      const auto part = residuals[r].middleRows(first, length);
      Eigen::VectorXd against(n);
      for (Eigen::Index i = 0; i < n; ++i)
        against[i] = static_cast<double>(
            starts_[r][static_cast<std::size_t>(i)].middleRows(first, length).cwiseProduct(part).sum());
      const Eigen::VectorXd solved = inverse_[r][g] * against;
      const double w = *weight++;
      total += w * (static_cast<double>(part.squaredNorm()) - against.dot(solved));
      for (Eigen::Index j = 0; j < parameters; ++j)
        against_parameters[j] +=
            w * static_cast<double>(
                    columns_[static_cast<std::size_t>(j)][r].middleRows(first, length).cwiseProduct(part).sum());
      against_parameters -= w * cross_[r][g].transpose() * solved;
    }
  }
  return total;
}

double Linearisation::values() const {
  double count = 0;
  for (std::size_t r = 0; r < runs_.size(); ++r)
    count += static_cast<double>(inverse_[r].size() * residuals_.segment() * residuals_.outputs().size());
  return count;
}

std::vector<double> Linearisation::segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const {
  std::vector<double> losses;
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto n = static_cast<Eigen::Index>(starts_[r].size());
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto part = residuals[r].middleRows(static_cast<Eigen::Index>(g) * length, length);
      Eigen::VectorXd against(n);
      for (Eigen::Index i = 0; i < n; ++i)
        against[i] = static_cast<double>(starts_[r][static_cast<std::size_t>(i)]
                                             .middleRows(static_cast<Eigen::Index>(g) * length, length)
                                             .cwiseProduct(part)
                                             .sum());
      losses.push_back(0.5 * (static_cast<double>(part.squaredNorm()) - against.dot(inverse_[r][g] * against)));
    }
  }
  return losses;
}

Eigen::MatrixXd Linearisation::gram(const std::vector<const std::vector<Eigen::MatrixXf>*>& columns) const {
  const auto n = static_cast<Eigen::Index>(columns.size());
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  const auto outputs = static_cast<Eigen::Index>(residuals_.outputs().size());
  auto weight = weights_.begin();
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto shown = static_cast<Eigen::Index>(starts_[r].size());
    Eigen::MatrixXf stacked(length * outputs, n + shown);
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      for (Eigen::Index i = 0; i < n + shown; ++i) {
        const Eigen::MatrixXf& column =
            i < n ? (*columns[static_cast<std::size_t>(i)])[r] : starts_[r][static_cast<std::size_t>(i - n)];
        for (Eigen::Index o = 0; o < outputs; ++o)
          stacked.col(i).segment(o * length, length) = column.col(o).segment(first, length);
      }
      const Eigen::MatrixXd all = (stacked.transpose() * stacked).cast<double>();
      const auto cross = all.bottomLeftCorner(shown, n);
      total += *weight++ * (all.topLeftCorner(n, n) - cross.transpose() * inverse_[r][g] * cross);
    }
  }
  return total;
}

double projected_loss(const Linearisation& linear, const std::vector<Eigen::MatrixXf>& residuals,
                      const Eigen::VectorXd& z) {
  Eigen::VectorXd gradient;
  const double square = linear.square(residuals, gradient);
  Eigen::MatrixXd hessian = linear.parameter_gram();
  hessian.diagonal().array() += 1;
  gradient += z;
  const Eigen::VectorXd move = -hessian.ldlt().solve(gradient);
  return 0.5 * square + 0.5 * z.squaredNorm() + 0.5 * gradient.dot(move);
}

FitResult fit_gap(const ResidualModel& residuals, const GapModel& start, const std::vector<Candidate>& effects,
                  const Linearisation& linear, int iterations) {
  const Datasheet& sheet = residuals.sheet();
  const std::vector<std::size_t>& free = linear.free_parameters();
  const auto parameters = static_cast<Eigen::Index>(free.size());

  // Coordinates of the effects' free parameters: (effect, parameter).
  std::vector<std::pair<std::size_t, std::size_t>> coordinates;
  for (std::size_t e = 0; e < effects.size(); ++e)
    for (std::size_t p = 0; p < effects[e].bounds.size(); ++p)
      if (effects[e].bounds[p].minimum < effects[e].bounds[p].maximum) coordinates.emplace_back(e, p);
  const auto extra = static_cast<Eigen::Index>(coordinates.size());

  FitResult result;
  result.model = start;
  result.effects = effects;
  const auto with_effects = [&](const std::vector<Candidate>& list, const std::vector<double>& values) {
    GapModel model;
    model.parameters = values;
    for (const Candidate& candidate : list) model.effects.push_back(candidate.effect);
    return model;
  };
  const auto loss_of = [&](const std::vector<Eigen::MatrixXf>& r, const std::vector<double>& values) {
    double sum = 0;
    const std::vector<double> losses = linear.segment_losses(r);
    for (std::size_t i = 0; i < losses.size(); ++i) sum += linear.weight(i) * losses[i];
    return sum + 0.5 * deviations(sheet, free, values).squaredNorm();
  };

  result.model = with_effects(result.effects, start.parameters);
  std::vector<Eigen::MatrixXf> now = residuals_of(residuals, result.model, linear.runs());
  result.loss = loss_of(now, result.model.parameters);
  double damping = 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<std::vector<Eigen::MatrixXf>> effect_columns(coordinates.size());
    for (std::size_t i = 0; i < coordinates.size(); ++i) {
      std::vector<Candidate> moved = result.effects;
      auto& [e, p] = coordinates[i];
      const double c = moved[e].to_coordinate(p, moved[e].effect.parameters[p]);
      const double step = c > 0.5 ? -kEffectStep : kEffectStep;
      moved[e].effect.parameters[p] = moved[e].from_coordinate(p, c + step);
      effect_columns[i] =
          difference(residuals_of(residuals, with_effects(moved, result.model.parameters), linear.runs()), now, step);
    }
    std::vector<const std::vector<Eigen::MatrixXf>*> columns = {&now};
    for (const auto& column : linear.parameter_columns()) columns.push_back(&column);
    for (const auto& column : effect_columns) columns.push_back(&column);
    const Eigen::MatrixXd gram = linear.gram(columns);
    const Eigen::Index n = parameters + extra;
    Eigen::MatrixXd hessian = gram.bottomRightCorner(n, n);
    hessian.topLeftCorner(parameters, parameters).diagonal().array() += 1;
    hessian.bottomRightCorner(extra, extra).diagonal().array() += 1e-6 + 1;  // a coordinate is known to about its range
    Eigen::VectorXd gradient = gram.bottomLeftCorner(n, 1);
    gradient.head(parameters) += deviations(sheet, free, result.model.parameters);
    result.covariance = hessian.inverse();

    bool better = false;
    for (int attempt = 0; attempt < 5 && !better; ++attempt) {
      Eigen::MatrixXd damped = hessian;
      damped.diagonal() *= 1 + damping;
      Eigen::VectorXd move = -damped.ldlt().solve(gradient);
      // An effect's coordinate moves at most a third of its range at once.
      for (Eigen::Index i = 0; i < extra; ++i) move[parameters + i] = std::clamp(move[parameters + i], -0.34, 0.34);
      std::vector<double> values = result.model.parameters;
      shift_parameters(sheet, free, move.head(parameters), values);
      std::vector<Candidate> moved = result.effects;
      for (std::size_t i = 0; i < coordinates.size(); ++i) {
        auto& [e, p] = coordinates[i];
        const double c = moved[e].to_coordinate(p, moved[e].effect.parameters[p]);
        moved[e].effect.parameters[p] =
            moved[e].from_coordinate(p, c + move[parameters + static_cast<Eigen::Index>(i)]);
      }
      const GapModel model = with_effects(moved, values);
      std::vector<Eigen::MatrixXf> tried = residuals_of(residuals, model, linear.runs());
      const double loss = loss_of(tried, values);
      if (loss < result.loss) {
        const double gain = result.loss - loss;
        result.model = model;
        result.effects = moved;
        result.loss = loss;
        now = std::move(tried);
        damping *= 0.2;
        better = true;
        if (gain < 0.5 && iteration > 0) return result;
      } else {
        damping = std::max(0.1, damping * 8);
      }
    }
    if (!better) break;
  }
  return result;
}

}  // namespace faultline
