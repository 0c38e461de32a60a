// Isolation by a chain of variables under feedback: the controllers move everything before a fault so that what lies
// behind it stays right, so the last variable of the chain that shifted names the place (Manninen, Aalto University
// 2012, section 4). It knows what shifted from a stage of type histogram: the shares of time in which a variable's
// scaled average was above or below its limits, and its level.
//
// A variable has shifted (high or low) while such a share is above its limit, or its level off its healthy mean by more
// than its limit, until they are below half of that; both ways in turn where both shares are above theirs, as friction
// and play do it. The limits are `share` (`both` for both ways) and `level`, or, where that is more, what the healthy
// rig does by itself over `learn` s: mean + sigmas std of the share, sigmas std of the level.
//
// What is named, by the signs over the chain:
//   no variable both ways    the place of the last shifted variable that has one
//   some both ways           the place of the last of them that has one. Friction and play move no mean, so what
//                            shifted one way is another fault: the place of the last such variable is the second, if it
//                            is not the same. Where just one variable goes both ways, the one before it in the chain is
//                            what drives it and names nothing of its own.
//   only variables without a place   unknown: the pattern fits no place; by a share, for their levels wander with
//                                    what they follow
// A place without a cause that shifts it so is told as unknown, with the place in its words.
// Where the one that names the place has shifted one way, while the one before it, which drives it, is not a third as
// far towards its limits nor half way, nothing moved it: then it is its own transducer, where `alone` lists what that
// does.
// Once the variable that the loops hold has itself shifted, they have given way, and what lies behind it follows from
// that: then it and what lies before it are looked at alone.
//
// While a common cause (a supply, a temperature) has itself shifted, by `common_share` on one side or `common_level`,
// shifts are laid to it: what was named before stays, nothing else is named. What wanders slowly lies outside of nine
// tenths of its own past for a while now and then, which is no shift; what was never met lies there for most of the
// window. Its histogram should forget no faster than those of what it moves: give it the same explanatory channel.
//
// Settings: stage; chain, its observed channels in the order of cause, from the controller on; held, the one of them
// that the loops hold [none]; common; share, both, level [1: it is not looked at], common_share [share], common_level
// [level], sigmas, learn [0 s], settle (s from the first shift until it is named, and after a start); place [1] or 2;
// per channel CHANNEL_place, the module in words
// (none: it names none), and CHANNEL_high, CHANNEL_low, CHANNEL_both, CHANNEL_alone: the effect@port, with commas
// between, that shift it so; the first is told, the others as what it cannot be told from.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/isolation/isolator.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr const char* kType = "chain";
constexpr int kVersion = 3;  // of the reference
constexpr double kNotYet = -std::numeric_limits<double>::infinity();

enum class Shift { none, high, low, both };
constexpr std::array<const char*, 4> kWords = {"", "high", "low", "both"};
constexpr std::array<const char*, 4> kPhrases = {"", "high", "low", "high and low in turn"};

struct Usual {  // what a quantity is on the healthy rig
  std::size_t quantity = 0;
  double mean = 0, square = 0;
  double std() const { return std::sqrt(std::max(0.0, square - mean * mean)); }
};

struct Limits {
  double share = 1, both = 1, level = 1;
};

struct Side {  // whether a variable is beyond a limit
  bool share = false, level = false;
};

struct Link {
  std::string name, place;
  std::array<std::vector<std::string>, 4> causes;  // by Shift
  std::vector<std::string> alone;
  Usual above, below, level{0, 0.5, 0.25};
  Side high, low;
  Shift shift = Shift::none;
  double reach = 0;  // how far it is from what is usual, in limits
};

