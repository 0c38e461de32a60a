#include "faultline/gap/effect_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "faultline/gap/effect_worth.h"
#include "faultline/gap/missing_signal.h"

namespace faultline {
namespace {

constexpr int kMostValleys = 2;  // of the refit that are left for a better one
// Of a gap, beyond which what was found is not sought once more beside a bias: a search as long as the first.
constexpr double kClosesMost = 0.85;
// Of the first effect's gain: what a rival may be behind it and yet be one of two causes.
constexpr double kNearFirst = 0.15;
constexpr std::size_t kLikeNoise = 2;  // effects at a transducer that are followed before its signal is noise

bool by_score(const Structure& a, const Structure& b) { return sum(a.score) < sum(b.score); }

// Among those that close the gap about as well over segments, the one comes first that does best in both: there, and in
// how likely it leaves the recording from sample to sample. The two see different things of a cause; each counts as a
// fraction of what the best wins in it.
void best_of_both_first(const GapTrials& work, const EffectSearch& search, std::vector<Structure>& structures) {
  const Structure& best = structures.front();
  if (!restarts_freely(best.fit.effects.back().effect)) return;
  const double whole = sum(search.score) - sum(best.score);
  if (!(whole > 0)) return;
  std::vector<std::size_t> close;
  std::vector<double> losses;
  for (std::size_t i = 0; i < structures.size(); ++i) {
    if (sum(structures[i].score) - sum(best.score) > work.options().search.close_rival_gain_fraction * whole) break;
    if (!restarts_freely(structures[i].fit.effects.back().effect)) continue;
    close.push_back(i);
    losses.push_back(loss_of(work, search.noise, structures[i]));
  }
  const double won = search.after.loss - *std::min_element(losses.begin(), losses.end());
  if (!(won > 0)) return;
  std::size_t chosen = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < close.size(); ++k) {
    const double missed = sum(structures[close[k]].score) / whole + losses[k] / won;
    if (missed < least) least = missed, chosen = close[k];
  }
  const auto first = structures.begin() + static_cast<std::ptrdiff_t>(chosen);
  std::rotate(structures.begin(), first, first + 1);
}

// A range of the datasheet is what its author thought of: a size that lies at its end may lie beyond it. False: none
// does, or physics allows no more.
bool widened(Candidate& candidate, const GapOptions& options) {
  if (candidate.widened) return false;
  const EffectType* type = find_effect_type(candidate.effect.effect);
  bool& any = candidate.widened;
  for (std::size_t p = 0; p < candidate.bounds.size(); ++p) {
    Bounds& b = candidate.bounds[p];
    const EffectParameter& parameter = type->parameters[p];
    if (b.minimum >= b.maximum || std::isnan(parameter.none)) continue;
    const double place = candidate.to_coordinate(p, candidate.effect.parameters[p]);
    if (std::abs(place - 0.5) <= 0.5 - options.verdict.bound_coordinate) continue;
    const double ratio = options.search.beyond_range_ratio;
    const Bounds before = b;
    if (std::isinf(parameter.none)) {  // the smaller, the more of it
      if (place < 0.5) b.minimum = std::max(b.minimum / ratio, parameter.minimum);
    } else if (place > 0.5 && b.maximum > parameter.none) {
      b.maximum = std::min(parameter.none + ratio * (b.maximum - parameter.none), parameter.maximum);
    } else if (place < 0.5 && b.minimum < parameter.none) {
      b.minimum = std::max(parameter.none + ratio * (b.minimum - parameter.none), parameter.minimum);
    }
    any = any || b.minimum < before.minimum || b.maximum > before.maximum;
  }
  return any;
}

// Those of `structures` whose last effect's size lies at the end of its range, with a wider one.
std::vector<Structure> wider_ones(const GapTrials& work, const std::vector<Structure>& structures) {
  std::vector<Structure> wider;
  for (const Structure& s : structures) {
    wider.push_back(s);
    if (!widened(wider.back().fit.effects.back(), work.options())) wider.pop_back();
  }
  return wider;
}

template <class Better>
void take_better(std::vector<Structure>& structures, std::vector<Structure>& wider, Better better) {
  for (Structure& s : structures)
    for (Structure& w : wider)
      if (same_effect(s.fit.effects.back(), w.fit.effects.back()) && better(w, s)) std::swap(s, w);
}

// The followed structures of one round, best first; `rest` takes the finalists that were not followed.
std::vector<Structure> best_of_round(const GapTrials& work, const EffectSearch& search,
                                     std::vector<Structure> structures, double from, double to,
                                     std::vector<Structure>& rest) {
  const FitResult& base = search.base;
  const GapOptions::Search& options = work.options().search;
  if (structures.size() > options.finalists) structures.resize(options.finalists);
  const double middle = from + 0.3 * (to - from);
  work.shortlist(base, structures, true, from, middle);
  if (std::vector<Structure> wider = wider_ones(work, structures); !wider.empty()) {
    const auto quicker = [](const Structure& a, const Structure& b) { return a.quick > b.quick; };
    work.shortlist(base, wider, true, middle, middle);
    take_better(structures, wider, quicker);
    std::stable_sort(structures.begin(), structures.end(), quicker);
  }
  std::size_t kept = 1;
  const double promising = options.followed_gain_fraction * structures.front().quick;
  while (kept < structures.size() && kept < options.followed && structures[kept].quick > promising) ++kept;
  rest.assign(structures.begin() + static_cast<std::ptrdiff_t>(kept), structures.end());
  structures.resize(kept);
  kept = work.refine(structures, middle, to);
  rest.insert(rest.begin(), structures.begin() + static_cast<std::ptrdiff_t>(kept), structures.end());
  structures.resize(kept);
  if (std::vector<Structure> wider = wider_ones(work, structures); !wider.empty()) {
    wider.resize(work.refine(wider, to, to));
    take_better(structures, wider, by_score);
  }
  std::stable_sort(structures.begin(), structures.end(), by_score);
  best_of_both_first(work, search, structures);
  // What the noise gives is no rival. Where it comes first, what wins less than it is no cause either.
  structures.erase(std::remove_if(structures.begin() + 1, structures.end(),
                                  [&](const Structure& s) { return from_input_noise(work, base, s); }),
                   structures.end());
  if (structures.size() > 1 && has_no_size(work, structures.front())) structures.erase(structures.begin());
  for (std::size_t i = 1; i < structures.size(); ++i) structures[i].around = {};  // large, and not needed again
  return structures;
}

// What stands for certain while an effect is on trial: one that gains over segments and is not worth it from sample to
// sample, where so much is left that another one is missing beside it; or a bias, which shows nothing alone.
struct Certain {
  EffectSearch search;
  GapTrials::Standing standing;
  bool bias = false;  // whether that is on trial
};

// The last effect of a structure alone beside what stands.
Structure alone_beside(const GapTrials& work, const EffectSearch& now, const Structure& best) {
  std::vector<Structure> alone(1);
  alone.front().fit.effects = now.base.effects;
  alone.front().fit.effects.push_back(best.fit.effects.back());
  alone.front().fit.model = with_effects(alone.front().fit.effects, now.base.model.parameters);
  work.refine(alone, 0.88, 0.88);
  return alone.front();
}

Discrepancy discrepancy(const GapTrials& work, const EffectSearch& search) {
  return find_discrepancy(work.model(), search.base.model, work.learned(), work.jobs(), Places::free, search.noise);
}

// White noise of the transducer at a port, in the channel's unit; nothing where it is none that is compared or drives
// the model.
std::optional<double> transducer_noise(const ResidualModel& model, const std::string& port) {
  if (const std::optional<std::size_t> output = output_of(model, port)) return model.noise()[*output];
  if (port_kind(port) != PortKind::sensor) return {};
  const auto channel = static_cast<std::size_t>(model.sheet().channel(model.sheet().port(port).channel));
  if (model.sheet().channels[channel].role != Role::input) return {};
  double noise = 0;
  for (const SegmentedRun& run : model.runs()) noise += run.input_noise[channel];
  return noise / static_cast<double>(model.runs().size());
}

// Whether an effect at a transducer makes the recording likelier than noise with a memory there does: a lag of it is
// much like one, and how a lag looks as a function of what the model knows is no short formula.
bool is_an_effect(const GapTrials& work, const EffectSearch& search, const FreePlace& noise) {
  std::vector<Structure> structures = work.screen_at(noise.port, search.base);
  if (structures.empty()) return false;
  work.shortlist(search.base, structures, true, 0.05, 0.05);
  structures.resize(std::min(structures.size(), kLikeNoise));
  structures.resize(work.refine(structures, 0.05, 0.05));
  std::vector<FreePlace> with = search.noise;
  with.push_back(noise);
  const double loss =
      find_discrepancy(work.model(), search.base.model, work.learned(), work.jobs(), Places::none, with).loss;
  return std::any_of(structures.begin(), structures.end(), [&](const Structure& structure) {
    return gains(work, search, structure) && loss_of(work, search.noise, structure) < loss;
  });
}

// The likeliest place of a cause, where it is a transducer whose signal is as small as noise, forgets itself within a
// few segments and depends on nothing that the model knows: noise that is not white, which is no cause and hides what
// is. What else could be at a place that is as likely needs more than noise.
std::optional<FreePlace> noise_with_memory(const GapTrials& work, const EffectSearch& search) {
  const GapOptions::Search& options = work.options().search;
  for (const FreePlace& place : search.before.places) {
    if (place.gain < (1 - work.options().verdict.rival_gain_fraction) * search.before.places.front().gain) break;
    const std::optional<double> noise = transducer_noise(work.model(), place.port);
    if (!noise || place.memory > options.noise_memory_segments * work.segment_s() ||
        place.level > options.noise_level_ratio * *noise)
      continue;
    if (place.gain < work.options().verdict.place_evidence_fraction * search.before.loss) break;
    const MissingSignal signal =
        find_missing_signal(work.model(), search.base.model, place, work.folds(), work.jobs(), Sought::all);
    if (!signal.formula.empty() || signal.curve) continue;
    if (is_an_effect(work, search, place)) break;  // as likely as which the others are no noise either
    return place;
  }
  return {};
}

// The refit that was found last, scored like every structure, and what a free signal beside it would win.
void stand_plain(GapTrials& work, EffectSearch& search) {
  search.noise.clear();
  search.plain = work.score(search.base);
  search.losses = search.plain.held_out;
  search.score = search.plain.score;
  search.before = discrepancy(work, search);
  while (search.noise.size() < work.model().sheet().channels.size()) {
    const std::optional<FreePlace> noise = noise_with_memory(work, search);
    if (!noise) break;
    search.noise.push_back(*noise);
    search.before = discrepancy(work, search);
  }
  search.after = search.before;
}

// `standing`: score of what holds the round.
Rival rival_of(const GapTrials& work, std::size_t round, const Structure& structure,
               const std::vector<double>& standing) {
  const std::vector<double> behind = minus(structure.score, standing);
  return {round, structure.fit, structure.apart, std::max(0.0, sum(behind)), work.standard_error(behind)};
}

// An effect that was found alone was found with others missing: the close rivals of each round but the last are tried
// again beside everything else, and take its place if they do better there. Those of the last were tried like that.
void try_rivals(GapTrials& work, const std::vector<std::vector<Structure>>& followed, EffectSearch& search) {
  if (search.base.effects.size() > 1)
    for (std::size_t r = 1; r < followed.back().size(); ++r)
      search.rivals.push_back(rival_of(work, followed.size() - 1, followed.back()[r], followed.back().front().score));
  for (std::size_t round = 0; round + 1 < search.base.effects.size(); ++round) {
    const Structure& winner = followed[round].front();
    const double whole = sum(search.plain.score) - sum(winner.score);
    std::vector<double> standing = winner.score;  // of what holds the winner's place, as if it stood alone
    for (std::size_t r = 1; r < followed[round].size(); ++r) {
      const Structure& rival = followed[round][r];
      if (sum(rival.score) - sum(winner.score) > work.options().search.close_rival_gain_fraction * whole) continue;
      const auto e = static_cast<std::ptrdiff_t>(position_of(search, round));
      std::vector<Structure> swapped(1);
      std::vector<Candidate>& effects = swapped.front().fit.effects;
      effects = search.base.effects;
      effects.erase(effects.begin() + e);
      effects.push_back(rival.fit.effects.back());
      swapped.front().fit.model = with_effects(effects, search.base.model.parameters);
      work.refine(swapped, 0.87, 0.88);
      const std::vector<double> gain = minus(search.score, swapped.front().score);
      const std::vector<double> beside = minus(standing, gain);
      if (round == 0)  // how the two compare beside the others is what counts
        for (Structure& s : search.ranked)
          if (same_effect(s.fit.effects.back(), rival.fit.effects.back())) s.score = beside;
      if (round > 0) search.rivals.push_back(rival_of(work, round, swapped.front(), search.score));
      if (sum(gain) <= 0) continue;
      if (restarts_freely(rival.fit.effects.back().effect) && restarts_freely(winner.fit.effects.back().effect) &&
          loss_of(work, search.noise, swapped.front()) >= search.after.loss)
        continue;
      standing = beside;
      search.base = work.refit(swapped.front());
      search.base.covariance = swapped.front().fit.covariance;
      search.after = discrepancy(work, search);
      search.losses = swapped.front().held_out;
      search.score = swapped.front().score;
      search.round_of.erase(search.round_of.begin() + e);
      search.round_of.push_back(round);
      search.apart.erase(search.apart.begin() + e);
      search.apart.push_back(swapped.front().apart);
    }
  }
  std::stable_sort(search.ranked.begin(), search.ranked.end(), [](const Structure& a, const Structure& b) {
    return !a.score.empty() && (b.score.empty() || by_score(a, b));
  });
}

// The model that is told, fitted to the end where a size of it is on a ridge.
void polish(GapTrials& work, EffectSearch& search) {
  if (search.base.effects.empty()) return;
  search.base = work.polish(search.base);
  const Structure again = work.score(search.base);
  if (sum(again.score) >= sum(search.score)) return;
  search.losses = again.held_out;
  search.score = again.score;
}

// A constant signal. What is not the same in both directions of motion - friction, a play - makes a bias of its own
// beside it, which a fit of either alone bends into everything else.
bool is_bias(const Structure& structure) {
  const std::string& effect = structure.fit.effects.back().effect.effect;
  return effect == "offset" || effect == "load_force";
}

class EffectRounds {
 public:
  EffectRounds(GapTrials& work, int most_effects, double quiet_variances)
      : work_(work), most_effects_(most_effects), quiet_variances_(quiet_variances) {}

