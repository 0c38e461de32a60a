#include "faultline/estimators/stretch_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/estimators/estimate.h"
#include "faultline/segments/segment_length.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSegmentFraction = 0.4;  // of the rig's segment: effects are looked for while they last
constexpr double kEveryStretches = 4;     // between the beginnings of stretches: bounds the effort
constexpr std::size_t kStartsKept = 4;    // motions to borrow the start states' part from

std::vector<double> scaled(const EffectSpec& listed, double amplitude) {
  const EffectType& type = *find_effect_type(listed.effect);
  std::vector<double> values = listed.parameters;
  for (std::size_t p = 0; p < values.size(); ++p)
    if (!std::isnan(type.parameters[p].none)) values[p] = effect_size(type.parameters[p].none, values[p], amplitude);
  return values;
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
  s.recent_stretches = count("recent", s.recent_stretches, 1, 1000);
  s.memory_stretches = settings.number_or("memory", s.memory_stretches, 1, 1e6);
  s.inflation_variances = settings.number_or("inflation", s.inflation_variances, 1, 1e6);
  s.threshold_evidence = settings.number_or("threshold", s.threshold_evidence, 1e-6, 1e9);
  return s;
}

ResponseSums::ResponseSums(Eigen::Index t, Eigen::Index d)
    : tt(Eigen::MatrixXd::Zero(t, t)),
      td(Eigen::MatrixXd::Zero(t, d)),
      dd(Eigen::MatrixXd::Zero(d, d)),
      tr(Eigen::VectorXd::Zero(t)),
      dr(Eigen::VectorXd::Zero(d)) {}

void ResponseSums::scale(double factor) {
  tt *= factor;
  td *= factor;
  dd *= factor;
  tr *= factor;
  dr *= factor;
  rr *= factor;
}

void ResponseSums::add(const ResponseSums& other) {
  tt += other.tt;
  td += other.td;
  dd += other.dd;
  tr += other.tr;
  dr += other.dr;
  rr += other.rr;
}

void ResponsePrior::add(const ResponseSums& sums) {
  information += sums.tt;
  pull += sums.tr;
  constant += sums.rr;
}

Eigen::VectorXd ResponsePrior::theta() const { return -Eigen::LDLT<Eigen::MatrixXd>(information).solve(pull); }

double ResponsePrior::loss() const { return constant + pull.dot(theta()); }

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
  const auto rows = static_cast<Eigen::Index>(segment_rows_);
  const auto terms = std::min(rows, static_cast<Eigen::Index>(settings.smooth_terms));
  cosines_.resize(terms, rows);
  for (Eigen::Index k = 0; k < terms; ++k)
    for (Eigen::Index i = 0; i < rows; ++i)
      cosines_(k, i) =
          std::sqrt((k > 0 ? 2.0 : 1.0) / static_cast<double>(rows)) *
          std::cos(kPi * static_cast<double>(k) * (static_cast<double>(i) + 0.5) / static_cast<double>(rows));
}

ResponseSums StretchModel::no_sums() const {
  return ResponseSums(static_cast<Eigen::Index>(free_.size() + nuisance_.size()),
                      static_cast<Eigen::Index>(hypotheses_.size()));
}

ModelPoint StretchModel::nominal() const {
  return {Eigen::VectorXd::Zero(static_cast<Eigen::Index>(free_.size() + nuisance_.size())), sheet_.nominal(), {}};
}

ModelPoint StretchModel::at(const Eigen::VectorXd& shift) const {
  ModelPoint point{shift, sheet_.nominal(), {}};
  for (std::size_t i = 0; i < free_.size(); ++i)
    point.parameters[free_[i]] *= 1 + shift[static_cast<Eigen::Index>(i)] * sheet_.parameters[free_[i]].tolerance;
  return point;
}

ResponsePrior StretchModel::tolerances(const ModelPoint& point) const {
  const Eigen::Index t = point.shift.size();
  return {Eigen::MatrixXd::Identity(t, t), point.shift, point.shift.squaredNorm()};
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
  const ResponseSums sums = no_sums();
  auto stretch = std::make_unique<Stretch>(sums.tt.rows(), sums.dd.rows());
  stretch->begin = recording.time.front();
  stretch->run = cut_run(sheet_, "", recording, settings_.segment_s, settings_.segment, Inputs::as_measured);
  stretch->run.lead = 1;
  model_.place_starts(stretch->run, sigma_, model_.nominal());
  return stretch;
}

double StretchModel::segment_values() const { return static_cast<double>(segment_rows_ * model_.outputs().size()); }

StretchModel::Starts StretchModel::starts_at(const ModelChange& base, const SegmentedRun& run) const {
  std::vector<Eigen::MatrixXf> columns = model_.start_columns(base, run, sigma_);
  runs_ += columns.size() + 1;
  return std::make_shared<const StartProjection>(run, std::move(columns), segment_values());
}

std::vector<LinearSegment> StretchModel::linear(const Stretch& stretch, const ModelPoint& point,
                                                const std::vector<Direction>& directions) const {
  runs_ += directions.size() + 1;
  return linearise(model_, stretch.run, *stretch.starts, sigma_, {point.parameters, point.effects}, directions,
                   settings_.jobs);
}