class ChainIsolator : public Isolator {
 public:
  ChainIsolator(const Datasheet& sheet, const StageSpec& spec) {
    const Settings& s = spec.settings;
    s.word_or("stage", "");
    second_ = s.number_or("place", 1, 1, 2) > 1.5;
    own_.share = s.number("share", 0.001, 1);
    own_.both = s.number("both", 0.001, 1);
    own_.level = s.number_or("level", 1, 0.001, 1);
    of_common_.share = of_common_.both = s.number_or("common_share", own_.share, 0.001, 1);
    of_common_.level = s.number_or("common_level", own_.level, 0.001, 1);
    sigmas_ = s.number_or("sigmas", 0, 0, 1000);
    learn_ = s.number_or("learn", 0, 0, 1e9);
    settle_ = s.number("settle", 0, 1e9);
    for (const std::string& name : split_words(s.word_or("chain", ""))) {
      sheet.channel(name);
      Link link;
      link.name = name;
      link.place = s.word_or(name + "_place", "");
      for (std::size_t k = 1; k < kWords.size(); ++k) link.causes[k] = causes(sheet, s, name + "_" + kWords[k]);
      link.alone = causes(sheet, s, name + "_alone");
      if (!link.alone.empty() && link.alone[0].find("@sensor.") == std::string::npos)
        throw InputError(fmt::format("{}: '{}_alone' must begin with an effect of a transducer, effect@sensor.CHANNEL",
                                     s.where(), name));
      chain_.push_back(std::move(link));
    }
    if (chain_.empty())
      throw InputError(s.where() + ": 'chain' is missing; list observed channels in the order of cause");
    for (const std::string& name : split_words(s.word_or("common", ""))) {
      sheet.channel(name);
      common_.emplace_back().name = name;
    }
    held_ = static_cast<int>(chain_.size()) - 1;
    if (const std::string held = s.word_or("held", ""); !held.empty()) {
      const auto found = std::find_if(chain_.begin(), chain_.end(), [&](const Link& l) { return l.name == held; });
      if (found == chain_.end())
        throw InputError(fmt::format("{}: 'held' is '{}'; it must be one of the chain", s.where(), held));
      held_ = static_cast<int>(found - chain_.begin());
    }
  }

  bool rests_on_model() const override { return false; }
  double judged_until() const override { return judged_until_; }

  void reset() override {
    for (std::vector<Link>* links : {&chain_, &common_})
      for (Link& link : *links) {
        link.shift = Shift::none;
        link.high = link.low = {};
      }
    running_ = false;
    judged_until_ = kNotYet;
  }

  void process(const Estimate& estimate, const std::vector<bool>&, Finding& finding) override {
    if (estimate.quantities.empty()) return;
    if (!found_) find(estimate);
    if (!running_ || estimate.restarted) {
      reset();
      running_ = true;
      last_ = begun_ = estimate.time;
    }
    const double dt = estimate.time - last_;
    last_ = estimate.time;
    if (estimate.quantities[judging_].value < 1) begun_ = estimate.time;
    if (estimate.time - begun_ < settle_)
      return;  // after a gap in the data what was found stays until it is judged anew
    if (learnt_ < learn_) {
      learn(estimate, dt);
      return;
    }
    judged_until_ = estimate.time;
    const bool shifted = follow(chain_, own_, estimate), explained = follow(common_, of_common_, estimate);
    if (explained && finding.active) return;
    if (!shifted || explained) since_ = estimate.time;
    finding.active = false;
    if (shifted && !explained && estimate.time - since_ >= settle_) tell(finding);
  }

  std::optional<Reference> reference() const override {
    if (learn_ == 0 || learnt_ < learn_) return {};
    Reference r{kType, kVersion, names(), {}};
    for (const std::vector<Link>* links : {&chain_, &common_})
      for (const Link& link : *links)
        for (const Usual* u : {&link.above, &link.below, &link.level})
          r.numbers.insert(r.numbers.end(), {u->mean, u->square});
    return r;
  }

  void restore(const Reference& given) override {
    check_reference(given, kType, kVersion, names());
    const double* next = given.numbers.data();
    for (std::vector<Link>* links : {&chain_, &common_})
      for (Link& link : *links)
        for (Usual* u : {&link.above, &link.below, &link.level}) {
          u->mean = *next++;
          u->square = *next++;
        }
    learnt_ = learn_;
  }

