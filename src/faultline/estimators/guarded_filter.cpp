#include "faultline/estimators/guarded_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kShortest = 1e-6, kLongest = 1e8;  // s, of times that a datasheet may set
constexpr double kFollows = 0.5;                    // of the motion that it usually shows, at least
constexpr double kLeastMotion = 0.25;               // of `least`: of a motion that tells whether a reading follows
constexpr double kSigmas = 2;                       // by which a gain is below that
constexpr double kUnknown = 0.15;                   // of `least`: standard deviation that no learning goes below
constexpr double kSuspicious = 0.5;                 // of the margin, from which nothing is learnt
constexpr double kRest = 4;                         // of what a lie leaves, a channel: of chi square with one degree
constexpr std::size_t kPerGuard = 3;                // quantities

}  // namespace

GuardedFilter::GuardedFilter(const Datasheet& sheet, const StageSpec& spec)
    : model_(make_process_model(spec.settings.word("model"), sheet, spec.settings)),
      measured_(model_->measured_channels()),
      states_(model_->states().size()),
      period_(sheet.sample_period),
      average_(spec.settings.number("average", kShortest, kLongest)),
      learn_(spec.settings.number("learn", kShortest, kLongest)),
      memory_(spec.settings.number("memory", kShortest, kLongest)),
      release_(spec.settings.number("release", 0, kLongest)),
      margin_(spec.settings.number("margin", 0, 1e6)) {
  const Settings& settings = spec.settings;
  if (model_->observed_states().empty() || !model_->parts().empty())
    throw InputError("guarded_filter: this process model's measurements are not plainly states of one model");
  const std::string type = settings.word("filter");
  main_ = make_state_estimator(type, *model_);
  reference_ = make_state_estimator(type, *model_);
  const std::vector<double> least = settings.list("least", measured_.size(), 0, 1e300);
  for (std::size_t row = 0; row < measured_.size(); ++row) {
    const Channel& channel = sheet.channels[static_cast<std::size_t>(measured_[row])];
    names_.push_back(channel.name);
    if (!(least[row] > 0)) {
      unwatched_.push_back(row);
      continue;
    }
    guards_.emplace_back();
    Guard& guard = guards_.back();
    guard.row = row;
    guard.state = static_cast<std::size_t>(model_->observed_states()[row]);
    guard.channel = channel.name;
    guard.unit = channel.unit;
    guard.minimum = channel.minimum;
    guard.maximum = channel.maximum;
    guard.least = least[row];
    guard.noise = model_->measurement_noise()[row];
    guard.without = make_state_estimator(type, *model_);
  }
  usual_.setZero(static_cast<Eigen::Index>(guards_.size()), static_cast<Eigen::Index>(guards_.size()));
  if (guards_.size() < 2) throw InputError(settings.where() + ": 'least' is to watch two channels or more (above 0)");
}

void GuardedFilter::begin(const double* channels) {
  std::array<double, kMaximumStates> state{}, variance{};
  model_->initial(channels, state.data(), variance.data());
  main_->reset(state.data(), variance.data());
  reference_->reset(state.data(), variance.data());
  model_->take_inputs(channels);
  for (Guard& guard : guards_) {
    guard.without->reset(state.data(), variance.data());
    guard.trusted = guard.readable = true;
    guard.frozen = false;
    guard.reading = guard.predicted = state[guard.state];
    guard.slow_reading = guard.slow_reference = guard.reading;
    guard.own = guard.both = guard.motion = guard.calm = guard.silent = 0;
    guard.off = guard.usual_off = guard.apart = guard.usual_apart = guard.usual_gain = guard.moved = 0;
    guard.spread = 0;
  }
  usual_.setZero();
  age_ = 0;
  seen_ = average_;
  quiet_ = true;
  observed_ = 0;
}

bool GuardedFilter::advance(const double* channels, const ChannelStatus* status, double dt, int steps) {
  std::array<double, kMaximumOutputs> y{};
  std::array<bool, kMaximumOutputs> readable{}, use{};
  model_->measurement(channels, y.data());
  for (std::size_t i = 0; i < measured_.size(); ++i)
    use[i] = readable[i] = status[measured_[i]] == ChannelStatus::good && std::isfinite(y[i]);
  for (Guard& guard : guards_) {
    guard.readable = readable[guard.row];
    if (guard.readable) guard.reading = y[guard.row];
    use[guard.row] = guard.readable && guard.trusted;
  }
  if (model_->inputs_at_end()) model_->take_inputs(channels);
  for (int i = 0; i < steps; ++i) {
    const double step = dt / steps, noise_scale = step / period_;
    main_->predict(step, noise_scale);
    reference_->predict_beside(*main_, step, noise_scale);
    for (const Guard& guard : guards_) guard.without->predict_beside(*main_, step, noise_scale);
  }
  main_->correct(y.data(), use.data());
  observed_ =
      static_cast<int>(std::count(use.begin(), use.begin() + static_cast<std::ptrdiff_t>(measured_.size()), true));
  for (const Guard& guard : guards_) {
    const bool was = use[guard.row];
    use[guard.row] = false;
    guard.without->correct(y.data(), use.data());
    use[guard.row] = was;
  }
  for (const Guard& guard : guards_) use[guard.row] = false;
  reference_->correct(y.data(), use.data());
  model_->take_inputs(channels);
  age_ += dt;
  const bool all = std::all_of(unwatched_.begin(), unwatched_.end(), [&](std::size_t row) { return readable[row]; });
  seen_ = all ? seen_ + dt : 0;
  look(dt);
  if (age_ < average_ + learn_ || quiet_) follow(dt);
  if (age_ >= average_ + learn_) {
    accuse();
    forgive(dt);
  }
  return std::all_of(main_->state(), main_->state() + states_, [](double v) { return std::isfinite(v); });
}

