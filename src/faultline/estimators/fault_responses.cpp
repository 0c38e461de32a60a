#include "faultline/estimators/fault_responses.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

bool by_evidence(const RankedFault& a, const RankedFault& b) { return a.evidence > b.evidence; }

bool power_of_two(unsigned count) { return (count & (count - 1)) == 0; }

}  // namespace

FaultResponses::FaultResponses(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet),
      settings_(settings),
      model_(sheet, settings),
      point_(model_.nominal()),
      reference_(model_.no_sums()) {
  reset();
}

void FaultResponses::reset() {
  collecting_.reset();
  started_ = event_ = false;
  recent_.clear();
  point_ = model_.nominal();
  reference_ = model_.no_sums();
  stretches_ = age_ = 0;
  first_.clear();
  second_.clear();
  candidates_.clear();
  evidence_ = 0;
  model_.forget_starts();
  healthy_misfits_.clear();
  know_healthy();
}

bool FaultResponses::add(double time, const double* channels, bool good) {
  if (!collect(time, channels, good)) return false;
  judge(*take());
  return true;
}

bool FaultResponses::collect(double time, const double* channels, bool good) {
  const std::size_t rows =
      (settings_.segments + 1) * static_cast<std::size_t>(std::lround(settings_.segment_s / sheet_.sample_period));
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
    collecting_->time.reserve(rows);
    collecting_->sequence.reserve(rows);
    collecting_->values.reserve(rows * sheet_.channels.size());
    next_ = time + settings_.every_s;
  }
  if (!collecting_->time.empty() && std::abs(time - collecting_->time.back() - sheet_.sample_period) >
                                        settings_.segment.period_error_fraction * sheet_.sample_period) {
    collecting_.reset();
    return false;
  }
  collecting_->time.push_back(time);
  collecting_->sequence.push_back(collecting_->sequence.size());
  collecting_->values.insert(collecting_->values.end(), channels, channels + sheet_.channels.size());
  return collecting_->rows() >= rows;
}

Stretches FaultResponses::latest(std::size_t count) const {
  Stretches stretches;
  for (std::size_t i = 0; i < count; ++i) stretches.push_back(recent_[recent_.size() - 1 - i].get());
  return stretches;
}

// ---- what is known, and what is news

std::vector<EffectSpec> FaultResponses::found_effects() const {
  std::vector<EffectSpec> effects;
  for (const auto* found : {&first_, &second_})
    if (!found->empty()) effects.push_back(hypotheses()[found->front().hypothesis].at(found->front().amplitude));
  return effects;
}

void FaultResponses::know_healthy() {
  ResponsePrior all = model_.tolerances(point_);
  all.add(reference_);
  for (const auto& stretch : recent_)
    if (stretch->responded) all.add(stretch->sums);
  const Eigen::VectorXd theta = all.theta();
  known_ = model_.known(point_, theta, {});
  for (const auto& stretch : recent_)
    if (stretch->responded) stretch->misfit = model_.misfit(*stretch, theta);
  if (!recent_.empty()) {
    healthy_misfits_.push_back(recent_.back()->misfit);
    if (static_cast<double>(healthy_misfits_.size()) > settings_.memory_stretches) healthy_misfits_.pop_front();
  }
  healthy_usual_ = model_.noise_misfit();
  if (!healthy_misfits_.empty()) {
    std::vector<double> sorted(healthy_misfits_.begin(), healthy_misfits_.end());
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    healthy_usual_ = *middle;
  }
  usual_ = healthy_usual_;
}

void FaultResponses::know_fault(const Scene& scene) {
  ResponsePrior after;
  model_.loss(scene.prior, scene.stretches, scene.point, found_effects(), kInfinity, &after);
  known_ = model_.known(point_, after.theta(), found_effects());
  usual_ = 0;
  for (std::size_t i = recent_.size() - window_.stretches; i < recent_.size(); ++i) {
    recent_[i]->misfit = model_.misfit(*recent_[i], known_, 0);
    usual_ += recent_[i]->misfit / static_cast<double>(window_.stretches);
  }
  usual_ = std::max(usual_, healthy_usual_);
}