  EffectSearch search() {
    begin();
    run();
    try_beside_bias();
    try_beside_rival();
    try_rivals(work_, followed_, search_);
    polish(work_, search_);
    return std::move(search_);
  }

 private:
  using Structures = std::vector<Structure>;

  void begin() {
    ModelChange nominal;
    nominal.parameters = work_.model().sheet().nominal();
    search_.base = work_.refit(nominal, {});
    search_.plain = work_.score(search_.base);
    // A search from the datasheet's values may end beside the rig's, and what it leaves there would be given a name.
    if (excess_of(search_.plain.score) >= quiet_variances_) search_.base = work_.refit_from_elsewhere(search_.base);
    search_.nominal = work_.held_out(nominal);
    stand_plain(work_, search_);
  }

  void run() {
    while (round_ < most_effects_ && step()) continue;
    if (!certain_) return;
    search_ = certain_->search;
    work_.come_back(certain_->standing);
    followed_.pop_back();
    --round_;
    certain_.reset();
  }

  double excess_of(const std::vector<double>& score) const { return typical_excess(score, work_.held_out_values()); }
  bool large() const { return excess_of(search_.score) > work_.options().verdict.material_excess_variances; }

  // One round. False: the search has ended.
  bool step() {
    const double excess = excess_of(search_.score);
    if (excess < quiet_variances_) return false;
    // What swings is hardly like a free signal.
    const bool swings =
        work_.put_in_step(search_.base) * (1 + excess) > work_.options().verdict.material_shrink_fraction * excess;
    if (!more_to_find(work_.options().search, search_, large() || swings)) return false;
    const double from = round_ == 0 ? 0.1 : 0.55 + 0.18 * (round_ - 1), width = round_ == 0 ? 0.45 : 0.18;
    const Structures screened =
        certain_ && certain_->bias ? finalists_beside_bias() : work_.screen(search_.base, from, from + 0.5 * width);
    if (round_ == 0) search_.screened = screened;
    if (screened.empty()) return false;
    Structures rest;
    Structures structures = best_of_round(work_, search_, screened, from + 0.5 * width, from + width, rest);
    Structure best = structures.front();
    structures.front().around = {};
    if (round_ == 0 && valleys_++ < kMostValleys && work_.better_without(best)) {
      // What it wins is the parameters', which the refit did not find.
      search_.base = work_.refit(without_last(best.fit).model, {});
      search_.screened.clear();
      stand_plain(work_, search_);
      return true;
    }
    if (round_ == 0) {
      rank(structures, rest);
      plain_ = Certain{search_, work_.standing()};
    }
    if (!gains(work_, search_, best)) return false;
    bool beside_bias = false;
    if (worth_it(best)) {
      if (certain_) {
        const bool alone = stands_alone(best);
        if (certain_->bias && alone) put_first(best);
        beside_bias = certain_->bias && !alone;
      }
      certain_.reset();
    } else if (!certain_ && round_ + 1 < most_effects_ && worth_a_trial(work_, search_, best)) {
      certain_ = Certain{search_, work_.standing()};
    } else {
      return false;
    }
    if (!take(best, structures)) {
      certain_.reset();
      return false;
    }
    // A bias says nothing of what it is beside: that one is the cause, and its rivals are those that were beside it.
    if (beside_bias) {
      std::swap(search_.round_of[0], search_.round_of[1]);
      std::swap(followed_[0], followed_[1]);
      search_.screened = screened;
      rank(structures, rest);
    }
    return true;
  }

