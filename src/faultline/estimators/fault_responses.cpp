#include "faultline/estimators/fault_responses.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr std::size_t kMargin = 8;      // samples after a stretch: the last start state is smoothed over them
constexpr double kToleranceStep = 0.5;  // tolerances, of differences
constexpr int kRefinements = 3;
constexpr double kRefineStep = 0.1;  // of an amplitude, for its difference
constexpr double kCoarse = 0.4;      // of the largest amplitude: tried beside that and what the linear answer says
constexpr double kRelease = 0.3;     // of the threshold, below which a fault is over
constexpr unsigned kEarly = 4;       // stretches, after which what is done again is done ever more rarely
constexpr double kMoved = 0.3;       // tolerances, from which the model is made linear anew
constexpr double kSuspicion = 0.3;   // of the threshold, from which the linear model is doubted first
constexpr int kTries = 5;            // steps of the parameters at once
constexpr double kReaches[] = {-1.5, -0.75, 0.75, 1.5};  // tolerances that are tried
constexpr double kWorthMoving = 3;                       // gain in loss
constexpr double kFarthest = 3;                          // tolerances that parameters may be off the datasheet
constexpr double kGrown = 1.5;                           // times the evidence at the last refinement: refined anew
constexpr double kSecondShare = 0.3;  // of the first fault's evidence that a second must have, beyond the threshold
constexpr double kAlternative = 0.5;  // of the first fault's evidence: an alternative to it, not a second
constexpr double kOver = 5;           // evidence by which the latest stretch speaks against a fault that was there
constexpr std::size_t kLooked = 6, kCandidates = 12;  // hypotheses that are looked at closely while a fault lasts
constexpr double kInsensitive = 1e-6;                 // response below which nothing is said

}  // namespace

// T'T, T'D, D'D, T'r, D'r, r'r, with parameters and nuisance effects in T.
struct FaultResponses::Sums {
  Eigen::MatrixXd tt, td, dd;
  Eigen::VectorXd tr, dr;
  double rr = 0;
  Sums(Eigen::Index t, Eigen::Index d)
      : tt(Eigen::MatrixXd::Zero(t, t)),
        td(Eigen::MatrixXd::Zero(t, d)),
        dd(Eigen::MatrixXd::Zero(d, d)),
        tr(Eigen::VectorXd::Zero(t)),
        dr(Eigen::VectorXd::Zero(d)) {}
  void scale(double factor) {
    tt *= factor;
    td *= factor;
    dd *= factor;
    tr *= factor;
    dr *= factor;
    rr *= factor;
  }
  void add(const Sums& o) {
    tt += o.tt;
    td += o.td;
    dd += o.dd;
    tr += o.tr;
    dr += o.dr;
    rr += o.rr;
  }
};

struct FaultResponses::Stretch {
  Stretch(Eigen::Index t, Eigen::Index d) : sums(t, d) {}
  SegmentedRun run;
  double begin = 0;
  std::vector<Eigen::MatrixXd> starts;  // per counted segment
  std::vector<Eigen::MatrixXd> tolerances;
  std::vector<double> weights;  // of squares, inflation in it
  Sums sums;
};

// Lambda, and what the stretches before say of theta.
struct FaultResponses::Prior {
  Eigen::MatrixXd before;  // 1 + T_ref'T_ref, or 1
  Eigen::VectorXd pull;    // T_ref'r_ref, or 0
  double constant = 0;     // r_ref'r_ref, or 0
};

FaultResponses::FaultResponses(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet), settings_(settings), model_(sheet, settings.segment), hypotheses_(fault_hypotheses(sheet)) {
  rows_ = (settings_.segments + 1) * settings_.segment + kMargin;
  for (std::size_t i = 0; i < sheet_.parameters.size(); ++i)
    if (sheet_.parameters[i].tolerance > 0 && sheet_.parameters[i].nominal != 0) free_.push_back(i);
  for (const std::string& text : sheet_.nuisance) nuisance_.push_back(parse_effect(text));
  reset();
}