bool FaultResponses::says_nothing_new() {
  Stretch& last = *recent_.back();
  const double suspicion = settings_.suspicion_fraction * settings_.threshold_evidence;
  const double news = settings_.new_fraction * settings_.threshold_evidence;
  last.misfit = model_.misfit(last, known_, usual_ + news);
  double beyond = 0, most = 0;
  for (auto stretch = recent_.rbegin(); stretch != recent_.rend(); ++stretch) {
    beyond += (*stretch)->misfit - usual_;
    most = std::max(most, beyond);
  }
  if (!event_) {
    if (last.misfit - usual_ <= news || most <= suspicion) {
      evidence_ = std::min(most, suspicion);
      return true;
    }
    return false;
  }
  return last.misfit - usual_ <= std::max(news, settings_.followed_fraction * first_.front().evidence);
}

// The latest stretch is what was known already.
void FaultResponses::pass_over() {
  if (event_) ++age_;
  forget_oldest();
}

void FaultResponses::respond_all() {
  for (auto& stretch : recent_)
    if (!stretch->responded) model_.respond(*stretch, point_);
}

void FaultResponses::weigh_all() {
  respond_all();
  for (auto& stretch : recent_)
    if (!stretch->weighed) model_.weigh(*stretch, point_);
}

// ---- parameters

void FaultResponses::learn_parameters() {
  const bool calm = evidence_ < settings_.suspicion_fraction * settings_.threshold_evidence;
  if (event_ || (stretches_ > settings_.early_stretches && !(calm && power_of_two(stretches_)))) return;
  for (std::size_t i = 0; i < settings_.parameter_moves && relinearise(); ++i) {
  }
}

// Moves the parameters to what all stretches say of them.
bool FaultResponses::relinearise() {
  ResponseSums sums = reference_;
  for (const auto& stretch : recent_) sums.add(stretch->sums);
  const Eigen::VectorXd& shift = point_.shift;
  const Eigen::MatrixXd lambda = Eigen::MatrixXd::Identity(shift.size(), shift.size()) + sums.tt;
  Eigen::VectorXd step = -Eigen::LDLT<Eigen::MatrixXd>(lambda).solve(shift + sums.tr);
  step.tail(shift.size() - static_cast<Eigen::Index>(model_.free_parameters())).setZero();
  const double farthest = settings_.farthest_tolerances;
  step = (shift + step).cwiseMax(-farthest).cwiseMin(farthest) - shift;
  if (step.cwiseAbs().maxCoeff() < settings_.relinearise_tolerances) return false;
  move(step);
  return true;
}

// One parameter at a time, as far as the model's own residuals say: where they bend too much for the linear model.
bool FaultResponses::search_parameters() {
  const Stretches all = latest(recent_.size());
  double least = model_.loss(model_.tolerances(point_), all) - settings_.worthwhile_evidence;
  Eigen::VectorXd best = Eigen::VectorXd::Zero(point_.shift.size());
  for (std::size_t i = 0; i < model_.free_parameters(); ++i)
    for (const double reach : settings_.reach_tolerances) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(point_.shift.size());
      step[static_cast<Eigen::Index>(i)] = reach;
      const ModelPoint tried = model_.at(point_.shift + step);
      const double found = model_.loss(model_.tolerances(tried), all, tried, {}, least);
      if (found >= least) continue;
      least = found;
      best = step;
    }
  if (best.isZero()) return false;
  move(best);
  return true;
}

void FaultResponses::move(const Eigen::VectorXd& step) {
  const double farthest = settings_.farthest_tolerances;
  point_ = model_.at((point_.shift + step).cwiseMax(-farthest).cwiseMin(farthest));
  // What was summed around other parameters would pull towards them: it is learnt anew.
  reference_ = model_.no_sums();
  healthy_misfits_.clear();
  for (auto& stretch : recent_) model_.respond(*stretch, point_);
}