double StretchModel::weight_of(const Eigen::VectorXd& residuals) const {
  const double mean_square = residuals.squaredNorm() / static_cast<double>(residuals.size());
  return 1 / (settings_.inflation_variances * std::max(1.0, mean_square));
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
  stretch.sums = no_sums();
  stretch.segments.clear();
  for (std::size_t s = 1; s < linear.size(); ++s) {
    SegmentResponse segment;
    segment.residuals = std::move(linear[s].residual);
    segment.tolerances = std::move(linear[s].columns);
    segment.weight = weight_of(segment.residuals);
    segment.information.noalias() = segment.weight * segment.tolerances.transpose() * segment.tolerances;
    stretch.sums.tt += segment.information;
    stretch.sums.tr.noalias() += segment.weight * segment.tolerances.transpose() * segment.residuals;
    stretch.sums.rr += segment.weight * segment.residuals.squaredNorm();
    stretch.segments.push_back(std::move(segment));
  }
  stretch.responded = true;
  stretch.weighed = false;
}

void StretchModel::weigh(Stretch& stretch, const ModelPoint& point) const {
  std::vector<Direction> directions;
  for (const FaultHypothesis& h : hypotheses_) {
    directions.push_back({{point.parameters, point.effects}, h.probe});
    directions.back().to.effects.push_back(h.at(h.probe));
  }
  const std::vector<LinearSegment> linear = this->linear(stretch, point, directions);
  for (std::size_t s = 0; s < stretch.segments.size(); ++s) {
    const SegmentResponse& segment = stretch.segments[s];
    const Eigen::MatrixXd& responses = linear[s + 1].columns;
    stretch.sums.td.noalias() += segment.weight * segment.tolerances.transpose() * responses;
    stretch.sums.dd.noalias() += segment.weight * responses.transpose() * responses;
    stretch.sums.dr.noalias() += segment.weight * responses.transpose() * segment.residuals;
  }
  stretch.weighed = true;
}

double StretchModel::loss(const ResponsePrior& prior, const Stretches& stretches, const ModelPoint& point,
                          const std::vector<EffectSpec>& effects, double limit, ResponsePrior* after) const {
  ResponsePrior sum = prior;
  ModelChange change{point.parameters, point.effects};
  change.effects.insert(change.effects.end(), effects.begin(), effects.end());
  bool beyond = false;
  for (const Stretch* stretch : stretches) {
    std::size_t next = 0;
    model_.residuals(change, stretch->run, sigma_, [&](std::size_t row, const Eigen::MatrixXf& residuals) {
      if (row + 1 < stretch->run.restarts[next + 1] + segment_rows_) return false;
      const SegmentResponse& segment = stretch->segments[next];
      const Eigen::VectorXd r = stretch->starts->residual(stretch->run, residuals, next + 1);
      sum.pull.noalias() += segment.weight * segment.tolerances.transpose() * r;
      sum.constant += segment.weight * r.squaredNorm();
      sum.information += segment.information;
      beyond = sum.constant > limit && sum.loss() > limit;
      return beyond || ++next == stretch->segments.size();
    });
    ++runs_;
    if (beyond) return kInfinity;
  }
  const double result = sum.loss();
  if (after != nullptr) *after = std::move(sum);
  return result > limit ? kInfinity : result;
}

double StretchModel::loss(const ResponsePrior& prior, const Stretches& stretches) {
  ResponsePrior sum = prior;
  for (const Stretch* stretch : stretches) sum.add(stretch->sums);
  return sum.loss();
}

// ---- misfit

double StretchModel::noise_misfit() const {
  return static_cast<double>(settings_.segments * model_.outputs().size()) * static_cast<double>(cosines_.rows()) /
         settings_.inflation_variances;
}

double StretchModel::smooth_square(const Eigen::VectorXd& residuals) const {
  const auto outputs = static_cast<Eigen::Index>(model_.outputs().size());
  const Eigen::Map<const Eigen::MatrixXd> by_output(residuals.data(), cosines_.cols(), outputs);
  return (cosines_ * by_output).squaredNorm();
}

double StretchModel::misfit(const Stretch& stretch, const Eigen::MatrixXf& residuals,
                            const StartProjection& starts) const {
  double sum = 0;
  for (std::size_t s = 1; s < stretch.run.segments(); ++s) {
    const Eigen::VectorXd left = starts.residual(stretch.run, residuals, s);
    sum += weight_of(left) * smooth_square(left);
  }
  return sum;
}

double StretchModel::misfit(const Stretch& stretch, const ModelPoint& known, double enough) {
  const Eigen::MatrixXf whole = model_.residuals({known.parameters, known.effects}, stretch.run, sigma_);
  ++runs_;
  for (const Starts& starts : lately_) {
    if (!starts->fits(stretch.run)) continue;
    const double borrowed = misfit(stretch, whole, *starts);
    if (borrowed <= enough) return borrowed;
  }
  // Without effects: they hardly change what a start state does, and runs with them cost more.
  Starts own = stretch.responded ? stretch.starts : starts_at({known.parameters, {}}, stretch.run);
  const double result = misfit(stretch, whole, *own);
  lately_.push_front(std::move(own));
  if (lately_.size() > kStartsKept) lately_.pop_back();
  return result;
}

double StretchModel::misfit(const Stretch& stretch, const Eigen::VectorXd& theta) const {
  double sum = 0;
  for (const SegmentResponse& segment : stretch.segments) {
    const Eigen::VectorXd left = segment.residuals + segment.tolerances * theta;
    sum += weight_of(left) * smooth_square(left);
  }
  return sum;
}

}  // namespace faultline
