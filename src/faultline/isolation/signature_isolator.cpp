#include "faultline/isolation/signature_isolator.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/attribution/screening.h"
#include "faultline/detectors/run_length.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kSecondsPerHour = 3600;
constexpr double kLeastNoise = 1e-9;  // of a residual: a guard against division by zero
constexpr int kReferenceVersion = 1;  // mean features
constexpr double kAtBound = 0.995;    // of the largest size
constexpr double kWidestNoise = 100;  // of a feature's variance: ten times the noise of the datasheet

}  // namespace

SignatureOptions read_signature_options(const Settings& s, const std::vector<std::string>& kinds, double period) {
  SignatureOptions o;
  o.learn_s = s.number("learn", 10 * period, 1e4);
  o.window_s = s.number("window", 10 * period, 60);
  o.confirm_samples = static_cast<std::size_t>(s.number("confirm", 1, 1e4));
  o.patience_s = s.number("patience", 0, 1e3);
  o.noise_limit = s.number("noise_limit", 1e-9, 1e9);
  o.rival_chi_squared = s.number("rival", 0, 1e6);
  o.significance_chi_squared = s.number("significance", 0, 1e9);
  o.fit_chi_squared_per_residual = s.number("fit", 1e-3, 1e9);
  o.relative_error_fraction = s.number("relative_error", 0, 1);
  o.release_time_s = s.number("release_time", 0, 1e4);
  o.false_alarms_per_hour = s.number("false_alarms_per_hour", 1e-9, 1e6);
  for (const std::string& kind : kinds) {
    o.change.push_back(s.number("change_" + kind, 1e-9, 1e3));
    o.floor.push_back(s.number("floor_" + kind, 1e-12, 1e3));
  }
  return o;
}

SignatureIsolator::SignatureIsolator(const Datasheet& sheet, const StageSpec& spec)
    : SignatureIsolator(sheet, spec, [](SignatureOptions&) {}) {}

SignatureIsolator::SignatureIsolator(const Datasheet& sheet, const StageSpec& spec,
                                     const std::function<void(SignatureOptions&)>& adjust)
    : model_(make_balance_model(spec.settings.word("model"), sheet, spec.settings)),
      feature_names_(model_->features()),
      residual_names_(model_->residuals()),
      residual_channels_(model_->residual_channels()),
      hypotheses_(model_->hypotheses()),
      arming_(spec.settings),
      period_(sheet.sample_period),
      options_(read_signature_options(spec.settings, model_->residual_kinds(), sheet.sample_period)) {
  adjust(options_);
  const std::size_t n = residual_names_.size(), f = feature_names_.size();
  samples_between_alarms_ = static_cast<double>(n) * kSecondsPerHour / period_ / options_.false_alarms_per_hour;
  capacity_ = static_cast<std::size_t>(options_.window_s / period_) + 2;
  ring_.assign(capacity_ * f, 0);
  at_.resize(f);
  for (auto* v : {&features_, &sum_, &mean_, &window_mean_, &previous_, &before_}) v->assign(f, 0);
  for (auto* v : {&reference_, &residual_, &noise_, &error_, &weight_, &tried_, &ahead_, &unchanged_}) v->assign(n, 0);
  tests_.resize(n);
  useless_.assign(n, false);
  masked_.assign(n, false);
  matches_.resize(hypotheses_.size());
}

void SignatureIsolator::reset() { started_ = false; }

void SignatureIsolator::begin(const Estimate& estimate) {
  for (std::size_t i = 0; i < at_.size(); ++i) at_[i] = find_quantity(estimate, feature_names_[i]);
  arming_.find(estimate);
  started_ = true;
  learnt_ = armed_ = event_ = false;
  named_ = -1;
  learn_count_ = 0;
  feature_noise_ = model_->feature_noise();
  own_noise_.clear();
  for (const double noise : feature_noise_) own_noise_.emplace_back(noise * noise, kWidestNoise);
  noise_known_ = false;
  in_a_row_ = 0;
  rows_ = watched_ = 0;
  std::fill(sum_.begin(), sum_.end(), 0.0);
  if (!restored_.empty()) set_reference(restored_);
  forget_window();
}

std::optional<Reference> SignatureIsolator::reference() const {
  if (!learnt_) return {};
  return Reference{"signatures", kReferenceVersion, feature_names_, sum_};
}

void SignatureIsolator::restore(const Reference& reference) {
  check_reference(reference, "signatures", kReferenceVersion, feature_names_);
  restored_ = reference.numbers;
}