 private:
  static std::vector<std::string> causes(const Datasheet& sheet, const Settings& s, const std::string& key) {
    std::vector<std::string> causes = split_words(s.word_or(key, ""));
    for (const std::string& cause : causes) check_cause(sheet, s, cause);
    return causes;
  }

  static void check_cause(const Datasheet& sheet, const Settings& s, const std::string& cause) {
    const std::size_t at = cause.find('@');
    const std::string effect = cause.substr(0, at);
    if (at != std::string::npos)
      for (const FittingEffect& fitting : sheet.port(cause.substr(at + 1)).effects)
        if (fitting.effect == effect) return;
    throw InputError(fmt::format("{}: '{}' is no effect@port of the rig {}", s.where(), cause, sheet.rig));
  }

  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const std::vector<Link>* links : {&chain_, &common_})
      for (const Link& link : *links)
        for (const char* what : {"high", "high_square", "low", "low_square", "level", "level_square"})
          names.push_back(link.name + "." + what);
    return names;
  }

  void find(const Estimate& estimate) {
    const auto place = [&](const std::string& name) {
      for (std::size_t i = 0; i < estimate.quantities.size(); ++i)
        if (estimate.quantities[i].name == name) return i;
      throw InputError(fmt::format(
          "a chain asks for the quantity '{}', which its stage does not give; name a stage that observes that channel",
          name));
    };
    judging_ = place("judging");
    for (std::vector<Link>* links : {&chain_, &common_})
      for (Link& link : *links) {
        link.above.quantity = place(link.name + ".above");
        link.below.quantity = place(link.name + ".below");
        link.level.quantity = place(link.name + ".level");
      }
    found_ = true;
  }

  void learn(const Estimate& estimate, double dt) {
    learnt_ += dt;
    const double part = learnt_ > 0 ? dt / learnt_ : 1;
    for (std::vector<Link>* links : {&chain_, &common_})
      for (Link& link : *links)
        for (Usual* u : {&link.above, &link.below, &link.level}) {
          const double value = estimate.quantities[u->quantity].value;
          u->mean += part * (value - u->mean);
          u->square += part * (value * value - u->square);
        }
  }

  // Whether any has shifted.
  bool follow(std::vector<Link>& links, const Limits& limits, const Estimate& estimate) const {
    bool shifted = false;
    for (Link& link : links) {
      link.shift = shift(link, limits, estimate);
      shifted = shifted || link.shift != Shift::none;
    }
    return shifted;
  }

  Shift shift(Link& link, const Limits& limits, const Estimate& estimate) const {
    const auto value = [&](const Usual& u) { return estimate.quantities[u.quantity].value; };
    const double above = value(link.above), below = value(link.below), level = value(link.level) - link.level.mean;
    const auto limit = [&](const Usual& u, double least) { return std::max(least, u.mean + sigmas_ * u.std()); };
    const double most = std::max(limits.level, sigmas_ * link.level.std());
    const double high = limit(link.above, limits.share), low = limit(link.below, limits.share);
    link.reach = std::max({std::abs(level) / most, (above - link.above.mean) / (high - link.above.mean),
                           (below - link.below.mean) / (low - link.below.mean)});
    const auto beyond = [](bool before, double x, double end) { return x > (before ? 0.5 : 1.0) * end; };
    const bool both = beyond(link.high.share, above, limit(link.above, limits.both)) &&
                      beyond(link.low.share, below, limit(link.below, limits.both));
    link.high = {both || beyond(link.high.share, above, high), beyond(link.high.level, level, most)};
    link.low = {both || beyond(link.low.share, below, low), beyond(link.low.level, -level, most)};
    if (link.high.share && link.low.share) return Shift::both;
    if (link.high.share || link.low.share) return link.high.share ? Shift::high : Shift::low;
    return link.high.level ? Shift::high : link.low.level ? Shift::low : Shift::none;
  }

  bool placed(int i) const { return !chain_[static_cast<std::size_t>(i)].place.empty(); }
  Shift shift_at(int i) const { return i < 0 ? Shift::none : chain_[static_cast<std::size_t>(i)].shift; }

  bool driven(int i) const {
    constexpr double kAnswer = 1.0 / 3, kEnough = 0.5;  // limits
    if (i == 0) return true;
    const Link& before = chain_[static_cast<std::size_t>(i - 1)];
    return before.reach > std::min(kEnough, kAnswer * chain_[static_cast<std::size_t>(i)].reach);
  }

  // The last one that is looked at.
  int end() const { return shift_at(held_) == Shift::none ? static_cast<int>(chain_.size()) - 1 : held_; }

  void tell(Finding& finding) const {
    int turn = end(), first = -1, second = -1;
    while (turn >= 0 && !(shift_at(turn) == Shift::both && placed(turn))) --turn;
    const bool alone = turn >= 0 && shift_at(turn - 1) != Shift::both;
    for (int i = end(); i >= 0 && second < 0; --i) {
      if (shift_at(i) == Shift::none || shift_at(i) == Shift::both || !placed(i)) continue;
      const bool same =
          turn >= 0 && chain_[static_cast<std::size_t>(i)].place == chain_[static_cast<std::size_t>(turn)].place;
      if (same) break;
      if (!(alone && i == turn - 1)) second = i;
    }
    first = turn;
    if (first < 0) std::swap(first, second);
    if (second_ && second < 0) return;
    finding = Finding();
    finding.active = true;
    finding.since = since_;
    std::vector<std::string> shifts;
    for (const Link& link : chain_)
      if (link.shift != Shift::none)
        shifts.push_back(fmt::format("{} {}", link.name, kPhrases[static_cast<std::size_t>(link.shift)]));
    const std::string pattern = fmt::format("shifted are {}", fmt::join(shifts, ", "));
    const int at = second_ ? second : first;
    if (at < 0) {
      finding.active =
          std::any_of(chain_.begin(), chain_.end(), [](const Link& l) { return l.high.share || l.low.share; });
      finding.text = "Something shifted that names no place: " + pattern;
      return;
    }
    const Link& link = chain_[static_cast<std::size_t>(at)];
    if (!link.alone.empty() && link.shift != Shift::both && !driven(at)) {
      claim(link.alone, finding);
      finding.kind = AlarmKind::sensor;
      finding.text = fmt::format("Transducer of {}: {}", link.name, pattern);
      return;
    }
    const std::vector<std::string>& causes = link.causes[static_cast<std::size_t>(link.shift)];
    finding.kind = causes.empty() ? AlarmKind::unknown : AlarmKind::fault;
    const int other = second_ ? first : second;
    const std::string place =
        other < 0 ? link.place : link.place + " and " + chain_[static_cast<std::size_t>(other)].place;
    finding.text = fmt::format("{}: {}", place, pattern);
    finding.text[0] = static_cast<char>(std::toupper(finding.text[0]));
    claim(causes, finding);
  }

  // Confidence that the trouble is at the first cause's port: the ports that are listed count alike.
  static void claim(const std::vector<std::string>& causes, Finding& finding) {
    finding.confidence = 0;
    if (causes.empty()) return;
    std::set<std::string> ports;
    for (const std::string& cause : causes) ports.insert(cause.substr(cause.find('@')));
    finding.confidence = 1.0 / static_cast<double>(ports.size());
    const std::size_t split = causes[0].find('@');
    finding.effect = causes[0].substr(0, split);
    finding.port = causes[0].substr(split + 1);
    finding.equivalent.assign(causes.begin() + 1, causes.end());
  }

  std::vector<Link> chain_, common_;
  int held_ = 0;
  Limits own_, of_common_;
  double sigmas_, learn_, settle_;
  bool second_, found_ = false, running_ = false;
  std::size_t judging_ = 0;
  double learnt_ = 0, last_ = 0, begun_ = 0, since_ = 0, judged_until_ = kNotYet;  // s
};

FAULTLINE_ISOLATOR(chain, {"chain", make_isolator_of<ChainIsolator>});

}  // namespace
}  // namespace faultline