FaultResponses::~FaultResponses() = default;

void FaultResponses::reset() {
  collecting_.reset();
  started_ = event_ = false;
  recent_.clear();
  base_ = sheet_.nominal();
  shift_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(free_.size() + nuisance_.size()));
  reference_ = std::make_unique<Sums>(shift_.size(), static_cast<Eigen::Index>(hypotheses_.size()));
  stretches_ = age_ = 0;
  first_.clear();
  second_.clear();
  evidence_ = 0;
}

bool FaultResponses::add(double time, const double* channels, bool good) {
  if (!collect(time, channels, good)) return false;
  judge(*take());
  return true;
}

bool FaultResponses::collect(double time, const double* channels, bool good) {
  if (!started_) {
    started_ = true;
    next_ = time;
  }
  if (!good) {
    collecting_.reset();
    next_ = time;
    return false;
  }
  if (!collecting_) {
    if (time < next_) return false;
    collecting_ = std::make_unique<Recording>();
    collecting_->rig = sheet_.rig;
    collecting_->channels = sheet_.channels;
    collecting_->time.reserve(rows_);
    collecting_->sequence.reserve(rows_);
    collecting_->values.reserve(rows_ * sheet_.channels.size());
    next_ = time + settings_.every;
  }
  if (!collecting_->time.empty() &&
      std::abs(time - collecting_->time.back() - sheet_.sample_period) > 0.2 * sheet_.sample_period) {
    collecting_.reset();
    return false;
  }
  collecting_->time.push_back(time);
  collecting_->sequence.push_back(collecting_->sequence.size());
  collecting_->values.insert(collecting_->values.end(), channels, channels + sheet_.channels.size());
  return collecting_->rows() >= rows_;
}

std::unique_ptr<FaultResponses::Stretch> FaultResponses::respond(const Recording& recording) const {
  const Eigen::Index t = shift_.size(), d = static_cast<Eigen::Index>(hypotheses_.size());
  auto stretch = std::make_unique<Stretch>(t, d);
  stretch->begin = recording.time.front();
  stretch->run = model_.prepare("", recording);
  const std::vector<double>& sigma = model_.noise();
  const ModelChange base{base_, there_};
  const auto with = [&](const EffectSpec& effect) {
    ModelChange change = base;
    change.effects.push_back(effect);
    return change;
  };
  std::vector<ModelChange> changes = {base};
  std::vector<double> steps = {1};
  for (const std::size_t i : free_) {
    changes.push_back(base);
    changes.back().parameters[i] += kToleranceStep * sheet_.parameters[i].tolerance * sheet_.parameters[i].nominal;
    steps.push_back(kToleranceStep);
  }
  for (const EffectSpec& effect : nuisance_) {
    changes.push_back(with(effect));
    steps.push_back(1);
  }
  for (const FaultHypothesis& h : hypotheses_) {
    changes.push_back(with(h.at(h.probe)));
    steps.push_back(h.probe);
  }
  std::vector<Eigen::MatrixXf> residuals(changes.size());
  in_parallel(changes.size(), settings_.jobs,
              [&](std::size_t i) { residuals[i] = model_.residuals(changes[i], stretch->run, sigma); });
  for (std::size_t i = 1; i < residuals.size(); ++i)
    residuals[i] = (residuals[i] - residuals[0]) * static_cast<float>(1 / steps[i]);
  const std::vector<Eigen::MatrixXf> starts = model_.start_columns(base, stretch->run, sigma);
  for (std::size_t s = 1; s < stretch->run.restarts.size(); ++s) {
    const std::size_t row = stretch->run.restarts[s];
    Eigen::MatrixXd start;
    for (std::size_t i = 0; i < starts.size(); ++i) {
      const Eigen::VectorXd column = model_.stacked(starts[i], row);
      if (i == 0) start.resize(column.size(), static_cast<Eigen::Index>(starts.size()));
      start.col(static_cast<Eigen::Index>(i)) = column;
    }
    Eigen::MatrixXd all;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      const Eigen::VectorXd column = model_.stacked(residuals[i], row);
      if (i == 0) all.resize(column.size(), static_cast<Eigen::Index>(residuals.size()));
      all.col(static_cast<Eigen::Index>(i)) = column;
    }
    SegmentModel::project(start, all);
    const double mean_square = all.col(0).squaredNorm() / static_cast<double>(all.rows());
    const double weight = 1 / (settings_.inflation * std::max(1.0, mean_square));
    const auto tolerances = all.middleCols(1, t), responses = all.rightCols(d);
    const auto r = all.col(0);
    Sums& sums = stretch->sums;
    sums.tt.noalias() += weight * tolerances.transpose() * tolerances;
    sums.td.noalias() += weight * tolerances.transpose() * responses;
    sums.dd.noalias() += weight * responses.transpose() * responses;
    sums.tr.noalias() += weight * tolerances.transpose() * r;
    sums.dr.noalias() += weight * responses.transpose() * r;
    sums.rr += weight * r.squaredNorm();
    stretch->starts.push_back(std::move(start));
    stretch->tolerances.push_back(tolerances);
    stretch->weights.push_back(weight);
  }
  return stretch;
}