void SignatureIsolator::set_reference(const std::vector<double>& features) {
  sum_ = features;
  model_->reference(sum_.data(), reference_.data());
  learnt_ = true;
}

void SignatureIsolator::forget_window() {
  for (TwoSidedCusum& test : tests_) test.reset();
  head_ = filled_ = 0;
  std::fill_n(ring_.begin(), feature_names_.size(), 0.0);
  age_ = 0;
  course_ = -1;
  course_known_ = false;
}

void SignatureIsolator::learn() {
  for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] += features_[i];
  learn_count_ += 1;
  if (learn_count_ * period_ < options_.learn_s) return;
  for (double& sum : sum_) sum /= learn_count_;
  set_reference(sum_);
  forget_window();
}

void SignatureIsolator::learn_noise() {
  if (noise_known_) return;
  if (++in_a_row_ > 2)
    for (std::size_t i = 0; i < features_.size(); ++i) {
      const double second = features_[i] - 2 * previous_[i] + before_[i];
      own_noise_[i].add(second * second / 6);
    }
  before_.swap(previous_);
  previous_ = features_;
  if (!own_noise_[0].settled()) return;
  noise_known_ = true;
  for (std::size_t i = 0; i < feature_noise_.size(); ++i)
    if (feature_noise_[i] > 0) feature_noise_[i] = std::sqrt(own_noise_[i].level());
  armed_ = false;  // thresholds follow
}

void SignatureIsolator::set_thresholds() {
  std::fill(noise_.begin(), noise_.end(), 0.0);
  mean_ = features_;
  model_->residuals(mean_.data(), reference_.data(), -1, 0, tried_.data());
  for (std::size_t f = 0; f < mean_.size(); ++f) {
    if (feature_noise_[f] == 0) continue;
    mean_[f] = features_[f] + feature_noise_[f];
    model_->residuals(mean_.data(), reference_.data(), -1, 0, ahead_.data());
    mean_[f] = features_[f];
    for (std::size_t i = 0; i < noise_.size(); ++i) noise_[i] += (ahead_[i] - tried_[i]) * (ahead_[i] - tried_[i]);
  }
  model_->errors(features_.data(), sum_.data(), error_.data());
  for (std::size_t i = 0; i < noise_.size(); ++i) {
    noise_[i] = std::max(std::sqrt(noise_[i]), kLeastNoise);
    useless_[i] = noise_[i] > options_.noise_limit;
    const double allowance = 0.5 * options_.change[i] + options_.balance_error_sigma * error_[i];
    tests_[i].allowance = allowance;
    if (useless_[i]) continue;
    // However quiet a residual is, one sample beyond its change is not yet an event.
    tests_[i].threshold =
        std::max(options_.change[i], noise_[i] * siegmund_threshold(allowance / noise_[i], samples_between_alarms_));
  }
}

void SignatureIsolator::remember() {
  const std::size_t f = features_.size();
  const std::size_t next = (head_ + 1) % capacity_;
  for (std::size_t i = 0; i < f; ++i) ring_[next * f + i] = ring_[head_ * f + i] + features_[i];
  head_ = next;
  filled_ = std::min(filled_ + 1, capacity_ - 1);
}

bool SignatureIsolator::watch(const std::vector<bool>& doubted) {
  model_->residuals(features_.data(), reference_.data(), -1, 0, residual_.data());
  bool beyond = false;
  double most = 0;
  const bool any_doubted = std::find(doubted.begin(), doubted.end(), true) != doubted.end();
  for (std::size_t i = 0; i < tests_.size(); ++i) {
    masked_[i] = useless_[i];
    if (any_doubted)
      for (const int channel : residual_channels_[i])
        masked_[i] = masked_[i] || doubted[static_cast<std::size_t>(channel)];
    if (masked_[i]) {
      tests_[i].reset();
      continue;
    }
    if (!tests_[i].update(residual_[i])) continue;
    beyond = true;
    const double height = std::max(tests_[i].up, tests_[i].down) / tests_[i].threshold;
    if (!event_ && height > most) {
      most = height;
      age_ = tests_[i].steps();
    }
  }
  return beyond;
}

double SignatureIsolator::weighed(std::size_t h, double size) {
  model_->residuals(mean_.data(), reference_.data(), static_cast<int>(h), size, tried_.data());
  double chi2 = 0;
  for (std::size_t i = 0; i < tried_.size(); ++i) chi2 += weight_[i] * tried_[i] * tried_[i];
  return chi2;
}