void GuardedFilter::look(double dt) {
  const double soon = std::min(1.0, dt / std::min(average_, age_)), late = std::min(1.0, dt / std::min(learn_, age_));
  std::array<double, kMaximumStates * kMaximumStates> covariance;
  for (Guard& guard : guards_) {
    const std::size_t state = guard.state;
    guard.without->covariance(covariance.data());
    guard.predicted = guard.without->state()[state];
    guard.predicted_variance = covariance[state * (states_ + 1)];
    // At the end of its range it may be right: the process is there, or beyond.
    const double there = stand_in(guard);
    const bool beyond = there > guard.maximum - guard.least || there < guard.minimum + guard.least;
    guard.silent = guard.readable || beyond ? 0 : guard.silent + dt;
    if (!guard.readable) continue;
    const double reference = reference_->state()[state];
    const double own = guard.reading - guard.slow_reading, moved = reference - guard.slow_reference;
    guard.slow_reading += late * own;
    guard.slow_reference += late * moved;
    guard.own += late * (own * own - guard.own);
    guard.both += late * (own * moved - guard.both);
    guard.motion += late * (moved * moved - guard.motion);
    guard.off += soon * (guard.reading - reference - guard.off);
    guard.apart += soon * (guard.reading - guard.predicted - guard.apart);
  }
}

bool GuardedFilter::tells(const Guard& guard) const {
  return guard.motion > kLeastMotion * kLeastMotion * guard.least * guard.least;
}

void GuardedFilter::follow(double dt) {
  if (age_ < average_) return;
  const double gain = std::min(1.0, dt / std::min(memory_, age_ - average_ + dt));
  for (std::size_t i = 0; i < guards_.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j)
      usual_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) +=
          gain * (change(guards_[i]) * change(guards_[j]) -
                  usual_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  for (Guard& guard : guards_) {
    guard.usual_off += gain * (guard.off - guard.usual_off);
    guard.usual_apart += gain * (guard.apart - guard.usual_apart);
    const double missed = guard.reading - stand_in(guard);
    if (guard.readable) guard.spread += gain * (missed * missed - guard.spread);
    double sigma = 0;
    if (age_ < learn_ || !tells(guard) || follows(guard, sigma) < kFollows) continue;
    guard.moved += dt;
    guard.usual_gain +=
        std::min(1.0, dt / std::min(memory_, guard.moved)) * (guard.both / guard.motion - guard.usual_gain);
  }
}

// How much of the motion a reading follows, in parts of what is usual; sigma infinite where there is too little.
double GuardedFilter::follows(const Guard& guard, double& sigma) const {
  sigma = INFINITY;
  if (!tells(guard) || !(guard.usual_gain > 0)) return 1;
  const double gain = guard.both / guard.motion, rest = std::max(0.0, guard.own - gain * guard.both - guard.noise);
  sigma = std::sqrt((rest * average_ + guard.noise * period_) / (2 * learn_ * guard.motion)) / guard.usual_gain;
  return gain / guard.usual_gain;
}