void FaultResponses::forget_oldest() {
  if (recent_.size() <= settings_.recent_stretches) return;
  if (!event_ && recent_.front()->responded) {
    if (!recent_.front()->weighed) model_.weigh(*recent_.front(), point_);
    reference_.scale(1 - 1 / settings_.memory_stretches);
    reference_.add(recent_.front()->sums);
  }
  recent_.erase(recent_.begin());
}

// ---- hypotheses

ResponsePrior FaultResponses::prior(const Window& window) const {
  ResponsePrior prior = model_.tolerances(point_);
  if (!window.change) return prior;
  prior.add(reference_);
  for (std::size_t i = 0; i + window.stretches < recent_.size(); ++i) prior.add(recent_[i]->sums);
  return prior;
}

std::vector<RankedFault> FaultResponses::screen(const ResponsePrior& prior, const Stretches& stretches,
                                                bool with_reference) const {
  const std::vector<FaultHypothesis>& all = hypotheses();
  ResponseSums sums = model_.no_sums();
  for (const Stretch* stretch : stretches) sums.add(stretch->sums);
  if (with_reference) sums.add(reference_);
  const Eigen::LDLT<Eigen::MatrixXd> lambda(prior.information + sums.tt);
  const Eigen::VectorXd theta = lambda.solve(prior.pull + sums.tr);
  const Eigen::MatrixXd known = lambda.solve(sums.td);
  std::vector<RankedFault> result;
  for (std::size_t h = 0; h < all.size(); ++h) {
    const auto at = static_cast<Eigen::Index>(h);
    const double left = sums.dd(at, at) - sums.td.col(at).dot(known.col(at));
    RankedFault ranked;
    ranked.hypothesis = h;
    if (!(left > settings_.least_response)) {  // standstill: nothing is said
      ranked.std = kInfinity;
      result.push_back(ranked);
      continue;
    }
    ranked.amplitude = std::clamp(-(sums.dr[at] - sums.td.col(at).dot(theta)) / left, all[h].lowest, all[h].highest);
    ranked.std = 1 / std::sqrt(left);
    // Evidence of the clamped amplitude: L(0) - L(a).
    ranked.evidence = -ranked.amplitude * (2 * (sums.dr[at] - sums.td.col(at).dot(theta)) + ranked.amplitude * left);
    result.push_back(ranked);
  }
  std::sort(result.begin(), result.end(), by_evidence);
  return result;
}

std::vector<RankedFault> FaultResponses::screen(const Window& window) const {
  return screen(prior(window), latest(window.stretches), !window.change);
}

std::vector<RankedFault> FaultResponses::find_window() {
  // Once there is a fault, the way it was found stays: what follows belongs to it.
  if (event_) return screen(window_);
  std::vector<RankedFault> best;
  Window best_window{false, recent_.size()};
  const auto attempt = [&](const Window& window) {
    std::vector<RankedFault> screened = screen(window);
    if (screened.empty() || (!best.empty() && screened.front().evidence <= best.front().evidence)) return;
    best = std::move(screened);
    best_window = window;
  };
  attempt(best_window);
  for (std::size_t n = 1; n <= recent_.size(); ++n)
    if (stretches_ > n) attempt({true, n});
  window_ = best_window;
  return best;
}

FaultResponses::Scene FaultResponses::scene() const {
  Scene scene{prior(window_), latest(window_.stretches), point_, 0};
  scene.healthy_loss = model_.loss(scene.prior, scene.stretches);
  return scene;
}

// Parabolas through three losses: robust where the response bends.
RankedFault FaultResponses::refine(const Scene& scene, RankedFault start) const {
  const FaultHypothesis& h = hypotheses()[start.hypothesis];
  if (!std::isfinite(start.std)) return start;
  const double least = std::isinf(h.none) ? h.lowest : -kInfinity;
  const auto at = [&](double amplitude) {
    return model_.loss(scene.prior, scene.stretches, scene.point, {h.at(amplitude)});
  };
  double a = std::max(start.amplitude, least), here = at(a);
  double curvature = 1 / (start.std * start.std);
  for (std::size_t i = 0; i < settings_.refinements; ++i) {
    const double step = std::max(settings_.refine_step_fraction * std::abs(a), settings_.refine_step_sigma * start.std);
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
    const double wide = std::max(std::abs(a), settings_.refine_reach_sigma * start.std);
    const double newton =
        std::clamp(a - std::clamp(slope / (2 * curvature), -wide, wide), std::max(h.lowest, least), h.highest);
    const double l_newton = at(newton);
    if (l_newton < least_loss) {
      best = newton;
      least_loss = l_newton;
    }
    const bool done = here - least_loss < settings_.refine_settled_fraction * (scene.healthy_loss - least_loss);
    a = best;
    here = least_loss;
    if (done) break;
  }
  start.amplitude = a;
  start.evidence = scene.healthy_loss - here;
  start.std = 1 / std::sqrt(std::max(curvature, 1e-300));
  return start;
}