  void rank(const Structures& structures, const Structures& rest) {
    search_.ranked = structures;
    search_.ranked.insert(search_.ranked.end(), rest.begin(), rest.end());
  }

  // What was not followed, or into another valley, before a bias was beside it.
  void put_first(const Structure& best) {
    Structures& ranked = search_.ranked;
    ranked.erase(
        std::remove_if(ranked.begin(), ranked.end(),
                       [&](const Structure& s) { return same_effect(s.fit.effects.back(), best.fit.effects.back()); }),
        ranked.end());
    ranked.insert(ranked.begin(), best);
    ranked.front().around = {};
  }

  bool worth_it(const Structure& best) const {
    if (!pays(work_, certain_ ? certain_->search : search_, search_, best, quiet_variances_)) return false;
    return !(certain_ && certain_->bias) ||
           closes(work_, certain_->search, best) > work_.options().verdict.closed_shrink_fraction;
  }

  // Whether the second of two, of which the first is on trial, is what was missing, alone; then it takes its place.
  bool stands_alone(Structure& best) {
    const GapTrials::Standing both = work_.standing();
    work_.come_back(certain_->standing);
    const Structure alone = alone_beside(work_, certain_->search, best);
    if (!gains(work_, certain_->search, alone) ||
        !pays(work_, certain_->search, certain_->search, alone, quiet_variances_)) {
      work_.come_back(both);
      return false;
    }
    search_ = certain_->search;
    best = alone;
    followed_.pop_back();
    --round_;
    return true;
  }

