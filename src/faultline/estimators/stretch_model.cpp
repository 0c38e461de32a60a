#include "faultline/estimators/stretch_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/estimators/estimate.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::size_t kStartsKept = 4;  // motions to borrow the start states' part from

std::vector<double> scaled(const EffectSpec& listed, double amplitude) {
  const EffectType& type = *find_effect_type(listed.effect);
  std::vector<double> values = listed.parameters;
  for (std::size_t p = 0; p < values.size(); ++p)
    if (!std::isnan(type.parameters[p].none)) values[p] = effect_size(type.parameters[p].none, values[p], amplitude);
  return values;
}

}  // namespace

ResponseSettings read_response_settings(const Settings& settings, double period) {
  ResponseSettings s;
  const auto count = [&](const char* key, std::size_t usual, double least, double most) {
    return static_cast<std::size_t>(settings.number_or(key, static_cast<double>(usual), least, most));
  };
  s.segment_samples = count("segment", s.segment_samples, 20, 1e5);
  s.segments = count("segments", s.segments, 1, 1000);
  s.every_s = settings.number_or("every", s.every_s, period, 1e6);
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
      model_(sheet, settings.segment_samples, settings.segment),
      hypotheses_(fault_hypotheses(sheet, settings.hypotheses)) {
  for (std::size_t i = 0; i < sheet_.parameters.size(); ++i)
    if (sheet_.parameters[i].tolerance > 0 && sheet_.parameters[i].nominal != 0) free_.push_back(i);
  for (const std::string& text : sheet_.nuisance) nuisance_.push_back(parse_effect(text));
  const auto rows = static_cast<Eigen::Index>(settings.segment_samples) - 1;
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
  stretch->run = model_.prepare("", recording);
  return stretch;
}

StretchModel::Starts StretchModel::by_segment(const std::vector<Eigen::MatrixXf>& columns,
                                              const SegmentedRun& run) const {
  Starts starts;
  for (std::size_t s = 1; s < run.restarts.size(); ++s) {
    Eigen::MatrixXd start;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const Eigen::VectorXd column = model_.stacked(columns[i], run.restarts[s]);
      if (i == 0) start.resize(column.size(), static_cast<Eigen::Index>(columns.size()));
      start.col(static_cast<Eigen::Index>(i)) = column;
    }
    starts.push_back(std::move(start));
  }
  return starts;
}

StretchModel::Starts StretchModel::start_columns(const ModelChange& base, const SegmentedRun& run) const {
  const std::vector<Eigen::MatrixXf> columns = model_.start_columns(base, run, model_.noise());
  runs_ += 2 * columns.size();
  return by_segment(columns, run);
}

// One-sided differences, without effects: half the runs, and cheaper ones.
StretchModel::Starts StretchModel::rough_start_columns(const ModelChange& base, const SegmentedRun& run) const {
  const std::size_t states = sheet_.states.size();
  const Eigen::MatrixXf from = model_.residuals(base, run, model_.noise());
  std::vector<Eigen::MatrixXf> columns;
  SegmentedRun moved = run;
  for (std::size_t state = 0; state < states; ++state) {
    if (std::isnan(run.starts[state])) continue;
    moved.starts = run.starts;
    for (std::size_t i = state; i < moved.starts.size(); i += states) moved.starts[i] += run.start_errors[i];
    columns.push_back(model_.residuals(base, moved, model_.noise()) - from);
  }
  runs_ += columns.size() + 1;
  return by_segment(columns, run);
}

double StretchModel::weight_of(const Eigen::VectorXd& residuals) const {
  const double mean_square = residuals.squaredNorm() / static_cast<double>(residuals.size());
  return 1 / (settings_.inflation_variances * std::max(1.0, mean_square));
}