std::vector<RankedFault> FaultResponses::best_of(const Scene& scene, std::vector<RankedFault> screened,
                                                 std::map<std::size_t, double>* closely) const {
  // The linear answer misses what only a large fault does (a piston that no longer breaks away): a few sizes of each
  // are tried. While a fault lasts, those that explained it best when it was found start from what they were then; now
  // and then all are tried anew, since one stretch shows twins as one that three tell apart, or the other way round.
  const bool known = event_ && !candidates_.empty() && !power_of_two(age_);
  if (known) {
    const std::size_t looked = std::min(screened.size(), settings_.looked_hypotheses);
    screened.erase(std::remove_if(screened.begin() + static_cast<std::ptrdiff_t>(looked), screened.end(),
                                  [&](const RankedFault& f) { return candidates_.count(f.hypothesis) == 0; }),
                   screened.end());
  }
  // Those that screening puts first tell how good the others would have to be: most of them end after few rows.
  const std::size_t first =
      std::min(screened.size(), std::max(settings_.kept_hypotheses, settings_.refined_hypotheses));
  double worth = kInfinity;
  const auto attempt = [&](std::size_t i) {
    const FaultHypothesis& h = hypotheses()[screened[i].hypothesis];
    double least = worth;
    std::vector<double> sizes = {screened[i].amplitude};
    const auto before = candidates_.find(screened[i].hypothesis);
    if (known && before != candidates_.end()) sizes.push_back(before->second);
    if (!known)
      for (const double fraction : settings_.coarse_fractions)
        sizes.insert(sizes.end(), {fraction * h.highest, fraction * h.lowest});
    bool any = false;
    for (const double a : sizes) {
      if (a == 0 || (std::isinf(h.none) && a < h.lowest)) continue;
      const double found = model_.loss(scene.prior, scene.stretches, scene.point, {h.at(a)}, least);
      if (found >= least) continue;
      least = found;
      screened[i].amplitude = a;
      any = true;
    }
    screened[i].evidence = any ? scene.healthy_loss - least : -kInfinity;
  };
  in_parallel(first, settings_.jobs, attempt);
  worth = -kInfinity;
  for (std::size_t i = 0; i < first; ++i) worth = std::max(worth, scene.healthy_loss - screened[i].evidence);
  in_parallel(screened.size() - first, settings_.jobs, [&](std::size_t i) { attempt(first + i); });
  std::sort(screened.begin(), screened.end(), by_evidence);
  if (closely != nullptr) {
    closely->clear();
    for (std::size_t i = 0; i < std::min(settings_.kept_hypotheses, screened.size()); ++i)
      (*closely)[screened[i].hypothesis] = screened[i].amplitude;
  }
  screened.resize(std::min(screened.size(), settings_.refined_hypotheses));
  in_parallel(screened.size(), settings_.jobs, [&](std::size_t i) { screened[i] = refine(scene, screened[i]); });
  std::sort(screened.begin(), screened.end(), by_evidence);
  return screened;
}

// ---- the event

bool FaultResponses::over() const {
  const RankedFault& first = first_.front();
  ResponsePrior before = model_.tolerances(point_);
  if (window_.change) before.add(reference_);
  const Stretches last = latest(1);
  const double with = model_.loss(before, last, point_, {hypotheses()[first.hypothesis].at(first.amplitude)});
  return with > model_.loss(before, last) + settings_.over_evidence;
}