// Moves the parameters to what all stretches say of them.
bool FaultResponses::over() {
  const RankedFault& first = first_.front();
  Prior before{Eigen::MatrixXd::Identity(shift_.size(), shift_.size()), shift_, shift_.squaredNorm()};
  if (change_) {
    before.before += reference_->tt;
    before.pull += reference_->tr;
    before.constant += reference_->rr;
  }
  const std::size_t kept = window_;
  window_ = 1;
  const double with = loss(before, {hypotheses_[first.hypothesis].at(first.amplitude)}), without = loss(before, {});
  window_ = kept;
  return with > without + kOver;
}

// The model with the first fault in it, and all looked for anew around that: segments count by what is left of them.
void FaultResponses::look_beside(const Prior& before) {
  second_.clear();
  const RankedFault first = first_.front();
  there_ = {hypotheses_[first.hypothesis].at(first.amplitude)};
  std::vector<std::unique_ptr<Stretch>> kept;
  for (std::size_t i = recent_.size() - window_; i < recent_.size(); ++i) {
    kept.push_back(std::move(recent_[i]));
    recent_[i] = respond(kept.back()->run.recording);
  }
  std::vector<RankedFault> beside = screen(before);
  beside.erase(std::remove_if(
                   beside.begin(), beside.end(),
                   // What the first leaves at its own place, and what explains it nearly as well, is no second fault.
                   [&](const RankedFault& f) {
                     return hypotheses_[f.hypothesis].port == hypotheses_[first.hypothesis].port ||
                            std::any_of(first_.begin(), first_.end(), [&](const RankedFault& other) {
                              return other.hypothesis == f.hypothesis && other.evidence > kAlternative * first.evidence;
                            });
                   }),
               beside.end());
  const double limit = std::max(settings_.threshold, kSecondShare * first.evidence);
  if (!beside.empty() && beside.front().evidence > limit) {
    beside.resize(std::min(beside.size(), kCandidates));
    beside = best_of(before, loss(before, {}), beside);
    if (beside.front().evidence > limit) second_ = beside;
  }
  for (std::size_t i = 0; i < kept.size(); ++i) recent_[recent_.size() - window_ + i] = std::move(kept[i]);
  there_.clear();
}