void SignatureIsolator::match(std::size_t h) {
  const Hypothesis& hypothesis = hypotheses_[h];
  Match& m = matches_[h];
  m.size = 0;
  m.chi2 = unexplained_;
  tried_ = unchanged_;
  for (std::size_t step = 0; step < options_.size_steps; ++step) {
    const std::size_t n = tried_.size();
    model_->residuals(mean_.data(), reference_.data(), static_cast<int>(h), m.size + hypothesis.unit, ahead_.data());
    double slope = 0, square = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double derivative = (ahead_[i] - tried_[i]) / hypothesis.unit;
      slope += weight_[i] * derivative * tried_[i];
      square += weight_[i] * derivative * derivative;
    }
    step_ << m.chi2, slope, slope, square;
    const BestSize best = best_size(step_, 1, hypothesis.low - m.size, hypothesis.high - m.size);
    if (!(best.information > 0)) return;
    m.variance = 1 / best.information;
    const double size = m.size + best.size;
    const double chi2 = weighed(h, size);
    // Not a better fit: the last was the best, and tried_ is that of the worse one.
    if (!(chi2 < m.chi2)) return;
    m.size = size;
    m.chi2 = chi2;
  }
}

void SignatureIsolator::evaluate(double time, const std::vector<bool>& doubted, Finding& finding) {
  const std::size_t f = features_.size();
  const std::size_t n = std::min(std::max<std::size_t>(age_, 1), filled_);
  const std::size_t tail = (head_ + capacity_ - n) % capacity_;
  for (std::size_t i = 0; i < f; ++i) mean_[i] = (ring_[head_ * f + i] - ring_[tail * f + i]) / static_cast<double>(n);
  for (std::size_t i = 0; i < weight_.size(); ++i)
    weight_[i] = masked_[i] ? 0
                            : 1 / (noise_[i] * noise_[i] / static_cast<double>(n) +
                                   options_.floor[i] * options_.floor[i] + error_[i] * error_[i]);
  unexplained_ = weighed(0, 0);
  unchanged_ = tried_;
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    matches_[h].tried = true;
    for (const int channel : hypotheses_[h].channels)
      if (doubted[static_cast<std::size_t>(channel)]) matches_[h].tried = false;
    if (matches_[h].tried) match(h);
  }
  window_mean_ = mean_;
  judge_course();
  if (course_known_)
    for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
      const double rise = hypotheses_[h].rise;
      if (rise < 0) continue;
      // What a step of it would have shown in the first moments.
      const double early = options_.early_s;
      const double expected = rise == 0 ? 1 : 1 - rise / early * (1 - std::exp(-early / rise));
      if (std::abs(course_ - expected) > options_.course_miss_fraction)
        matches_[h].chi2 += options_.course_cost_chi_squared;
    }
  tell(time, finding);
}

double SignatureIsolator::window_residual(std::size_t row, std::size_t from, std::size_t to) {
  const std::size_t f = features_.size();
  const std::size_t tail = (head_ + capacity_ - from) % capacity_, front = (head_ + capacity_ - to) % capacity_;
  for (std::size_t i = 0; i < f; ++i)
    mean_[i] = (ring_[front * f + i] - ring_[tail * f + i]) / static_cast<double>(from - to);
  model_->residuals(mean_.data(), reference_.data(), -1, 0, ahead_.data());
  return ahead_[row];
}

void SignatureIsolator::judge_course() {
  // Judged once an event, while the window still reaches back to its beginning.
  const std::size_t age = age_, early = static_cast<std::size_t>(options_.early_s / period_);
  const std::size_t plateau = static_cast<std::size_t>(options_.plateau_s / period_);
  if (course_ >= 0 || age > filled_ ||
      static_cast<double>(age) < options_.course_age_fraction * options_.window_s / period_ ||
      age < early + 2 * plateau)
    return;
  weighed(0, 0);
  std::size_t row = 0;
  for (std::size_t i = 0; i < tried_.size(); ++i)
    if (weight_[i] * tried_[i] * tried_[i] > weight_[row] * tried_[row] * tried_[row]) row = i;
  const double last = window_residual(row, plateau, 0);
  const double middle = window_residual(row, age / 2 + plateau / 2, age / 2 - plateau / 2);
  const double first = window_residual(row, age, age - early);
  const bool steady = std::abs(last - middle) < options_.plateau_change_fraction * std::abs(last);
  course_ = steady ? std::clamp(first / last, 0.0, 2.0) : 0.0;
  course_known_ =
      steady && noise_[row] / std::sqrt(options_.early_s / period_) < options_.early_noise_fraction * std::abs(last);
}