// The model with the first fault in it, and all looked for anew around that: segments count by what is left of them.
void FaultResponses::look_beside(const ResponsePrior& before) {
  const std::vector<FaultHypothesis>& all = hypotheses();
  const RankedFault first = first_.front();
  const double limit = std::max(settings_.threshold_evidence, settings_.second_evidence_fraction * first.evidence);
  // No second fault explains more than the first leaves.
  double left = 0;
  for (const Stretch* stretch : latest(window_.stretches)) left += stretch->misfit - healthy_usual_;
  if (left < settings_.second_misfit_fraction * limit) return;
  Scene scene{before, {}, point_, 0};
  scene.point.effects = {all[first.hypothesis].at(first.amplitude)};
  std::vector<std::unique_ptr<Stretch>> stretches;
  for (const Stretch* stretch : latest(window_.stretches)) {
    stretches.push_back(model_.prepare(stretch->run.recording));
    model_.respond(*stretches.back(), scene.point);
    model_.weigh(*stretches.back(), scene.point);
    scene.stretches.push_back(stretches.back().get());
  }
  std::vector<RankedFault> beside = screen(before, scene.stretches, false);
  const double alternative = settings_.alternative_evidence_fraction * first.evidence;
  beside.erase(
      std::remove_if(beside.begin(), beside.end(),
                     // What the first leaves at its own place, and what explains it nearly as well, is no second fault.
                     [&](const RankedFault& f) {
                       return all[f.hypothesis].port == all[first.hypothesis].port ||
                              std::any_of(first_.begin(), first_.end(), [&](const RankedFault& other) {
                                return other.hypothesis == f.hypothesis && other.evidence > alternative;
                              });
                     }),
      beside.end());
  if (beside.empty() || beside.front().evidence <= limit) return;
  beside.resize(std::min(beside.size(), settings_.kept_hypotheses));
  scene.healthy_loss = model_.loss(before, scene.stretches);
  beside = best_of(scene, beside);
  if (beside.front().evidence > limit) second_ = beside;
}

// Between refinements the size is followed; how the other hypotheses stand to it stays, unless the size has moved, for
// theirs have not been followed, or is at its bound, where another may go on.
bool FaultResponses::follow() {
  const Scene now = scene();
  const RankedFault followed = refine(now, first_.front());
  const double least = settings_.release_fraction * settings_.threshold_evidence;
  const auto grown = [](double value, double before, double ratio) {
    return value > ratio * before || value * ratio < before;
  };
  const FaultHypothesis& h = hypotheses()[followed.hypothesis];
  const bool at_bound = followed.amplitude <= h.lowest || followed.amplitude >= h.highest;
  if (followed.evidence < least || at_bound || grown(followed.evidence, refined_at_, settings_.grown_ratio) ||
      grown(std::abs(followed.amplitude), std::abs(refined_amplitude_), settings_.moved_ratio))
    return false;
  const double ratio = followed.evidence / first_.front().evidence;
  for (RankedFault& f : first_) f.evidence *= ratio;
  first_.front() = followed;
  evidence_ = followed.evidence;
  know_fault(now);
  return true;
}

void FaultResponses::end_event() {
  event_ = false;
  age_ = 0;
  first_.clear();
  second_.clear();
  know_healthy();
}

void FaultResponses::judge(const Recording& recording) {
  recent_.push_back(model_.prepare(recording));
  ++stretches_;
  const bool growing = event_ && window_.stretches < settings_.recent_stretches;
  const unsigned age = event_ ? age_ + 1 : stretches_;
  const bool early = !event_ && stretches_ <= settings_.early_stretches;
  const bool due = early || power_of_two(age) || age % settings_.refresh_stretches == 0;
  if (!growing && !early && says_nothing_new()) {
    if (event_ || !due) {
      pass_over();
      if (!event_ || !due) return;
      respond_all();
      // How two faults share what is seen is worth another look where the motion shows them.
      if (!follow() || second_.empty()) return;
      weigh_all();
      find_healthy_or_fault();
      return;
    }
    // What was not looked at so far said nothing either.
    recent_.erase(std::remove_if(recent_.begin(), recent_.end() - 1, [](const auto& s) { return !s->responded; }),
                  recent_.end() - 1);
  }
  if (recent_.size() > settings_.recent_stretches && !recent_.front()->responded) forget_oldest();
  respond_all();
  learn_parameters();
  forget_oldest();
  if (event_ && over()) {
    // What the recent stretches hold belongs to neither state.
    recent_.erase(recent_.begin(), recent_.end() - 1);
    event_ = false;
    age_ = 0;
  }
  if (event_) {
    ++age_;
    window_.stretches = std::min(window_.stretches + 1, recent_.size());
    // While a fault lasts, all causes are weighed ever more rarely, unless it grows.
    if (!growing && !power_of_two(age_) && follow()) return;
  }
  weigh_all();
  find_healthy_or_fault();
}