void FaultResponses::best_window() {
  // Once there is a fault, the way it was found stays: what follows belongs to it.
  if (event_) {
    window_ = std::min(window_ + 1, recent_.size());
    screened_ = screen(prior());
    return;
  }
  screened_.clear();
  bool best_change = false;
  std::size_t best = recent_.size();
  const auto try_it = [&] {
    std::vector<RankedFault> screened = screen(prior());
    if (screened.empty() || (!screened_.empty() && screened.front().evidence <= screened_.front().evidence)) return;
    screened_ = std::move(screened);
    best_change = change_;
    best = window_;
  };
  change_ = false;
  window_ = recent_.size();
  try_it();
  change_ = true;
  for (window_ = 1; window_ <= recent_.size(); ++window_)
    if (stretches_ > window_) try_it();
  change_ = best_change;
  window_ = best;
}

bool FaultResponses::relinearise() {
  Sums sums = *reference_;
  for (const auto& stretch : recent_) sums.add(stretch->sums);
  const Eigen::MatrixXd lambda = Eigen::MatrixXd::Identity(shift_.size(), shift_.size()) + sums.tt;
  Eigen::VectorXd step = -Eigen::LDLT<Eigen::MatrixXd>(lambda).solve(shift_ + sums.tr);
  step.tail(static_cast<Eigen::Index>(nuisance_.size())).setZero();
  step = (shift_ + step).cwiseMax(-kFarthest).cwiseMin(kFarthest) - shift_;
  if (step.cwiseAbs().maxCoeff() < kMoved) return false;
  move(step);
  return true;
}

// One parameter at a time, as far as the model's own residuals say: where they bend too much for the linear model.
bool FaultResponses::search_parameters() {
  change_ = false;
  window_ = recent_.size();
  double least = loss(prior(), {}) - kWorthMoving;
  Eigen::VectorXd best = Eigen::VectorXd::Zero(shift_.size());
  for (std::size_t i = 0; i < free_.size(); ++i)
    for (const double reach : kReaches) {
      const Eigen::VectorXd kept = shift_;
      const std::vector<double> base = base_;
      Eigen::VectorXd step = Eigen::VectorXd::Zero(shift_.size());
      step[static_cast<Eigen::Index>(i)] = reach;
      shift_ += step;
      set_base();
      const double found = loss(prior(), {});
      shift_ = kept;
      base_ = base;
      if (found >= least) continue;
      least = found;
      best = step;
    }
  if (best.isZero()) return false;
  move(best);
  return true;
}

void FaultResponses::set_base() {
  base_ = sheet_.nominal();
  for (std::size_t i = 0; i < free_.size(); ++i)
    base_[free_[i]] *= 1 + shift_[static_cast<Eigen::Index>(i)] * sheet_.parameters[free_[i]].tolerance;
}

void FaultResponses::move(const Eigen::VectorXd& step) {
  shift_ = (shift_ + step).cwiseMax(-kFarthest).cwiseMin(kFarthest);
  set_base();
  // What was summed around other parameters would pull towards them: it is learnt anew.
  *reference_ = Sums(shift_.size(), static_cast<Eigen::Index>(hypotheses_.size()));
  for (auto& stretch : recent_) stretch = respond(stretch->run.recording);
}

FaultResponses::Prior FaultResponses::prior() const {
  Prior prior{Eigen::MatrixXd::Identity(shift_.size(), shift_.size()), shift_, shift_.squaredNorm()};
  if (!change_) return prior;
  const auto take = [&](const Sums& sums) {
    prior.before += sums.tt;
    prior.pull += sums.tr;
    prior.constant += sums.rr;
  };
  take(*reference_);
  for (std::size_t i = 0; i + window_ < recent_.size(); ++i) take(recent_[i]->sums);
  return prior;
}

