#include "faultline/estimators/stretch_model.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/screening.h"
#include "faultline/estimators/estimate.h"
#include "faultline/rig/parameter_range.h"
#include "faultline/segments/segment_length.h"

namespace faultline {
namespace {

constexpr double kSegmentFraction = 0.4;  // of the rig's segment: effects are looked for while they last
constexpr double kEveryStretches = 4;     // between the beginnings of stretches: bounds the effort
constexpr double kLeastNoise = 0.9;       // of its mean square, in the residuals of a segment: chi-squared scatters
constexpr double kUniform = 0.57735;      // standard deviation of what may be anything up to 1 either way
constexpr double kPi = 3.14159265358979323846;

// A segment's [r T]'[r T], for residuals r of any model.
void add(const SegmentResponse& segment, const Eigen::VectorXd& residuals, Eigen::MatrixXd& sums) {
  const Eigen::Index n = segment.tolerances.cols();
  const Eigen::VectorXd pull = segment.weight * segment.tolerances.transpose() * residuals;
  sums(0, 0) += segment.weight * residuals.squaredNorm();
  sums.block(1, 0, n, 1) += pull;
  sums.block(0, 1, 1, n) += pull.transpose();
  sums.block(1, 1, n, n) += segment.information;
}

}  // namespace

ResponseSettings read_response_settings(const Settings& settings, const Datasheet& sheet) {
  ResponseSettings s;
  const double period = sheet.sample_period;
  const auto count = [&](const char* key, std::size_t usual, double least, double most) {
    return static_cast<std::size_t>(settings.number_or(key, static_cast<double>(usual), least, most));
  };
  s.segment_s = settings.has("segment") ? settings.number("segment", 4 * period, 1e6)
                                        : std::max(4 * period, kSegmentFraction * segment_length(sheet));
  s.segments = count("segments", s.segments, 1, 1000);
  s.every_s = settings.number_or("every", kEveryStretches * s.stretch_s(), period, 1e7);
  s.early_every_s = settings.number_or("early_every", s.every_s, period, 1e7);
  s.recent_stretches = count("recent", s.recent_stretches, 1, 1000);
  s.memory_stretches = settings.number_or("memory", s.memory_stretches, 1, 1e6);
  s.inflation_variances = settings.number_or("inflation", s.inflation_variances, 1, 1e6);
  s.threshold_evidence = settings.number_or("threshold", s.threshold_evidence, 1e-6, 1e9);
  s.confirmed_fraction = settings.number_or("confirmed", s.confirmed_fraction, 0, 1e3);
  s.explained_ratio = settings.number_or("explained", s.explained_ratio, 0, 1e3);
  return s;
}

StretchModel::StretchModel(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet),
      settings_(settings),
      model_(sheet, settings.segment),
      segment_rows_(static_cast<std::size_t>(std::lround(settings.segment_s / sheet.sample_period))),
      sigma_(noise_of(sheet, settings.segment)),
      hypotheses_(fault_hypotheses(sheet, settings.hypotheses)) {
  for (std::size_t i = 0; i < sheet_.parameters.size(); ++i)
    if (sheet_.parameters[i].tolerance > 0 && sheet_.parameters[i].nominal != 0) free_.push_back(i);
  for (const std::string& text : sheet_.nuisance) nuisance_.push_back(parse_effect(text));
  for (const EffectSpec& effect : nuisance_)
    if (effect.effect == "hysteresis" && port_kind(effect.port) == PortKind::force)
      memories_.push_back({"load_force", effect.port, {0.5 * effect.parameters.front() * kUniform, 0}});
  const auto rows = static_cast<Eigen::Index>(segment_rows_);
  cosines_.resize(std::min(rows, static_cast<Eigen::Index>(settings_.smooth_terms)), rows);
  for (Eigen::Index k = 0; k < cosines_.rows(); ++k)
    for (Eigen::Index i = 0; i < rows; ++i)
      cosines_(k, i) =
          std::sqrt((k > 0 ? 2.0 : 1.0) / static_cast<double>(rows)) *
          std::cos(kPi * static_cast<double>(k) * (static_cast<double>(i) + 0.5) / static_cast<double>(rows));
}

Eigen::MatrixXd StretchModel::no_sums() const {
  const Eigen::Index n = 1 + parameters() + static_cast<Eigen::Index>(hypotheses_.size());
  return Eigen::MatrixXd::Zero(n, n);
}

ModelPoint StretchModel::nominal() const { return {Eigen::VectorXd::Zero(parameters()), sheet_.nominal(), {}}; }

ModelPoint StretchModel::at(const Eigen::VectorXd& shift) const {
  ModelPoint point{shift, sheet_.nominal(), {}};
  for (std::size_t i = 0; i < free_.size(); ++i) {
    const double tolerance = sheet_.parameters[free_[i]].tolerance;
    point.parameters[free_[i]] *=
        std::max(kLeastParameterFraction, 1 + shift[static_cast<Eigen::Index>(i)] * tolerance);
  }
  return point;
}

ModelPoint StretchModel::known(const ModelPoint& point, const Eigen::VectorXd& theta,
                               const std::vector<EffectSpec>& effects) const {
  const double farthest = settings_.farthest_tolerances;
  ModelPoint result = at((point.shift + theta).cwiseMax(-farthest).cwiseMin(farthest));
  for (std::size_t i = 0; i < nuisance_.size(); ++i) {
    const double amplitude = result.shift[static_cast<Eigen::Index>(free_.size() + i)];
    if (!(amplitude > settings_.least_nuisance_amplitude)) continue;
    EffectSpec effect = nuisance_[i];
    effect.parameters = scaled(effect, amplitude);
    result.effects.push_back(std::move(effect));
  }
  result.effects.insert(result.effects.end(), point.effects.begin(), point.effects.end());
  result.effects.insert(result.effects.end(), effects.begin(), effects.end());
  return result;
}

// ---- responses

std::unique_ptr<Stretch> StretchModel::prepare(const Recording& recording) const {
  auto stretch = std::make_unique<Stretch>();
  stretch->begin = recording.time.front();
  stretch->sums = no_sums();
  stretch->run = cut_run(sheet_, "", recording, settings_.segment_s, settings_.segment, Inputs::as_measured);
  stretch->run.lead = 1;
  model_.place_starts(stretch->run, sigma_, model_.nominal());
  return stretch;
}

double StretchModel::segment_values() const { return static_cast<double>(segment_rows_ * model_.outputs().size()); }

std::shared_ptr<const StartProjection> StretchModel::starts_at(const ModelChange& base, const SegmentedRun& run) const {
  std::vector<ModelChange> memories;
  for (const EffectSpec& memory : memories_) {
    memories.push_back(base);
    memories.back().effects.push_back(memory);
  }
  std::vector<Eigen::MatrixXf> columns = model_.start_columns(base, run, sigma_, 1, memories);
  runs_ += columns.size() + 1;
  return std::make_shared<const StartProjection>(run, std::move(columns), segment_values());
}

std::vector<LinearSegment> StretchModel::linear(const Stretch& stretch, const ModelPoint& point,
                                                const std::vector<Direction>& directions) const {
  runs_ += directions.size() + 1;
  return linearise(model_, stretch.run, *stretch.starts, sigma_, {point.parameters, point.effects}, directions,
                   settings_.jobs);
}

double StretchModel::weight_of(const Eigen::VectorXd& residuals, double most) const {
  const double mean_square = residuals.squaredNorm() / static_cast<double>(residuals.size());
  return 1 / (settings_.inflation_variances * std::max(1.0, std::min(mean_square, most)));
}

void StretchModel::respond(Stretch& stretch, const ModelPoint& point) const {
  const ModelChange base{point.parameters, point.effects};
  std::vector<Direction> directions;
  for (const std::size_t i : free_) {
    const double step = settings_.parameter_difference_tolerances;
    directions.push_back({base, step});
    directions.back().to.parameters[i] += step * sheet_.parameters[i].tolerance * sheet_.parameters[i].nominal;
  }
  for (const EffectSpec& effect : nuisance_) {
    directions.push_back({base, 1});
    directions.back().to.effects.push_back(effect);
  }
  stretch.starts = starts_at(base, stretch.run);
  std::vector<LinearSegment> linear = this->linear(stretch, point, directions);
  stretch.segments.resize(linear.size() - 1);
  for (std::size_t s = 1; s < linear.size(); ++s) {
    stretch.segments[s - 1].tolerances = std::move(linear[s].columns);
    set_residuals(stretch.segments[s - 1], std::move(linear[s].residual));
  }
  stretch.tolerances_at = point.shift;
  stretch.responded = true;
  sum_up(stretch);
}

void StretchModel::follow(Stretch& stretch, const ModelPoint& point) const {
  if ((point.shift - stretch.tolerances_at).cwiseAbs().maxCoeff() > settings_.reused_tolerances) {
    respond(stretch, point);
    return;
  }
  const Eigen::MatrixXf now = residuals(stretch, point);
  for (std::size_t s = 0; s < stretch.segments.size(); ++s)
    set_residuals(stretch.segments[s], stretch.starts->residual(stretch.run, now, s + 1));
  sum_up(stretch);
}

void StretchModel::weigh(Stretch& stretch, const ModelPoint& point) const {
  if (stretch.weighed && (point.shift - stretch.faults_at).cwiseAbs().maxCoeff() <= settings_.reused_tolerances) return;
  std::vector<Direction> directions;
  for (const FaultHypothesis& h : hypotheses_) {
    directions.push_back({{point.parameters, point.effects}, h.probe});
    directions.back().to.effects.push_back(h.at(h.probe));
  }
  std::vector<LinearSegment> linear = this->linear(stretch, point, directions);
  for (std::size_t s = 0; s < stretch.segments.size(); ++s)
    stretch.segments[s].faults = std::move(linear[s + 1].columns);
  stretch.faults_at = point.shift;
  stretch.weighed = true;
  sum_up(stretch);
}

double StretchModel::smooth_square(const Eigen::VectorXd& residuals) const {
  const Eigen::Map<const Eigen::MatrixXd> by_output(residuals.data(), cosines_.cols(),
                                                    static_cast<Eigen::Index>(outputs()));
  return (cosines_ * by_output).squaredNorm();
}

StretchModel::Left StretchModel::left_of(const Stretch& stretch, const Eigen::VectorXd& theta) const {
  Left left;
  double values = 0;
  for (const SegmentResponse& segment : stretch.segments) {
    const Eigen::VectorXd residuals = segment.residuals + segment.tolerances * theta;
    left.evidence += beyond_noise(residuals);
    left.mean_square += residuals.squaredNorm();
    values += static_cast<double>(residuals.size());
  }
  left.mean_square /= std::max(values, 1.0);
  return left;
}

double StretchModel::beyond_noise(const Eigen::VectorXd& residuals) const {
  const Eigen::Index terms = cosines_.rows(), rows = cosines_.cols();
  double beyond = 0;
  for (Eigen::Index o = 0; o < static_cast<Eigen::Index>(outputs()); ++o) {
    const auto output = residuals.segment(o * rows, rows);
    const double smooth = (cosines_ * output).squaredNorm();
    const double noise = (output.squaredNorm() - smooth) / static_cast<double>(std::max<Eigen::Index>(1, rows - terms));
    beyond += smooth - static_cast<double>(terms) * std::min(1.0, noise);
  }
  return weight_of(residuals) * beyond;
}

void StretchModel::set_residuals(SegmentResponse& segment, Eigen::VectorXd residuals) const {
  segment.residuals = std::move(residuals);
  segment.weight = weight_of(segment.residuals);
  segment.information.noalias() = segment.weight * segment.tolerances.transpose() * segment.tolerances;
  const double noise =
      kLeastNoise * static_cast<double>(outputs()) * static_cast<double>(cosines_.cols() - cosines_.rows());
  segment.floor = segment.weight * std::min(segment.residuals.squaredNorm() - smooth_square(segment.residuals), noise);
}

void StretchModel::sum_up(Stretch& stretch) const {
  stretch.sums = no_sums();
  const Eigen::Index known = 1 + parameters(), count = static_cast<Eigen::Index>(hypotheses_.size());
  auto across = stretch.sums.topRightCorner(known, count);
  for (const SegmentResponse& segment : stretch.segments) {
    add(segment, segment.residuals, stretch.sums);
    if (!stretch.weighed) continue;
    across.row(0).noalias() += segment.weight * segment.residuals.transpose() * segment.faults;
    across.bottomRows(parameters()).noalias() += segment.weight * segment.tolerances.transpose() * segment.faults;
    stretch.sums.bottomRightCorner(count, count)
        .selfadjointView<Eigen::Upper>()
        .rankUpdate(segment.faults.transpose(), segment.weight);
  }
  if (stretch.weighed)
    stretch.sums.bottomRightCorner(count, count).triangularView<Eigen::StrictlyLower>() =
        stretch.sums.bottomRightCorner(count, count).transpose().triangularView<Eigen::StrictlyLower>();
  stretch.sums.bottomLeftCorner(count, known) = across.transpose();
}

double StretchModel::loss(const Eigen::MatrixXd& prior, const Stretches& stretches, const ModelPoint& point,
                          const std::vector<EffectSpec>& effects, double limit, Eigen::MatrixXd* after,
                          const LossCourse* limits, LossCourse* course) const {
  Eigen::MatrixXd sum = prior;
  ModelChange change{point.parameters, point.effects};
  change.effects.insert(change.effects.end(), effects.begin(), effects.end());
  bool beyond = false;
  double rest = 0;  // that the segments to come add at least
  for (const Stretch* stretch : stretches)
    for (const SegmentResponse& segment : stretch->segments) rest += segment.floor;
  std::size_t done = 0;
  for (const Stretch* stretch : stretches) {
    std::size_t next = 0;
    model_.residuals(change, stretch->run, sigma_, [&](std::size_t row, const Eigen::MatrixXf& residuals) {
      if (row + 1 < stretch->run.restarts[next + 1] + segment_rows_) return false;
      add(stretch->segments[next], stretch->starts->residual(stretch->run, residuals, next + 1), sum);
      rest -= stretch->segments[next].floor;
      const double most = std::min(limit - rest, limits == nullptr ? kInfinity : (*limits)[done]);
      if (course != nullptr) course->push_back(least_loss(sum, parameters()));
      beyond = sum(0, 0) > most && least_loss(sum, parameters()) > most;
      ++done;
      return beyond || ++next == stretch->segments.size();
    });
    ++runs_;
    if (beyond) return kInfinity;
  }
  const double result = least_loss(sum, parameters());
  if (after != nullptr) *after = std::move(sum);
  return result > limit ? kInfinity : result;
}

double StretchModel::loss(Eigen::MatrixXd prior, const Stretches& stretches, LossCourse* course) const {
  for (const Stretch* stretch : stretches)
    for (const SegmentResponse& segment : stretch->segments) {
      add(segment, segment.residuals, prior);
      if (course != nullptr) course->push_back(least_loss(prior, parameters()));
    }
  return least_loss(prior, parameters());
}

Eigen::MatrixXf StretchModel::residuals(const Stretch& stretch, const ModelPoint& known) const {
  ++runs_;
  return model_.residuals({known.parameters, known.effects}, stretch.run, sigma_);
}

}  // namespace faultline