  // Adds the last effect of a structure to what stands. False: its size is another one in each part of the runs, which
  // makes up for what is left and is no further cause.
  bool take(const Structure& best, const Structures& structures) {
    const EffectSearch before = search_;
    const GapTrials::Standing standing = work_.standing();
    search_.base = work_.refit(best);
    if (!before.base.effects.empty() &&
        work_.sizes_agree(search_.base).back().spread > work_.options().verdict.size_spread) {
      search_ = before;
      work_.come_back(standing);
      return false;
    }
    followed_.push_back(structures);
    search_.base.covariance = best.fit.covariance;
    search_.round_of.push_back(static_cast<std::size_t>(round_));
    search_.apart.push_back(best.apart);
    // A further effect must not be credited with what one more refit wins.
    const Structure again = work_.score(search_.base);
    const Structure& better = sum(again.score) < sum(best.score) ? again : best;
    search_.losses = better.held_out;
    search_.score = better.score;
    search_.after = discrepancy(work_, search_);
    ++round_;
    return true;
  }

  // Where what was found, if anything, leaves much of a large gap: the search once more beside the likeliest bias. One
  // effect must close nearly all with it, and more than what was found.
  void try_beside_bias() {
    if (!plain_ || most_effects_ < 2 || !large() || closed() > kClosesMost) return;
    const Structures& screened = plain_->search.screened;
    const auto bias = std::find_if(screened.begin(), screened.end(), is_bias);
    if (bias != screened.end()) search_beside(*bias, true);
  }

