#include "faultline/estimators/stretch_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>


namespace faultline {

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

StretchModel::StretchModel(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet),
      settings_(settings),
      model_(sheet, settings.segment),
      sigma_(noise_of(sheet, settings.segment)),
      hypotheses_(fault_hypotheses(sheet, settings.hypotheses)) {
  for (std::size_t i = 0; i < sheet_.parameters.size(); ++i)
    if (sheet_.parameters[i].tolerance > 0 && sheet_.parameters[i].nominal != 0) free_.push_back(i);
  for (const std::string& text : sheet_.nuisance) nuisance_.push_back(parse_effect(text));
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

std::unique_ptr<Stretch> StretchModel::respond(const Recording& recording, const ModelPoint& point) const {
  const Eigen::Index t = point.shift.size(), d = static_cast<Eigen::Index>(hypotheses_.size());
  auto stretch = std::make_unique<Stretch>(t, d);
  stretch->begin = recording.time.front();
  stretch->run = cut_run(sheet_, "", recording,
                         static_cast<double>(settings_.segment_samples) * sheet_.sample_period, settings_.segment);
  const ModelChange base{point.parameters, point.effects};
  model_.place_starts(stretch->run, sigma_, base);
  const auto with = [&](const EffectSpec& effect) {
    ModelChange change = base;
    change.effects.push_back(effect);
    return change;
  };
  std::vector<Direction> directions;
  for (const std::size_t i : free_) {
    directions.push_back({base, settings_.parameter_difference_tolerances});
    directions.back().to.parameters[i] +=
        settings_.parameter_difference_tolerances * sheet_.parameters[i].tolerance * sheet_.parameters[i].nominal;
  }
  for (const EffectSpec& effect : nuisance_) directions.push_back({with(effect), 1});
  for (const FaultHypothesis& h : hypotheses_) directions.push_back({with(h.at(h.probe)), h.probe});
  const double values = static_cast<double>(stretch->run.segment * model_.outputs().size());
  stretch->starts = std::make_unique<StartProjection>(stretch->run, model_.start_columns(base, stretch->run, sigma_), values);
  const std::vector<LinearSegment> linear =
      linearise(model_, stretch->run, *stretch->starts, sigma_, base, directions, settings_.jobs);
  for (std::size_t s = 1; s < linear.size(); ++s) {
    const Eigen::VectorXd& r = linear[s].residual;
    const double weight = 1 / (settings_.inflation_variances * std::max(1.0, r.squaredNorm() / values));
    const auto tolerances = linear[s].columns.leftCols(t), responses = linear[s].columns.rightCols(d);
    ResponseSums& sums = stretch->sums;
    sums.tt.noalias() += weight * tolerances.transpose() * tolerances;
    sums.td.noalias() += weight * tolerances.transpose() * responses;
    sums.dd.noalias() += weight * responses.transpose() * responses;
    sums.tr.noalias() += weight * tolerances.transpose() * r;
    sums.dr.noalias() += weight * responses.transpose() * r;
    sums.rr += weight * r.squaredNorm();
    stretch->tolerances.push_back(tolerances);
    stretch->weights.push_back(weight);
  }
  return stretch;
}

double StretchModel::loss(const ResponsePrior& prior, const Stretches& stretches, const ModelPoint& point,
                          const std::vector<EffectSpec>& effects) const {
  Eigen::MatrixXd tt = prior.information;
  Eigen::VectorXd tr = prior.pull;
  double rr = prior.constant;
  ModelChange change{point.parameters, point.effects};
  change.effects.insert(change.effects.end(), effects.begin(), effects.end());
  for (const Stretch* stretch : stretches) {
    const Eigen::MatrixXf residuals = model_.residuals(change, stretch->run, sigma_);
    for (std::size_t s = 0; s < stretch->weights.size(); ++s) {
      const Eigen::VectorXd r = stretch->starts->residual(stretch->run, residuals, s + 1);
      tr.noalias() += stretch->weights[s] * stretch->tolerances[s].transpose() * r;
      rr += stretch->weights[s] * r.squaredNorm();
    }
    tt += stretch->sums.tt;
  }
  return rr - tr.dot(Eigen::LDLT<Eigen::MatrixXd>(tt).solve(tr));
}

}  // namespace faultline