void SignatureIsolator::tell(double time, Finding& finding) {
  std::size_t best = hypotheses_.size();
  for (std::size_t h = 0; h < matches_.size(); ++h)
    if (matches_[h].tried && (best == hypotheses_.size() || matches_[h].chi2 < matches_[best].chi2 - 1e-9)) best = h;
  if (best == hypotheses_.size()) return;
  if (!finding.active && unexplained_ - matches_[best].chi2 < options_.significance_chi_squared) return;
  std::size_t rivals = 0;
  double total = 0;
  for (std::size_t h = 0; h < matches_.size(); ++h) {
    if (!matches_[h].tried || matches_[h].size == 0) continue;
    const double behind = matches_[h].chi2 - matches_[best].chi2;
    total += std::exp(-0.5 * behind);
    rivals += h != best && behind < options_.rival_chi_squared;
  }
  const double age = static_cast<double>(age_) * period_;
  if (!finding.active && rivals >= options_.few_rivals && age < options_.patience_s) return;

  const Hypothesis& h = hypotheses_[best];
  const Match& m = matches_[best];
  const bool known = m.chi2 < options_.fit_chi_squared_per_residual * static_cast<double>(tried_.size()) && m.size != 0;
  if (named_ != static_cast<int>(best)) sizes_.clear();
  named_ = known ? static_cast<int>(best) : -1;
  finding.active = true;
  finding.since = onset_;
  finding.equivalent.clear();
  if (!known) {
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text = fmt::format("The balances have changed in a way that no single fault explains (nearest: {}@{})",
                               h.effect, h.port);
    finding.has_size = false;
    finding.confidence = 0.5;
    return;
  }
  if (m.size >= kAtBound * h.high || (h.low < 0 && m.size <= kAtBound * h.low)) {
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text =
        fmt::format("No fault of the datasheet explains it; nearest is {}@{} at its largest {}, {:.3g}{}", h.effect,
                    h.port, h.size_name, h.shown_from + m.size, h.size_unit == "1" ? "" : " " + h.size_unit);
    finding.has_size = false;
    finding.confidence = 0.5;
    return;
  }
  finding.kind = h.kind;
  finding.effect = h.effect;
  finding.port = h.port;
  finding.text = h.text;
  if (rivals > options_.most_rivals) {
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text =
        fmt::format("The balances have changed by too little to say what it is (nearest: {}@{})", h.effect, h.port);
    finding.has_size = false;
    finding.confidence = 0.5;
    return;
  }
  for (std::size_t other = 0; other < matches_.size(); ++other)
    if (other != best && matches_[other].tried && matches_[other].size != 0 &&
        matches_[other].chi2 - m.chi2 < options_.rival_chi_squared) {
      finding.equivalent.push_back(fmt::format("{}@{}", hypotheses_[other].effect, hypotheses_[other].port));
      if (hypotheses_[other].kind == AlarmKind::fault) finding.kind = AlarmKind::fault;
    }
  finding.confidence = total > 0 ? 1 / total : 1;
  finding.has_size = true;
  finding.size_name = h.size_name;
  finding.size_unit = h.size_unit;
  const double std = std::sqrt(m.variance + std::pow(options_.relative_error_fraction * m.size, 2));
  finding.none = h.shown_from;
  finding.size = h.shown_from + m.size;
  finding.low = finding.size - kNinetyPercentSigmas * std;
  finding.high = finding.size + kNinetyPercentSigmas * std;
  if (h.low == 0) finding.low = std::max(finding.low, h.shown_from);
  if (!h.drift_unit.empty()) tell_sensor(time, h, m.variance, finding);
  if (!finding.equivalent.empty())
    finding.text +=
        fmt::format("; ambiguous: {{{}@{}, {}}}", finding.effect, finding.port, fmt::join(finding.equivalent, ", "));
}