  // Alone, what mimics two causes may close more than either of them: where what was found closes nearly all and leaves
  // more than noise, the search once more beside the nearest rival of the first.
  void try_beside_rival() {
    if (!plain_ || most_effects_ < 2 || search_.base.effects.empty() || !large() || closed() <= kClosesMost) return;
    const Structures& ranked = plain_->search.ranked;
    const auto rival = std::find_if(ranked.begin(), ranked.end(), [&](const Structure& s) {
      const Candidate& effect = s.fit.effects.back();
      return !s.score.empty() && std::none_of(search_.base.effects.begin(), search_.base.effects.end(),
                                              [&](const Candidate& found) { return same_effect(found, effect); });
    });
    if (rival == ranked.end()) return;
    const double whole = sum(plain_->search.score) - sum(ranked.front().score);
    if (sum(rival->score) - sum(ranked.front().score) > kNearFirst * whole) return;
    const Structure first = *rival;
    if (search_beside(first, false)) put_first(first);
  }

  // Of the gap, by what was found.
  double closed() const {
    const double values = work_.held_out_values();
    return 1 - mean_excess(search_.losses, values) / mean_excess(plain_->search.losses, values);
  }

  // The search from the first round on with this one on trial. False: what was found is better and stands.
  bool search_beside(const Structure& first, bool bias) {
    const Certain found{search_, work_.standing()};
    const std::vector<Structures> followed = followed_;
    const int round = round_;
    Structures alone{first};
    search_ = plain_->search;
    work_.come_back(plain_->standing);
    followed_.clear();
    round_ = 0;
    work_.refine(alone, 0.55, 0.55);
    certain_ = Certain{search_, work_.standing(), bias};
    const Structure best = alone.front();
    alone.front().around = {};
    take(best, alone);
    run();
    if (!search_.base.effects.empty() && better_than(found.search)) return true;
    search_ = found.search;
    work_.come_back(found.standing);
    followed_ = followed;
    round_ = round;
    return false;
  }