std::vector<RankedFault> FaultResponses::screen(const Prior& prior) const {
  Sums sums(shift_.size(), static_cast<Eigen::Index>(hypotheses_.size()));
  for (std::size_t i = recent_.size() - window_; i < recent_.size(); ++i) sums.add(recent_[i]->sums);
  if (!change_ && there_.empty()) sums.add(*reference_);
  const Eigen::LDLT<Eigen::MatrixXd> lambda(prior.before + sums.tt);
  const Eigen::VectorXd theta = lambda.solve(prior.pull + sums.tr);
  const Eigen::MatrixXd known = lambda.solve(sums.td);
  std::vector<RankedFault> result;
  for (std::size_t h = 0; h < hypotheses_.size(); ++h) {
    const auto at = static_cast<Eigen::Index>(h);
    const double left = sums.dd(at, at) - sums.td.col(at).dot(known.col(at));
    RankedFault ranked;
    ranked.hypothesis = h;
    if (!(left > kInsensitive)) {  // standstill: nothing is said
      ranked.std = kInfinity;
      result.push_back(ranked);
      continue;
    }
    ranked.amplitude =
        std::clamp(-(sums.dr[at] - sums.td.col(at).dot(theta)) / left, hypotheses_[h].lowest, hypotheses_[h].highest);
    ranked.std = 1 / std::sqrt(left);
    // Evidence of the clamped amplitude: L(0) - L(a).
    ranked.evidence = -ranked.amplitude * (2 * (sums.dr[at] - sums.td.col(at).dot(theta)) + ranked.amplitude * left);
    result.push_back(ranked);
  }
  std::sort(result.begin(), result.end(),
            [](const RankedFault& a, const RankedFault& b) { return a.evidence > b.evidence; });
  return result;
}

// Over the recent stretches, parameters adjusted to first order.
double FaultResponses::loss(const Prior& prior, const std::vector<EffectSpec>& effects) const {
  Eigen::MatrixXd tt = prior.before;
  Eigen::VectorXd tr = prior.pull;
  double rr = prior.constant;
  ModelChange change{base_, there_};
  change.effects.insert(change.effects.end(), effects.begin(), effects.end());
  for (std::size_t i = recent_.size() - window_; i < recent_.size(); ++i) {
    const std::unique_ptr<Stretch>& stretch = recent_[i];
    const Eigen::MatrixXf residuals = model_.residuals(change, stretch->run, model_.noise());
    for (std::size_t s = 0; s < stretch->starts.size(); ++s) {
      Eigen::MatrixXd r = model_.stacked(residuals, stretch->run.restarts[s + 1]);
      SegmentModel::project(stretch->starts[s], r);
      tr.noalias() += stretch->weights[s] * stretch->tolerances[s].transpose() * r.col(0);
      rr += stretch->weights[s] * r.squaredNorm();
    }
    tt += stretch->sums.tt;
  }
  return rr - tr.dot(Eigen::LDLT<Eigen::MatrixXd>(tt).solve(tr));
}

// Parabolas through three losses: robust where the response bends.
RankedFault FaultResponses::refine(const Prior& prior, double base_loss, RankedFault start) const {
  const FaultHypothesis& h = hypotheses_[start.hypothesis];
  if (!std::isfinite(start.std)) return start;
  const double least = std::isinf(h.none) ? h.lowest : -kInfinity;
  const auto at = [&](double amplitude) { return loss(prior, {h.at(amplitude)}); };
  double a = std::max(start.amplitude, least), here = at(a);
  double curvature = 1 / (start.std * start.std);
  for (int i = 0; i < kRefinements; ++i) {
    const double step = std::max(kRefineStep * std::abs(a), 0.2 * start.std);
    const double up = std::min(a + step, h.highest), down = std::max({a - step, h.lowest, least});
    const double l_up = up > a ? at(up) : here, l_down = down < a ? at(down) : here;
    double slope, bend = curvature;
    if (up > a && down < a) {
      const double s1 = (l_up - here) / (up - a), s2 = (here - l_down) / (a - down);
      slope = (s1 * (a - down) + s2 * (up - a)) / (up - down);
      bend = (s1 - s2) / (up - down);
    } else {
      slope = up > a ? (l_up - here) / (up - a) : (here - l_down) / (a - down);
    }
    if (bend > 0) curvature = bend;
    double best = a, least_loss = here;
    for (const auto& [amplitude, l] : {std::pair(up, l_up), std::pair(down, l_down)})
      if (l < least_loss) {
        best = amplitude;
        least_loss = l;
      }
    const double wide = std::max(std::abs(a), 3 * start.std);
    const double newton =
        std::clamp(a - std::clamp(slope / (2 * curvature), -wide, wide), std::max(h.lowest, least), h.highest);
    const double l_newton = at(newton);
    if (l_newton < least_loss) {
      best = newton;
      least_loss = l_newton;
    }
    const bool done = here - least_loss < 0.01 * (base_loss - least_loss);
    a = best;
    here = least_loss;
    if (done) break;
  }
  start.amplitude = a;
  start.evidence = base_loss - here;
  start.std = 1 / std::sqrt(std::max(curvature, 1e-300));
  return start;
}