void StretchModel::respond(Stretch& stretch, const ModelPoint& point) const {
  const std::vector<double>& sigma = model_.noise();
  const ModelChange base{point.parameters, point.effects};
  std::vector<ModelChange> changes = {base};
  std::vector<double> steps = {1};
  for (const std::size_t i : free_) {
    changes.push_back(base);
    changes.back().parameters[i] +=
        settings_.parameter_difference_tolerances * sheet_.parameters[i].tolerance * sheet_.parameters[i].nominal;
    steps.push_back(settings_.parameter_difference_tolerances);
  }
  for (const EffectSpec& effect : nuisance_) {
    changes.push_back(base);
    changes.back().effects.push_back(effect);
    steps.push_back(1);
  }
  std::vector<Eigen::MatrixXf> residuals(changes.size());
  in_parallel(changes.size(), settings_.jobs,
              [&](std::size_t i) { residuals[i] = model_.residuals(changes[i], stretch.run, sigma); });
  runs_ += changes.size();
  for (std::size_t i = 1; i < residuals.size(); ++i)
    residuals[i] = (residuals[i] - residuals[0]) * static_cast<float>(1 / steps[i]);
  Starts starts = start_columns(base, stretch.run);
  stretch.sums = no_sums();
  stretch.segments.clear();
  for (std::size_t s = 0; s < starts.size(); ++s) {
    const std::size_t row = stretch.run.restarts[s + 1];
    Eigen::MatrixXd all(starts[s].rows(), static_cast<Eigen::Index>(residuals.size()));
    for (std::size_t i = 0; i < residuals.size(); ++i)
      all.col(static_cast<Eigen::Index>(i)) = model_.stacked(residuals[i], row);
    SegmentModel::project(starts[s], all);
    SegmentResponse segment;
    segment.starts = std::move(starts[s]);
    segment.residuals = all.col(0);
    segment.tolerances = all.rightCols(all.cols() - 1);
    segment.weight = weight_of(segment.residuals);
    segment.information.noalias() = segment.weight * segment.tolerances.transpose() * segment.tolerances;
    stretch.sums.tt += segment.information;
    stretch.sums.tr.noalias() += segment.weight * segment.tolerances.transpose() * segment.residuals;
    stretch.sums.rr += segment.weight * segment.residuals.squaredNorm();
    stretch.segments.push_back(std::move(segment));
  }
  stretch.base = std::move(residuals[0]);
  stretch.responded = true;
  stretch.weighed = false;
}

void StretchModel::weigh(Stretch& stretch, const ModelPoint& point) const {
  std::vector<Eigen::MatrixXf> residuals(hypotheses_.size());
  in_parallel(hypotheses_.size(), settings_.jobs, [&](std::size_t i) {
    const FaultHypothesis& h = hypotheses_[i];
    ModelChange change{point.parameters, point.effects};
    change.effects.push_back(h.at(h.probe));
    residuals[i] =
        (model_.residuals(change, stretch.run, model_.noise()) - stretch.base) * static_cast<float>(1 / h.probe);
  });
  runs_ += hypotheses_.size();
  for (std::size_t s = 0; s < stretch.segments.size(); ++s) {
    const SegmentResponse& segment = stretch.segments[s];
    Eigen::MatrixXd all(segment.residuals.size(), static_cast<Eigen::Index>(residuals.size()));
    for (std::size_t i = 0; i < residuals.size(); ++i)
      all.col(static_cast<Eigen::Index>(i)) = model_.stacked(residuals[i], stretch.run.restarts[s + 1]);
    SegmentModel::project(segment.starts, all);
    stretch.sums.td.noalias() += segment.weight * segment.tolerances.transpose() * all;
    stretch.sums.dd.noalias() += segment.weight * all.transpose() * all;
    stretch.sums.dr.noalias() += segment.weight * all.transpose() * segment.residuals;
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
    model_.residuals(change, stretch->run, model_.noise(), [&](std::size_t row, const Eigen::MatrixXf& residuals) {
      if (row + 1 < stretch->run.restarts[next + 1] + model_.segment()) return false;
      const SegmentResponse& segment = stretch->segments[next];
      Eigen::MatrixXd r = model_.stacked(residuals, stretch->run.restarts[next + 1]);
      SegmentModel::project(segment.starts, r);
      sum.pull.noalias() += segment.weight * segment.tolerances.transpose() * r.col(0);
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

double StretchModel::misfit(const std::vector<Eigen::VectorXd>& residuals, const Starts& starts) const {
  double sum = 0;
  for (std::size_t s = 0; s < residuals.size(); ++s) {
    Eigen::MatrixXd r = residuals[s];
    SegmentModel::project(starts[s], r);
    const Eigen::VectorXd left = r.col(0);
    sum += weight_of(left) * smooth_square(left);
  }
  return sum;
}

double StretchModel::misfit(const Stretch& stretch, const ModelPoint& known, double enough) {
  const ModelChange change{known.parameters, known.effects};
  const Eigen::MatrixXf whole = model_.residuals(change, stretch.run, model_.noise());
  ++runs_;
  std::vector<Eigen::VectorXd> residuals;
  for (std::size_t s = 1; s < stretch.run.restarts.size(); ++s)
    residuals.push_back(model_.stacked(whole, stretch.run.restarts[s]));
  for (const Starts& starts : lately_) {
    const double borrowed = misfit(residuals, starts);
    if (borrowed <= enough) return borrowed;
  }
  Starts own;
  if (stretch.responded)
    for (const SegmentResponse& segment : stretch.segments) own.push_back(segment.starts);
  else
    own = rough_start_columns({known.parameters, {}}, stretch.run);
  const double result = misfit(residuals, own);
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