  // Those of the round without it: to first order friction shows little beside a bias that has taken its place.
  Structures finalists_beside_bias() const {
    Structures result;
    for (const Structure& finalist : plain_->search.ranked) {
      const Candidate& candidate = finalist.fit.effects.back();
      if (same_effect(candidate, search_.base.effects.back())) continue;
      Structure structure;
      structure.fit.effects = {search_.base.effects.back(), candidate};
      structure.fit.model = with_effects(structure.fit.effects, search_.base.model.parameters);
      structure.screened = finalist.screened;
      result.push_back(std::move(structure));
    }
    return result;
  }

  bool better_than(const EffectSearch& other) const {
    const std::vector<double> gain = minus(other.score, search_.score);
    return sum(gain) > work_.options().search.significance_standard_errors * work_.standard_error(gain);
  }

  GapTrials& work_;
  const int most_effects_;
  const double quiet_variances_;
  EffectSearch search_;
  std::vector<Structures> followed_;  // round by round, best first
  int round_ = 0, valleys_ = 0;
  std::optional<Certain> certain_, plain_;
};

}  // namespace

std::size_t position_of(const EffectSearch& search, std::size_t round) {
  const auto found = std::find(search.round_of.begin(), search.round_of.end(), round);
  return static_cast<std::size_t>(found - search.round_of.begin());
}

double typical_excess(const std::vector<double>& scores, double values) {
  return std::expm1(std::max(0.0, 2 * sum(scores) / values));
}

double mean_excess(const std::vector<double>& losses, double values) {
  return std::max(0.0, 2 * sum(losses) / values - 1);
}

EffectSearch search_effects(GapTrials& work, int most_effects, double quiet_variances) {
  return EffectRounds(work, most_effects, quiet_variances).search();
}

}  // namespace faultline