// Whether the lie of one channel explains what has changed, as the header tells: the channel, by how much it lies, and
// by how much less likely the next best is. None where fewer than two are trusted.
GuardedFilter::Suspect GuardedFilter::suspect() const {
  std::array<std::size_t, kMaximumOutputs> who{};
  Eigen::Index n = 0;
  for (std::size_t i = 0; i < guards_.size(); ++i)
    if (guards_[i].trusted) who[static_cast<std::size_t>(n++)] = i;
  if (n < 2) return {};
  Covariance c(n, n);
  Outputs d(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t a = who[static_cast<std::size_t>(i)];
    d[i] = change(guards_[a]) / guards_[a].least;
    for (Eigen::Index j = 0; j <= i; ++j) {
      const std::size_t b = who[static_cast<std::size_t>(j)];
      c(i, j) =
          usual_(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) / guards_[a].least / guards_[b].least;
    }
    c(i, i) += kUnknown * kUnknown;
  }
  // d'e, of which all that is explained is a part, is at most |d|^2/kUnknown^2.
  if (d.squaredNorm() <= kUnknown * kUnknown * kSuspicious * margin_) return {};
  const Eigen::LLT<Covariance> root(c);
  const Outputs explained = root.solve(d);
  Suspect found;
  double most = 0, next = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    Outputs alone = Outputs::Zero(n);
    alone[i] = 1;
    root.solveInPlace(alone);
    const double gain = explained[i] * explained[i] / alone[i];
    if (gain > most) {
      next = most;
      most = gain;
      found.guard = who[static_cast<std::size_t>(i)];
      found.lie = std::abs(explained[i] / alone[i]);
    } else {
      next = std::max(next, gain);
    }
  }
  found.margin = most - next;
  found.plausible = d.dot(explained) - most < kRest * static_cast<double>(n - 1);
  return found;
}

void GuardedFilter::accuse() {
  const Suspect now = suspect();
  const bool trusted = std::all_of(guards_.begin(), guards_.end(), [](const Guard& g) { return g.trusted; });
  quiet_ = trusted && !(now.plausible && now.margin > kSuspicious * margin_ && now.lie > 0.5);
  for (std::size_t i = 0; i < guards_.size(); ++i) {
    Guard& guard = guards_[i];
    if (!guard.trusted) continue;
    double sigma = 0, another = 0;
    const double gain = follows(guard, sigma);
    const bool others_follow = std::all_of(guards_.begin(), guards_.end(), [&](const Guard& other) {
      return &other == &guard || !other.trusted || follows(other, another) > kFollows;
    });
    // What moves by itself is not stuck: then it is the reference that errs.
    const double still = kFollows * guard.usual_gain;
    guard.frozen = seen_ >= average_ && others_follow && gain + kSigmas * sigma < kFollows &&
                   guard.own - guard.noise < still * still * guard.motion;
    const bool lies = seen_ >= average_ && i == now.guard && now.plausible && now.margin > margin_ && now.lie > 1;
    if (!guard.frozen && guard.silent < average_ && !lies) continue;
    guard.trusted = false;
    guard.calm = 0;
  }
}

void GuardedFilter::forgive(double dt) {
  for (Guard& guard : guards_) {
    if (guard.trusted) continue;
    double sigma = 0;
    const double gain = follows(guard, sigma);
    const bool moves = !guard.frozen || (std::isfinite(sigma) && gain > kFollows);
    const bool agrees = guard.readable && moves && std::abs(guard.apart - guard.usual_apart) < 0.5 * guard.least;
    guard.calm = agrees ? guard.calm + dt : 0;
    if (guard.calm < release_ || !agrees) continue;
    guard.trusted = true;
  }
}

void GuardedFilter::write(const double* channels, bool begun, Estimate& estimate) const {
  estimate.covariance.resize(states_ * states_);
  estimate.state.assign(main_->state(), main_->state() + states_);
  main_->covariance(estimate.covariance.data());
  estimate.innovation.assign(main_->innovation(), main_->innovation() + measured_.size());
  estimate.innovation_std.assign(main_->innovation_std(), main_->innovation_std() + measured_.size());
  estimate.normalised_innovation = main_->normalised_innovation();
  estimate.observed = begun ? 0 : observed_;
  const bool fresh = estimate.quantities.empty();
  model_->quantities(channels, estimate.state.data(), estimate.covariance.data(), estimate.quantities);
  model_->innovation_quantities(estimate.innovation.data(), estimate.innovation_std.data(), estimate.quantities);
  if (fresh)
    for (const Guard& guard : guards_) {
      estimate.quantities.push_back({guard.channel + "_best", guard.unit, 0, 0});
      estimate.quantities.push_back({guard.channel + "_virtual", guard.unit, 0, 0});
      estimate.quantities.push_back({guard.channel + "_replaced", guard.unit, 0, 0});
    }
  auto at = estimate.quantities.end() - static_cast<std::ptrdiff_t>(kPerGuard * guards_.size());
  for (const Guard& guard : guards_) {
    const double std = std::sqrt(std::max({0.0, guard.predicted_variance, guard.spread - guard.noise}));
    at[0].value = guard.trusted ? guard.reading : stand_in(guard);
    at[0].std = guard.trusted ? 0 : std;
    at[1].value = stand_in(guard);
    at[1].std = std;
    at[2].value = guard.trusted ? 0 : guard.apart - guard.usual_apart;
    at += kPerGuard;
  }
}

namespace {

FAULTLINE_ESTIMATOR(guarded_filter, {"guarded_filter", "kalman", false, make_estimator_of<GuardedFilter>});

}  // namespace
}  // namespace faultline