std::vector<RankedFault> FaultResponses::best_of(const Prior& prior, double base_loss,
                                                 std::vector<RankedFault> screened,
                                                 std::map<std::size_t, double>* candidates) const {
  // The linear answer misses what only a large fault does (a piston that no longer breaks away): a few sizes of each are tried. While a
  // fault lasts, those that explained it best when it was found start from what they were then.
  const bool known = event_ && !candidates_.empty();
  if (known)
    screened.erase(
        std::remove_if(screened.begin() + static_cast<std::ptrdiff_t>(std::min(screened.size(), kLooked)),
                       screened.end(), [&](const RankedFault& f) { return candidates_.count(f.hypothesis) == 0; }),
        screened.end());
  in_parallel(screened.size(), settings_.jobs, [&](std::size_t i) {
    const FaultHypothesis& h = hypotheses_[screened[i].hypothesis];
    double least = kInfinity;
    std::vector<double> sizes = {screened[i].amplitude};
    const auto before = candidates_.find(screened[i].hypothesis);
    if (known && before != candidates_.end()) sizes.push_back(before->second);
    if (!known) sizes.insert(sizes.end(), {kCoarse * h.highest, h.highest, kCoarse * h.lowest, h.lowest});
    for (const double a : sizes) {
      if (a == 0 || (std::isinf(h.none) && a < h.lowest)) continue;
      const double found = loss(prior, {h.at(a)});
      if (found >= least) continue;
      least = found;
      screened[i].amplitude = a;
    }
    screened[i].evidence = base_loss - least;
  });
  std::sort(screened.begin(), screened.end(),
            [](const RankedFault& a, const RankedFault& b) { return a.evidence > b.evidence; });
  if (candidates != nullptr) {
    candidates->clear();
    for (std::size_t i = 0; i < std::min(kCandidates, screened.size()); ++i)
      (*candidates)[screened[i].hypothesis] = screened[i].amplitude;
  }
  screened.resize(std::min(screened.size(), settings_.refined));
  in_parallel(screened.size(), settings_.jobs,
              [&](std::size_t i) { screened[i] = refine(prior, base_loss, screened[i]); });
  std::sort(screened.begin(), screened.end(),
            [](const RankedFault& a, const RankedFault& b) { return a.evidence > b.evidence; });
  return screened;
}

