#include "faultline/estimators/fault_responses.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/screening.h"
#include "faultline/estimators/amplitude_information.h"
#include "faultline/estimators/stretch_collector.h"

namespace faultline {
namespace {

bool power_of_two(unsigned count) { return (count & (count - 1)) == 0; }

}  // namespace

FaultResponses::FaultResponses(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet),
      settings_(settings),
      model_(sheet, settings),
      point_(model_.nominal()),
      reference_(model_.no_sums()),
      known_(model_),
      lost_(settings),
      confirmation_(settings) {
  reset();
}

void FaultResponses::reset() {
  event_ = explained_ = shows_ = false;
  lost_.reset();
  confirmation_.withdraw();
  recent_.clear();
  point_ = model_.nominal();
  reference_ = model_.no_sums();
  doubt_ = 0;
  stretches_ = age_ = 0;
  first_.clear();
  second_.clear();
  reading_ = {};
  before_ = {};
  past_.clear();
  candidates_.clear();
  evidence_ = 0;
  known_.forget_starts();
  known_.forget_misfits();
  know_healthy();
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

Eigen::VectorXd FaultResponses::theta() const {
  Eigen::MatrixXd all = known_to_tolerance(point_.shift) + known_part(reference_);
  for (const auto& stretch : recent_)
    if (stretch->responded) all += known_part(stretch->sums);
  return best_parameters(all, model_.parameters());
}

void FaultResponses::know_healthy() {
  if (lost_.strange()) return;  // what is not understood is not the usual
  known_.learn_healthy(point_, theta(), recent_);
}

double FaultResponses::unexplained(const Stretch& stretch) const { return model_.left_of(stretch, theta()).evidence; }

double FaultResponses::unexplained(double usual) const {
  double sum = doubt_;
  for (const auto& stretch : recent_) {
    if (!stretch->responded) continue;
    const double left = unexplained(*stretch) - usual;
    sum += usual > 0 ? std::max(0.0, left) : left;
  }
  return sum;
}

void FaultResponses::know_fault(const Scene& scene) {
  Eigen::MatrixXd after;
  model_.loss(scene.prior, scene.stretches, scene.point, found_effects(), kInfinity, &after);
  known_.learn_fault(point_, best_parameters(after, model_.parameters()), found_effects(), recent_, window_.stretches);
}

// A cause says nothing against another reading of the latest stretch where it could explain that stretch better with
// parameters of its own: what a stretch at rest says of friction says little of one that moves.
std::vector<ModelPoint> FaultResponses::explanations() const {
  std::vector<ModelPoint> points = {known_.known()};
  const auto explain_by = [&](const std::vector<EffectSpec>& effects) {
    Eigen::MatrixXd after;
    model_.loss(known_to_tolerance(point_.shift), latest(1), point_, effects, kInfinity, &after);
    points.push_back(model_.known(point_, best_parameters(after, model_.parameters()), effects));
    points.push_back(model_.known(point_, Eigen::VectorXd::Zero(model_.parameters()), effects));
  };
  for (const RankedFault& cause : first_) {
    std::vector<EffectSpec> effects = found_effects();
    effects.front() = hypotheses()[cause.hypothesis].at(cause.amplitude);
    explain_by(effects);
    if (effects.size() > 1) explain_by({effects.front()});
  }
  return points;
}

bool FaultResponses::says_nothing_new() {
  Stretch& last = *recent_.back();
  const double suspicion = settings_.suspicion_fraction * settings_.threshold_evidence;
  const double news = settings_.new_fraction * settings_.threshold_evidence;
  const double latest = known_.beyond(last, news);
  double beyond = 0, most = 0;
  for (auto stretch = recent_.rbegin(); stretch != recent_.rend(); ++stretch) {
    beyond += known_.beyond(**stretch);
    most = std::max(most, beyond);
  }
  if (!event_) {
    if (latest <= news || most <= suspicion) {
      lost_.pass(latest);
      evidence_ = std::min(most, suspicion);
      return true;
    }
    return false;
  }
  return latest <= std::max(news, settings_.followed_fraction * first_.front().evidence);
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

// The latest stretches, and of those before what does not end in these.
void FaultResponses::weigh_all() {
  respond_all();
  const double usual = event_ ? 0 : known_.inexplicable();
  double before = unexplained(usual);
  shown_ = 0;
  for (auto stretch = recent_.rbegin(); stretch != recent_.rend(); ++stretch) {
    if (shown_ >= (event_ ? window_.stretches : 1) && before <= settings_.over_evidence) break;
    model_.weigh(**stretch, point_);
    before -= std::max(0.0, unexplained(**stretch) - usual);
    ++shown_;
  }
}

// ---- parameters

void FaultResponses::learn_parameters() {
  const bool calm = evidence_ < settings_.suspicion_fraction * settings_.threshold_evidence;
  if (event_ || lost() || (stretches_ > settings_.early_stretches && !(calm && power_of_two(stretches_)))) return;
  for (std::size_t i = 0; i < settings_.parameter_moves && relinearise(); ++i) {
  }
}

// Moves the parameters to what all stretches say of them.
bool FaultResponses::relinearise() {
  const Eigen::VectorXd& shift = point_.shift;
  Eigen::MatrixXd sums = known_to_tolerance(shift) + known_part(reference_);
  for (const auto& stretch : recent_) sums += known_part(stretch->sums);
  Eigen::VectorXd step = best_parameters(sums, model_.parameters());
  step.tail(shift.size() - static_cast<Eigen::Index>(model_.free_parameters())).setZero();
  const double farthest = settings_.farthest_tolerances;
  step = (shift + step).cwiseMax(-farthest).cwiseMin(farthest) - shift;
  if (step.cwiseAbs().maxCoeff() < settings_.relinearise_tolerances) return false;
  move(step);
  return true;
}

// What is known of the parameters with the point moved: by the tolerances, and by stretches before.
Eigen::MatrixXd FaultResponses::known_from(const Eigen::VectorXd& step) const {
  Eigen::MatrixXd before = known_part(reference_);
  before.topRows(1) += step.transpose() * before.bottomRows(step.size());
  before.leftCols(1) += before.rightCols(step.size()) * step;
  return known_to_tolerance(point_.shift + step) + before;
}

// One parameter at a time, as far as the model's own residuals say: where they bend too much for the linear model. The
// first two reaches, one to each side, tell whether they do, since what the linear model foresees changes no loss. To
// second order both sides change it alike, so one that changes it by less than half of what counts spares the other;
// but not while little is learnt: what the linear model took too far changes little beyond, and much on the way back.
// `straight`: parameters that did not bend before the last move, which are left out; takes those of this time too.
bool FaultResponses::search_parameters(const Stretches& all, std::vector<bool>& straight) {
  const double now = model_.loss(known_from(Eigen::VectorXd::Zero(point_.shift.size())), all);
  const double bent = settings_.bent_fraction * settings_.worthwhile_evidence;
  double least = now - settings_.worthwhile_evidence;
  Eigen::VectorXd best = Eigen::VectorXd::Zero(point_.shift.size());
  straight.resize(model_.free_parameters(), false);
  const bool early = stretches_ <= settings_.early_stretches;
  for (std::size_t i = 0; i < model_.free_parameters(); ++i) {
    if (straight[i]) continue;
    bool bends = false, hardly = false;
    for (std::size_t k = 0; k < settings_.reach_tolerances.size() && (k < 2 ? early || !hardly : bends); ++k) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(point_.shift.size());
      step[static_cast<Eigen::Index>(i)] = settings_.reach_tolerances[k];
      const ModelPoint tried = model_.at(point_.shift + step);
      const double found = model_.loss(known_from(step), all, tried, {}, k < 2 ? now + bent : least);
      bends = bends || std::abs(found - now) > bent;
      hardly = k == 0 && std::abs(found - now) < 0.5 * bent;
      if (found >= least) continue;
      least = found;
      best = step;
    }
    straight[i] = !bends;
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
  doubt_ = 0;
  known_.forget_misfits();
  for (auto& stretch : recent_) model_.follow(*stretch, point_);
}

void FaultResponses::keep_healthy(const Recording& recording) {
  before_ = recording;
  past_.push_back(recording);
  if (past_.size() > settings_.past_stretches) past_.pop_front();
}

void FaultResponses::forget_oldest() {
  if (recent_.size() <= settings_.recent_stretches) return;
  if (!lost_.strange() || recent_.front()->begin < lost_.since()) remember_oldest();
  recent_.erase(recent_.begin());
}

void FaultResponses::remember_oldest() {
  const Stretch& oldest = *recent_.front();
  if (!event_ && oldest.responded) {
    const double kept = 1 - 1 / settings_.memory_stretches;
    const double left = unexplained(oldest) - known_.inexplicable();
    doubt_ = kept * doubt_ + (oldest.weighed ? 0 : std::max(0.0, left));
    reference_ = kept * reference_ + oldest.sums;
  } else if (window_.change && recent_.size() > window_.stretches + 1 && oldest.responded) {
    // Of before the fault: without it the parameters would be free to explain a part of the fault.
    reference_ += oldest.sums;
  }
  if (!event_) keep_healthy(oldest.run.recording);
}

// ---- hypotheses

Eigen::MatrixXd FaultResponses::prior(const Window& window) const {
  Eigen::MatrixXd prior = known_to_tolerance(point_.shift);
  if (!window.change) return prior;
  prior += known_part(reference_);
  for (std::size_t i = 0; i + window.stretches < recent_.size(); ++i) prior += known_part(recent_[i]->sums);
  return prior;
}

std::vector<RankedFault> FaultResponses::screen(const Window& window) const {
  Eigen::MatrixXd sums = window.change ? model_.no_sums() : reference_;
  for (const Stretch* stretch : latest(window.stretches)) sums += stretch->sums;
  known_part(sums) += prior(window);
  return faultline::screen(model_, sums);
}

std::vector<RankedFault> FaultResponses::find_window() {
  // Once there is a fault, the way it was found stays: what follows belongs to it. What was suspected and not confirmed
  // in time may be another one, which came later and shows more.
  if (event_ && (confirmation_.given() || undecided())) return screen(window_);
  std::vector<RankedFault> best;
  // A stretch that adds little does not show the fault: the shortest of windows that say nearly the same.
  const auto attempt = [&](const Window& window) {
    std::vector<RankedFault> screened = screen(window);
    if (screened.empty() ||
        (!best.empty() && screened.front().evidence <= (1 + settings_.longer_fraction) * best.front().evidence))
      return;
    best = std::move(screened);
    window_ = window;
  };
  window_ = {false, recent_.size()};
  for (std::size_t n = 1; n <= shown_; ++n)
    if (stretches_ > n) attempt({true, n});
  if (shown_ == recent_.size()) attempt(Window{false, recent_.size()});
  return best;
}

Scene FaultResponses::scene() const {
  Scene scene{prior(window_), latest(window_.stretches), point_, 0};
  scene.healthy_loss = model_.loss(scene.prior, scene.stretches);
  return scene;
}

std::map<std::size_t, double> FaultResponses::remembered() const {
  // Now and then all are tried anew: one stretch shows twins as one that three tell apart, or the other way round.
  return event_ && (!power_of_two(age_) || age_ < settings_.recent_stretches) ? candidates_
                                                                              : std::map<std::size_t, double>();
}

// ---- the event

double FaultResponses::speaks_for() const {
  const RankedFault& first = first_.front();
  Eigen::MatrixXd before = known_to_tolerance(point_.shift);
  if (window_.change) before += known_part(reference_);
  const Stretches last = latest(1);
  return model_.loss(before, last) -
         model_.loss(before, last, point_, {hypotheses()[first.hypothesis].at(first.amplitude)});
}

// A change that began before much was learnt is weighed once more, when it is about to be told, against parameters that
// were learnt badly: the stretches that confirm it may show them where those in which it was found did not.
void FaultResponses::doubt_once_more() {
  const double since = since_;
  event_ = false;
  confirmation_.withdraw();
  weigh_all();
  find_healthy_or_fault();
  if (!event_) return;
  since_ = std::min(since, since_);
  confirmation_.give();
}

void FaultResponses::look_beside(const Eigen::MatrixXd& before) {
  const double limit =
      std::max(settings_.threshold_evidence, settings_.second_evidence_fraction * first_.front().evidence);
  // No second fault explains more than the first leaves.
  double left = 0;
  for (const Stretch* stretch : latest(window_.stretches)) left += stretch->misfit - known_.healthy();
  if (left < settings_.second_misfit_fraction * limit) return;
  second_ = beside(model_, {before, latest(window_.stretches), point_, 0}, first_, limit, remembered());
}

// Between refinements the size is followed; how the other hypotheses stand to it stays, unless the size has moved, for
// theirs have not been followed, or is at its bound, where another may go on.
bool FaultResponses::follow() {
  const Scene now = scene();
  const RankedFault followed = refine(model_, now, first_.front());
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
  confirmation_.withdraw();
  age_ = 0;
  first_.clear();
  second_.clear();
  reading_ = {};
  know_healthy();
}

// Looks for a fault that came later than the event was found, in the latest stretches that speak for it alone. False,
// and nothing is changed, where these do not show it.
bool FaultResponses::look_since(const Scene& now, std::vector<RankedFault>& ranked) {
  const Window before = window_;
  window_ = {true, speaking_alone(model_, now, ranked.front())};
  const std::vector<RankedFault> found = best_of(model_, scene(), screen(window_), {});
  if (found.empty() || found.front().evidence < settings_.threshold_evidence) {
    window_ = before;
    return false;
  }
  ranked = found;
  return true;
}

void FaultResponses::judge(const Recording& recording) {
  recent_.push_back(model_.prepare(recording));
  was_given_ = event_ && confirmation_.given();
  ++stretches_;
  shows_ = shows_ || moves(sheet_, recording);
  judge_stretch();
  // Weighing a stretch is dear, and one in which nothing moves is like those before.
  if (!shows_ && power_of_two(stretches_)) look_what_shows();
}

// While a transducer is stuck no stretch is explained by a cause, so none speaks for the one that came nearest: whether
// it is stuck still is all that is asked.
bool FaultResponses::stays_stuck() {
  if (!event_ || !reading_.is_stuck()) return false;
  const bool given = confirmation_.given();
  if (contradicts(sheet_, model_, *recent_.back(), {known_before_}, known_before_, reading_)) {
    reading_ = {};
    if (!given) return false;
    recent_.erase(recent_.begin(), recent_.end() - 1);
    end_event();
    return false;
  }
  confirmation_.give();
  pass_over();
  return true;
}

void FaultResponses::judge_stretch() {
  if (stays_stuck()) return;
  const bool growing = event_ && window_.stretches < settings_.recent_stretches;
  const unsigned age = event_ ? age_ + 1 : stretches_;
  const bool early = !event_ && stretches_ <= settings_.early_stretches;
  const bool due = early || power_of_two(age) || age % settings_.refresh_stretches == 0;
  if (!growing && !early && says_nothing_new()) {
    if (event_ || !due) {
      pass_over();
      if (event_ && !confirmation_.given()) {
        respond_all();
        confirmation_.hear(speaks_for());
        if (confirmation_.given() && young_) return doubt_once_more();
      }
      if (!event_ || !due) return;
      respond_all();
      // How two faults share what is seen is worth another look where the motion shows them.
      if (!follow() || second_.empty()) return;
      weigh_all();
      find_healthy_or_fault();
      return;
    }
    // What was not looked at so far said nothing either.
    const auto unseen = [](const auto& stretch) { return !stretch->responded; };
    for (auto stretch = recent_.begin(); stretch != recent_.end() - 1; ++stretch)
      if (unseen(*stretch)) keep_healthy((*stretch)->run.recording);
    recent_.erase(std::remove_if(recent_.begin(), recent_.end() - 1, unseen), recent_.end() - 1);
  }
  if (recent_.size() > settings_.recent_stretches && !recent_.front()->responded) forget_oldest();
  respond_all();
  learn_parameters();
  forget_oldest();
  if (event_ && over()) {
    // What the recent stretches hold belongs to neither state.
    recent_.erase(recent_.begin(), recent_.end() - 1);
    event_ = false;
    confirmation_.withdraw();
    reading_ = {};
    age_ = 0;
  }
  if (event_) {
    if (!confirmation_.given()) {
      confirmation_.hear(speaks_for());
      if (confirmation_.given() && young_) return doubt_once_more();
    }
    ++age_;
    window_.stretches = std::min(window_.stretches + 1, recent_.size());
    // While a fault lasts, all causes are weighed ever more rarely, unless it grows.
    if (!growing && !power_of_two(age_) && follow()) return;
  }
  const double left = unexplained();
  explained_ = !event_ && left < settings_.explained_ratio * settings_.threshold_evidence &&
               model_.left_of(*recent_.back(), theta()).mean_square <= settings_.far_off_variances;
  if (!event_) {
    const Stretch& last = *recent_.back();
    lost_.hear(last.begin, explained_ ? 0 : known_.beyond(last), unexplained(last));
  }
  // Now and then causes are weighed for less, so that what no cause explains is known anew.
  const double explicable = due ? left : unexplained(known_.inexplicable());
  if (!event_ && settings_.refresh_stretches > 1 && explicable < weighed_from(settings_)) {
    evidence_ = std::max(0.0, explicable);
    end_event();
    return;
  }
  weigh_all();
  find_healthy_or_fault();
}

void FaultResponses::find_healthy_or_fault() {
  const std::size_t suspected = event_ ? window_.stretches : 0;
  std::vector<RankedFault> screened = find_window();
  // Before anything is blamed: are the parameters further off than the linear model can tell? Later on healthy
  // stretches of before must be explained as well, or a fault that moves a parameter would pass for one that was
  // learnt badly.
  const bool early = stretches_ <= settings_.early_stretches;
  const double doubtful = (early ? settings_.suspicion_fraction : 1.0) * settings_.threshold_evidence;
  std::vector<std::unique_ptr<Stretch>> past;
  if (!event_ && !early && !screened.empty() && screened.front().evidence > doubtful)
    for (const Recording& recording : past_) {
      past.push_back(model_.prepare(recording));
      model_.respond(*past.back(), point_);
    }
  const auto all = [&] {
    Stretches stretches = latest(recent_.size());
    for (const auto& stretch : past) stretches.push_back(stretch.get());
    return stretches;
  };
  const auto loss = [&] { return model_.loss(known_to_tolerance(point_.shift), all()); };
  std::vector<bool> straight;
  for (std::size_t i = 0; i < settings_.parameter_moves && !event_ && (early || !past.empty()) && !screened.empty() &&
                          screened.front().evidence > doubtful;
       ++i) {
    const double before = loss();
    if (!search_parameters(all(), straight)) break;
    if (early) relinearise();
    for (auto& stretch : past) model_.follow(*stretch, point_);
    weigh_all();
    screened = find_window();
    if (loss() > before - settings_.worthwhile_evidence) break;  // the linear model took it back
  }
  // Screening takes the model's answer for linear and so finds too much, never too little by far.
  evidence_ = screened.empty() ? 0 : screened.front().evidence;
  const double limit = event_ ? settings_.release_fraction * settings_.threshold_evidence
                              : std::max(settings_.threshold_evidence, lost_.least());
  if (evidence_ < limit) {
    if (!event_ && !lost_.strange())
      known_.learn_inexplicable((unexplained() - doubt_ - evidence_) / static_cast<double>(recent_.size()));
    end_event();
    return;
  }
  Scene now = scene();
  std::map<std::size_t, double> closely;
  std::vector<RankedFault> ranked = best_of(model_, now, screened, remembered(), &closely);
  // What explains as much as another that came later keeps its name.
  const bool later = event_ && !ranked.empty() && ranked.front().evidence >= settings_.threshold_evidence &&
                     came_later(model_, now, found_, ranked.front()) &&
                     !put_first(ranked, found_.cause.hypothesis, settings_.threshold_evidence) &&
                     look_since(now, ranked);
  if (later) now = scene();
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
  if (!event_ || later || window_.stretches < suspected) {
    const std::size_t healthy = recent_.size() - window_.stretches;
    const Stretch& shows = *recent_[healthy];
    since_ = lost() ? std::min(lost_.since(), shows.begin)
             : window_.change
                 ? onset(model_, now, healthy > 0 ? recent_[healthy - 1].get() : nullptr, shows, found_effects())
                 : shows.begin;
    lost_.end();
    if (window_.change && healthy > 0) before_ = recent_[healthy - 1]->run.recording;
    found_ = found_in(model_, now, first_.front());
    event_ = true;
    young_ = window_.change && stretches_ <= settings_.early_stretches;
    age_ = 1;
    confirmation_.withdraw();
  }
  // What one stretch has shown stays until another contradicts it: the next may not move enough.
  const Stretch& last = *recent_.back();
  const std::vector<ModelPoint> causes = explanations();
  const ModelPoint healthy = model_.known(point_, best_parameters(now.prior, model_.parameters()), {});
  if (!reading_.text.empty() && contradicts(sheet_, model_, last, causes, healthy, reading_)) reading_ = {};
  if (reading_.text.empty()) reading_ = better_reading(sheet_, model_, last, causes, healthy, window_.change, before_);
  // A cause that other stretches have confirmed was there before: what got stuck beside it must be sure.
  if (was_given_ && reading_.is_stuck() && reading_.lead < kSureLead) reading_ = {};
  known_before_ = healthy;
  confirmation_.found(evidence_);
  if (reading_.is_stuck() && reading_.lead >= kSureLead) confirmation_.give();
}

// ---- what could be seen

void FaultResponses::look_what_shows() {
  if (!recent_.back()->responded) model_.respond(*recent_.back(), point_);
  model_.weigh(*recent_.back(), point_);
  shows_ = every_place_shows(hypotheses(), amplitude_errors(), settings_.threshold_evidence);
}

Eigen::MatrixXd FaultResponses::information() const {
  Eigen::MatrixXd sums = reference_;
  for (const auto& stretch : recent_)
    if (stretch->weighed) sums += stretch->sums;
  return amplitude_information(std::move(sums), model_.parameters());
}

std::vector<double> FaultResponses::amplitude_errors() const {
  return faultline::amplitude_errors(information(), settings_.least_response);
}

Eigen::MatrixXd FaultResponses::cosines() const { return response_cosines(information(), settings_.least_response); }

}  // namespace faultline