void SignatureIsolator::tell_sensor(double time, const Hypothesis& h, double variance, Finding& finding) {
  const double t = time - onset_, a = finding.size;
  sizes_.add(t, a);
  if (h.feature >= 0) {
    const double shown = window_mean_[static_cast<std::size_t>(h.feature)];
    if (sizes_.count() == 1) shown_first_ = shown, shown_ = shown_square_ = 0;
    shown_ += shown - shown_first_;
    shown_square_ += (shown - shown_first_) * (shown - shown_first_);
  }
  if (t < options_.drift_age_s || sizes_.count() < options_.drift_least_evaluations) return;
  const double sizes = sizes_.variance(), n = static_cast<double>(sizes_.count());
  const double moved = options_.stuck_scatter_sigma, still = options_.stuck_reading_fraction;
  if (h.feature >= 0 && sizes > moved * moved * variance &&
      shown_square_ / n - std::pow(shown_ / n, 2) < still * still * sizes) {
    // Nothing else explains a reading that does not move.
    finding.kind = AlarmKind::sensor;
    finding.effect = "stuck";
    finding.has_size = false;
    finding.equivalent.clear();
    finding.text = fmt::format("{}: this transducer is stuck", h.port.substr(h.port.find('.') + 1));
    return;
  }
  if (!sizes_.straight(options_.straight_correlation)) return;
  const double rate = sizes_.rate();
  // A step whose window is only filling also rises: a drift goes on by most of what it has become.
  if (std::abs(rate) * t < options_.drift_size_fraction * std::abs(a)) return;
  finding.effect = "drift";
  finding.size_name = "rate";
  finding.size_unit = h.drift_unit;
  finding.none = 0;
  finding.size = rate;
  const double std = std::hypot(sizes_.rate_std(), options_.relative_error_fraction * rate);
  finding.low = rate - kNinetyPercentSigmas * std;
  finding.high = rate + kNinetyPercentSigmas * std;
  for (std::string& other : finding.equivalent)
    if (other.rfind("offset@sensor.", 0) == 0) other = "drift" + other.substr(other.find('@'));
  finding.text = fmt::format("{}: this transducer drifts", h.port.substr(h.port.find('.') + 1));
}

void SignatureIsolator::process(const Estimate& estimate, const std::vector<bool>& doubted, Finding& finding) {
  if (!started_) {
    begin(estimate);
    finding = Finding();
  }
  rows_ += 1;
  bool finite = true;
  for (std::size_t i = 0; i < at_.size(); ++i) {
    features_[i] = estimate.quantities[at_[i]].value;
    finite = finite && std::isfinite(features_[i]);
  }
  if (!finite || estimate.restarted || !arming_.armed(estimate)) {
    // What was found stays, and what was learnt outlasts a gap in the data: a fault that is there by then is not the
    // rig in good order. What is watched begins anew.
    if (learnt_) {
      forget_window();
      course_ = 0;  // of an event that goes on the beginning is out of sight
    } else {
      // A mean over two operating points is a reference for neither.
      learn_count_ = 0;
      std::fill(sum_.begin(), sum_.end(), 0.0);
    }
    armed_ = false;
    in_a_row_ = 0;
    event_ = event_ && finding.active;
    last_beyond_ = estimate.time;
    return;
  }
  learn_noise();
  if (!learnt_) {
    learn();
    return;
  }
  if (!armed_) set_thresholds();
  armed_ = true;
  watched_ += 1;
  remember();
  const bool beyond = watch(doubted);
  if (beyond) last_beyond_ = estimate.time;
  if (!event_) {
    if (!beyond) return;
    event_ = true;
    course_ = -1;
    course_known_ = false;
    onset_ = estimate.time - static_cast<double>(age_) * period_;
    raised_from_ = estimate.time;
  } else {
    ++age_;
    if (estimate.time - last_beyond_ > (finding.active ? options_.release_time_s : 0)) {
      event_ = false;
      named_ = -1;
      finding = Finding();
      return;
    }
  }
  const std::size_t confirm = options_.confirm_samples;
  // The window of an event that has filled it changes slowly.
  const bool filled = static_cast<double>(age_) * period_ > options_.window_s;
  const bool turn = age_ % (filled ? options_.every_samples * options_.settled_ratio : options_.every_samples) == 0;
  const bool due = finding.active ? turn : age_ == confirm || (age_ > confirm && turn);
  if (beyond && (due || (!finding.active && age_ > confirm && estimate.time == raised_from_)))
    evaluate(estimate.time, doubted, finding);
}

namespace {

FAULTLINE_ISOLATOR(signatures, {"signatures", make_isolator_of<SignatureIsolator>});

}  // namespace

}  // namespace faultline