void FaultResponses::find_healthy_or_fault() {
  std::vector<RankedFault> screened = find_window();
  // Before anything is blamed on the first stretches: are the parameters further off than the linear model can tell?
  const double suspicion = settings_.suspicion_fraction * settings_.threshold_evidence;
  for (std::size_t i = 0; i < settings_.parameter_moves && stretches_ <= settings_.early_stretches && !event_ &&
                          !screened.empty() && screened.front().evidence > suspicion && search_parameters();
       ++i) {
    relinearise();
    weigh_all();
    screened = find_window();
  }
  // Screening takes the model's answer for linear and so finds too much, never too little by far.
  evidence_ = screened.empty() ? 0 : screened.front().evidence;
  const double limit = (event_ ? settings_.release_fraction : 1.0) * settings_.threshold_evidence;
  if (evidence_ < limit) {
    end_event();
    return;
  }
  const Scene now = scene();
  std::map<std::size_t, double> closely;
  const std::vector<RankedFault> ranked = best_of(now, screened, &closely);
  candidates_ = closely;
  for (const RankedFault& f : ranked) candidates_[f.hypothesis] = f.amplitude;
  if (!ranked.empty()) evidence_ = ranked.front().evidence;
  if (ranked.empty() || evidence_ < limit) {
    end_event();
    return;
  }
  first_ = ranked;
  second_.clear();
  refined_at_ = evidence_;
  refined_amplitude_ = first_.front().amplitude;
  know_fault(now);
  look_beside(now.prior);
  if (!second_.empty()) know_fault(now);
  if (!event_) {
    since_ = recent_[recent_.size() - window_.stretches]->begin;
    event_ = true;
    age_ = 1;
  }
}

// ---- what could be seen

// Parameters are known to their tolerance and from as much healthy motion as there is with the fault.
Eigen::MatrixXd FaultResponses::information() const {
  ResponseSums sums = reference_;
  for (const auto& stretch : recent_)
    if (stretch->weighed) sums.add(stretch->sums);
  const Eigen::Index t = point_.shift.size();
  return sums.dd - sums.td.transpose() *
                       Eigen::LDLT<Eigen::MatrixXd>(Eigen::MatrixXd::Identity(t, t) + 2 * sums.tt).solve(sums.td);
}

std::vector<double> FaultResponses::amplitude_errors() const {
  const Eigen::VectorXd left = information().diagonal();
  std::vector<double> result(hypotheses().size(), kInfinity);
  for (std::size_t h = 0; h < result.size(); ++h) {
    const double information = left[static_cast<Eigen::Index>(h)];
    if (information > settings_.least_response) result[h] = 1 / std::sqrt(information);
  }
  return result;
}

Eigen::MatrixXd FaultResponses::cosines() const {
  Eigen::MatrixXd left = information();
  const Eigen::VectorXd length = left.diagonal().cwiseMax(settings_.least_response).cwiseSqrt();
  const double least = 1.01 * std::sqrt(settings_.least_response);
  for (Eigen::Index i = 0; i < left.rows(); ++i)
    for (Eigen::Index j = 0; j < left.cols(); ++j)
      left(i, j) = length[i] > least && length[j] > least ? left(i, j) / (length[i] * length[j]) : 0;
  return left;
}

}  // namespace faultline