void FaultResponses::judge(const Recording& recording) {
  recent_.push_back(respond(recording));
  ++stretches_;
  const bool calm = evidence_ < kSuspicion * settings_.threshold;
  if (!event_ && (stretches_ <= kEarly || (calm && (stretches_ & (stretches_ - 1)) == 0)))
    for (int i = 0; i < kTries && relinearise(); ++i) {
    }
  if (recent_.size() > settings_.recent) {
    if (!event_) {
      reference_->scale(1 - 1 / settings_.memory);
      reference_->add(recent_.front()->sums);
    }
    recent_.erase(recent_.begin());
  }
  if (event_ && !first_.empty() && over()) {
    // What the recent stretches hold belongs to neither state.
    recent_.erase(recent_.begin(), recent_.end() - 1);
    event_ = false;
    age_ = 0;
  }
  best_window();
  // Before anything is blamed on the first stretches: are the parameters further off than the linear model can tell?
  for (int i = 0; i < kTries && stretches_ <= kEarly && !event_ && !screened_.empty() &&
                  screened_.front().evidence > kSuspicion * settings_.threshold && search_parameters();
       ++i) {
    relinearise();
    best_window();
  }
  if (!event_) best_window();
  // Screening takes the model's answer for linear and so finds too much, never too little by far.
  const double screened_evidence = screened_.empty() ? 0 : screened_.front().evidence;
  const double limit = (event_ ? kRelease : 1.0) * settings_.threshold;
  if (screened_evidence >= limit) {
    // While a fault lasts, ever more rarely, unless it grows.
    ++age_;
    const bool due = !event_ || age_ <= kEarly || (age_ & (age_ - 1)) == 0 ||
                     screened_evidence > kGrown * refined_at_ || screened_evidence * kGrown < refined_at_;
    if (!due) {
      // Its size is followed all the same; how the others stand to it stays.
      if (first_.empty()) return;
      const Prior now = prior();
      const RankedFault followed = refine(now, loss(now, {}), first_.front());
      const double share = followed.evidence / first_.front().evidence;
      for (RankedFault& f : first_) f.evidence *= share;
      first_.front() = followed;
      evidence_ = followed.evidence;
      return;
    }
    refined_at_ = screened_evidence;
  }
  const Prior before = prior();
  double base_loss = 0;
  std::vector<RankedFault> ranked;
  if (screened_evidence >= limit) {
    base_loss = loss(before, {});
    std::map<std::size_t, double> candidates;
    ranked = best_of(before, base_loss, screened_, &candidates);
    candidates_ = candidates;
    for (const RankedFault& f : ranked) candidates_[f.hypothesis] = f.amplitude;
  }
  evidence_ = ranked.empty() ? screened_evidence : ranked.front().evidence;
  if (ranked.empty() || evidence_ < limit) {
    event_ = false;
    age_ = 0;
    first_.clear();
    second_.clear();
    return;
  }
  first_ = ranked;
  look_beside(before);
  if (age_ == 1) since_ = recent_[recent_.size() - window_]->begin;
  event_ = true;
}

// Parameters are known to their tolerance and from as much healthy motion as there is with the fault.
Eigen::MatrixXd FaultResponses::information() const {
  Sums sums = *reference_;
  for (const auto& stretch : recent_) sums.add(stretch->sums);
  const Eigen::Index t = shift_.size();
  return sums.dd - sums.td.transpose() *
                       Eigen::LDLT<Eigen::MatrixXd>(Eigen::MatrixXd::Identity(t, t) + 2 * sums.tt).solve(sums.td);
}

std::vector<double> FaultResponses::amplitude_errors() const {
  const Eigen::VectorXd left = information().diagonal();
  std::vector<double> result(hypotheses_.size(), kInfinity);
  for (std::size_t h = 0; h < result.size(); ++h) {
    const double information = left[static_cast<Eigen::Index>(h)];
    if (information > kInsensitive) result[h] = 1 / std::sqrt(information);
  }
  return result;
}

Eigen::MatrixXd FaultResponses::cosines() const {
  Eigen::MatrixXd left = information();
  const Eigen::VectorXd length = left.diagonal().cwiseMax(kInsensitive).cwiseSqrt();
  for (Eigen::Index i = 0; i < left.rows(); ++i)
    for (Eigen::Index j = 0; j < left.cols(); ++j)
      left(i, j) = length[i] > 1.01 * std::sqrt(kInsensitive) && length[j] > 1.01 * std::sqrt(kInsensitive)
                       ? left(i, j) / (length[i] * length[j])
                       : 0;
  return left;
}

}  // namespace faultline
