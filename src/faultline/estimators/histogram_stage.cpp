// The estimator `histogram`: multi-variable histograms (histogram.h) of channels of any rig, learnt while it runs.
//
// Quantities: judging (1 once it judges, else 0); then per observed channel CHANNEL.average, the scaled moving average
// (0 and 1 are the limits), CHANNEL.above and CHANNEL.below, the shares of the window in which that was beyond them,
// and CHANNEL.level, the mean over the window of samples cut at the limits.
// With `horizon` also CHANNEL.saturation, CHANNEL.saturation_low, CHANNEL.saturation_high, in s: when it will reach an
// end of its range, with the bounds of its 90 % interval (histogram_saturation.h). Anchors are the bins as they are
// when judging begins, or when they may judge for the first time after that.
// What was learnt belongs to the rig and outlives gaps, jumps and resets; averages begin anew there.
//
// Settings, times in s:
//   CHANNEL_by     one per observed channel: its explanatory channels ("a", "a, b"), or none
//   CHANNEL_range  low and high end of the bins of an explanatory channel [the channel's range]
//   bins [8]       of each of two explanatory channels; single_bins [bins] of one by itself
//   sections [32]  of a bin's histogram; coverage [0.9] of its limits
//   every          time between the samples that are used [the rig's sample period]
//   minimum        time in a bin before it may judge
//   memory         time in a bin after which its counts are halved
//   learn          time over which it learns before anything is judged; then it goes on learning
//   average, window   times of the moving average and of the shares; rounded to a power of two of `every`
//   freeze [1]     share of an explained channel above which nothing is learnt, lest a fault become normal
//   common         observed channels that move others from outside: while one is above that share, learning goes on
//   arithmetic     floating or integer [floating]
//   horizon [0]    time over which a drift is followed; 0: no prognosis. CHANNEL_ends: [the channel's range]
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "faultline/estimators/estimator.h"
#include "faultline/estimators/histogram.h"
#include "faultline/estimators/histogram_saturation.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr const char* kType = "histogram";
constexpr int kVersion = 1;  // of the reference
constexpr double kMostBins = 64;
constexpr std::size_t kOneRow = static_cast<std::size_t>(-1);
constexpr double kFarQuanta = 1e9;  // an explanatory channel far beyond its bins still fits an integer

// A channel in quanta.
struct Scale {
  std::size_t channel = 0;
  double low = 0, quantum = 1;
  double quanta(double value) const { return (value - low) / quantum; }
};

struct Observed {
  Scale scale;
  std::string name, unit;
  std::vector<std::size_t> by;  // places among the explanatory scales, 0 to 2
  bool common = false;
  std::vector<double> ends;
};

struct HistogramSettings {
  std::vector<Observed> observed;
  std::vector<Scale> explanatory;
  std::vector<std::string> explanatory_names, explanatory_units;
  int bins = 8, single_bins = 8;
  HistogramShape shape;  // without its bins
  double every = 0, learn = 0, freeze = 1, horizon = 0;
};

int samples(const Settings& s, const std::string& key, double every, int least, int most) {
  return static_cast<int>(std::lround(s.number(key, least * every, most * every) / every));
}

int shift(const Settings& s, const std::string& key, double every) {
  const double most = every * (1 << kMostShift);
  return static_cast<int>(std::lround(std::log2(s.number(key, every, most) / every)));
}

// Two increasing numbers within the channel's range.
std::vector<double> span(const Settings& s, const std::string& key, const Channel& c) {
  if (!s.has(key)) return {c.minimum, c.maximum};
  std::vector<double> range = s.list(key, 2, c.minimum, c.maximum);
  if (range[0] >= range[1]) throw InputError(fmt::format("{}: '{}' must be a low and a higher end", s.where(), key));
  return range;
}

std::size_t explanatory_place(const Datasheet& sheet, const Settings& s, const std::string& name,
                              HistogramSettings& result) {
  const auto& names = result.explanatory_names;
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  const auto channel = static_cast<std::size_t>(sheet.channel(name));
  const Channel& c = sheet.channels[channel];
  const std::vector<double> range = span(s, name + "_range", c);
  result.explanatory.push_back({channel, range[0], (range[1] - range[0]) / kExplanatoryQuanta});
  result.explanatory_names.push_back(name);
  result.explanatory_units.push_back(c.unit);
  return names.size() - 1;
}

HistogramSettings read_settings(const Datasheet& sheet, const Settings& s) {
  HistogramSettings result;
  result.every = s.number_or("every", sheet.sample_period, sheet.sample_period, 1e6);
  result.bins = static_cast<int>(s.number_or("bins", 8, 2, kMostBins));
  result.single_bins = static_cast<int>(s.number_or("single_bins", result.bins, 2, kMostBins * kMostBins));
  result.shape.sections = 2 * static_cast<int>(s.number_or("sections", 32, 4, kMostSections) / 2);
  result.shape.coverage = s.number_or("coverage", 0.9, 0.01, 0.999);
  result.shape.minimum = samples(s, "minimum", result.every, 8, kMostMemory / 2);
  result.shape.memory = samples(s, "memory", result.every, 2 * result.shape.minimum, kMostMemory);
  result.shape.average_shift = shift(s, "average", result.every);
  result.shape.window_shift = shift(s, "window", result.every);
  result.learn = s.number("learn", 0, 1e9);
  result.freeze = s.number_or("freeze", 1, 0, 1);
  result.horizon = s.number_or("horizon", 0, 0, 1e9);
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    const std::string key = channel.name + "_by";
    if (!s.has(key)) continue;
    if (channel.ground_truth)
      throw InputError(fmt::format("{}: '{}': this channel is a simulator's only", s.where(), key));
    Observed o;
    o.scale = {c, channel.minimum,
               std::max(channel.resolution, (channel.maximum - channel.minimum) / (kExplanatoryQuanta - 1))};
    o.name = channel.name;
    o.unit = channel.unit;
    o.ends = span(s, channel.name + "_ends", channel);
    if (s.word(key) != "none")
      for (const std::string& name : split_words(s.word(key)))
        o.by.push_back(explanatory_place(sheet, s, name, result));
    if (o.by.size() > 2)
      throw InputError(
          fmt::format("{}: '{}' names {} channels; allowed are one, two or none", s.where(), key, o.by.size()));
    result.observed.push_back(std::move(o));
  }
  for (const std::string& name : split_words(s.word_or("common", ""))) {
    const auto found =
        std::find_if(result.observed.begin(), result.observed.end(), [&](const Observed& o) { return o.name == name; });
    if (found == result.observed.end())
      throw InputError(
          fmt::format("{}: 'common' names '{}', which is not observed; give '{}_by'", s.where(), name, name));
    found->common = true;
  }
  if (result.observed.empty())
    throw InputError(s.where() + ": no channel is observed; give CHANNEL_by for each, with what explains it or none");
  return result;
}

template <class A>
class HistogramStage : public Estimator {
 public:
  explicit HistogramStage(HistogramSettings settings) : settings_(std::move(settings)) {
    for (const Observed& o : settings_.observed) {
      HistogramShape shape = settings_.shape;
      for (std::size_t i = 0; i < o.by.size(); ++i) shape.bins[i] = bins_of(o);
      histograms_.emplace_back(shape);
      if (settings_.horizon > 0)
        watches_.emplace_back(histograms_.back().bins().size(), o.ends[0], o.ends[1], shape.minimum, settings_.horizon);
    }
    points_.resize(watches_.size());
    explanatory_.resize(settings_.explanatory.size());
    bins_.assign(histograms_.size(), -1);
    values_.resize(histograms_.size());
  }

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override { return {}; }

  void begin(const double*) override {
    for (Histogram<A>& h : histograms_) h.restart();
    for (SaturationWatch& w : watches_) w.restart();
    for (Point& p : points_) p = Point();
    due_ = 0;
    judging_ = learnt_ >= settings_.learn;
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int) override {
    // A hundredth of a period for the jitter of the stamps.
    due_ += dt;
    if (due_ < 0.99 * settings_.every) return true;
    const double passed = due_;
    due_ = std::min(due_ - settings_.every, 0.5 * settings_.every);
    for (std::size_t i = 0; i < explanatory_.size(); ++i)
      explanatory_[i] = value(settings_.explanatory[i].quanta(channels[settings_.explanatory[i].channel]));
    const bool learning = !frozen();
    for (std::size_t i = 0; i < histograms_.size(); ++i) {
      const Observed& o = settings_.observed[i];
      bool good = status[o.scale.channel] == ChannelStatus::good;
      std::array<typename A::Value, 2> point{};
      for (std::size_t k = 0; k < o.by.size(); ++k) {
        point[k] = explanatory_[o.by[k]];
        good = good && status[settings_.explanatory[o.by[k]].channel] == ChannelStatus::good;
      }
      bins_[i] = -1;
      if (!watches_.empty() && judging_) watches_[i].pass(passed);
      if (!good) continue;
      const std::size_t bin = histograms_[i].bin_of(point.data());
      bins_[i] = static_cast<int>(bin);
      values_[i] = channels[o.scale.channel];
      const typename A::Value q = value(o.scale.quanta(values_[i]));
      if (judging_ && histograms_[i].judge(bin, q) && !watches_.empty()) watch(i, bin);
      if (learning) histograms_[i].learn(bin, q);
    }
    if (learning) learnt_ += passed;
    if (!judging_ && learnt_ >= settings_.learn) judging_ = true;
    return true;
  }

  void write(const double*, bool, Estimate& estimate) const override {
    if (estimate.quantities.empty()) {
      estimate.quantities.push_back({"judging", "1", 0, 0});
      for (const Observed& o : settings_.observed)
        for (const char* what : {".average", ".above", ".below", ".level"})
          estimate.quantities.push_back({o.name + what, "1", 0, 0});
      for (std::size_t i = 0; i < watches_.size(); ++i)
        for (const char* what : {".saturation", ".saturation_low", ".saturation_high"})
          estimate.quantities.push_back({settings_.observed[i].name + what, "s", kNever, 0});
    }
    estimate.quantities[0].value = judging_;
    for (std::size_t i = 0; i < histograms_.size(); ++i) {
      Quantity* first = &estimate.quantities[4 * i + 1];
      first[0].value = histograms_[i].average();
      first[1].value = histograms_[i].above();
      first[2].value = histograms_[i].below();
      first[3].value = histograms_[i].level();
    }
    for (std::size_t i = 0; i < watches_.size(); ++i) {
      const Crossing crossing = watches_[i].crossing();
      Quantity* first = &estimate.quantities[4 * histograms_.size() + 3 * i + 1];
      first[0].value = crossing.value;
      first[1].value = crossing.low;
      first[2].value = crossing.high;
    }
    estimate.observed = 0;
  }

  std::vector<HistogramView> histograms() const override {
    std::vector<HistogramView> views;
    for (std::size_t i = 0; i < histograms_.size(); ++i) views.push_back(view(i));
    return views;
  }

  std::optional<Reference> reference() const override {
    if (learnt_ == 0) return {};  // a restart while it learns goes on learning
    Reference r;
    r.type = kType;
    r.version = kVersion;
    r.names = names();
    r.numbers = head();
    r.numbers.push_back(learnt_);
    for (const Histogram<A>& h : histograms_)
      for (std::size_t b = 0; b < h.bins().size(); ++b) {
        r.numbers.push_back(h.bins()[b].first);
        r.numbers.push_back(h.bins()[b].shift);
        for (int k = 0; k < h.shape().sections; ++k) r.numbers.push_back(static_cast<double>(h.counts(b)[k]));
      }
    return r;
  }

  void restore(const Reference& given) override {
    check_reference(given, kType, kVersion, names());
    const std::vector<double> own = head();
    for (std::size_t i = 0; i < own.size(); ++i)
      if (given.numbers[i] != own[i])
        throw InputError(fmt::format("the reference was learnt with {} = {:g}, this stage has {:g}; learn it anew",
                                     given.names[i], given.numbers[i], own[i]));
    const double* next = given.numbers.data() + own.size();
    const double learnt = *next++;
    std::vector<Histogram<A>> fresh;
    for (const Histogram<A>& old : histograms_) {
      Histogram<A> h(old.shape());
      for (std::size_t b = 0; b < h.bins().size(); ++b) {
        if (!(std::abs(next[0]) <= kExplanatoryQuanta) || !(next[1] >= 0 && next[1] <= kMostShift + 1) ||
            !h.restore(b, static_cast<std::int32_t>(next[0]), static_cast<int>(next[1]), next + 2))
          throw InputError("the reference holds numbers that are no histogram; learn it anew");
        next += 2 + h.shape().sections;
      }
      fresh.push_back(std::move(h));
    }
    histograms_ = std::move(fresh);
    learnt_ = learnt;
    judging_ = learnt_ >= settings_.learn;
  }

 private:
  struct Point {
    std::size_t bin = 0;
    int count = 0;  // samples since it jumped
  };

  static typename A::Value value(double quanta) {
    if constexpr (std::is_integral_v<typename A::Value>)
      return static_cast<typename A::Value>(std::clamp(std::floor(quanta + 0.5), -kFarQuanta, kFarQuanta));
    else
      return quanta;
  }

  double plain(const Observed& o, double quanta) const { return o.scale.low + quanta * o.scale.quantum; }

  void anchor(std::size_t i, std::size_t bin) {
    const auto& b = histograms_[i].bins()[bin];
    const auto value = [&](typename A::Value q) { return plain(settings_.observed[i], static_cast<double>(q)); };
    watches_[i].anchor(bin, value(b.mean), value(b.low), value(b.high));
  }

  // Whether the operating point has not jumped, from a bin to none of its neighbours, for twice the moving average:
  // what a step leaves behind is no drift.
  bool settled(std::size_t i, std::size_t bin) {
    Point& last = points_[i];
    const std::size_t wide = settings_.observed[i].by.size() > 1 ? static_cast<std::size_t>(settings_.bins) : kOneRow;
    const auto apart = [](std::size_t a, std::size_t b) { return a > b ? a - b : b - a; };
    if (std::max(apart(bin % wide, last.bin % wide), apart(bin / wide, last.bin / wide)) > 1) last.count = 0;
    last.bin = bin;
    last.count = std::min(last.count + 1, 2 << settings_.shape.average_shift);
    return last.count == 2 << settings_.shape.average_shift;
  }

  // All bins that know enough at the first judged sample, others when they do.
  void watch(std::size_t i, std::size_t bin) {
    if (!watches_[i].started())
      for (std::size_t b = 0; b < histograms_[i].bins().size(); ++b)
        if (histograms_[i].ready(b)) anchor(i, b);
    if (!watches_[i].anchored(bin)) anchor(i, bin);
    if (settled(i, bin)) watches_[i].add(bin, values_[i]);
  }

  int bins_of(const Observed& o) const { return o.by.size() > 1 ? settings_.bins : settings_.single_bins; }

  // What nothing explains may move without a fault.
  bool frozen() const {
    bool beyond = false;
    for (std::size_t i = 0; i < histograms_.size(); ++i) {
      const Observed& o = settings_.observed[i];
      if (std::max(histograms_[i].above(), histograms_[i].below()) <= settings_.freeze) continue;
      if (o.common) return false;
      beyond = beyond || !o.by.empty();
    }
    return beyond;
  }

  // What the numbers of a reference mean, beside them, so that they are not taken for others.
  std::vector<double> head() const {
    std::vector<double> head = {static_cast<double>(settings_.bins), static_cast<double>(settings_.single_bins),
                                static_cast<double>(settings_.shape.sections), settings_.every};
    for (const Scale& e : settings_.explanatory) head.insert(head.end(), {e.low, e.quantum});
    return head;
  }
  std::vector<std::string> names() const {
    std::vector<std::string> names = {"bins", "single_bins", "sections", "every"};
    for (const std::string& name : settings_.explanatory_names)
      names.insert(names.end(), {name + ".low", name + ".quantum"});
    names.push_back("learnt");
    for (std::size_t i = 0; i < histograms_.size(); ++i) {
      std::string by;
      for (const std::size_t k : settings_.observed[i].by) by += "|" + settings_.explanatory_names[k];
      for (std::size_t b = 0; b < histograms_[i].bins().size(); ++b)
        names.insert(names.end(), static_cast<std::size_t>(settings_.shape.sections) + 2,
                     settings_.observed[i].name + by);
    }
    return names;
  }

  HistogramView view(std::size_t i) const {
    const Histogram<A>& h = histograms_[i];
    const Observed& o = settings_.observed[i];
    HistogramView v;
    v.variable = o.name;
    v.unit = o.unit;
    for (const std::size_t k : o.by) {
      const Scale& e = settings_.explanatory[k];
      v.axes.push_back({settings_.explanatory_names[k], settings_.explanatory_units[k], e.low,
                        e.low + e.quantum * kExplanatoryQuanta, bins_of(o)});
    }
    v.sections = settings_.shape.sections;
    const double none = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t b = 0; b < h.bins().size(); ++b) {
      const auto& bin = h.bins()[b];
      const double wide = std::ldexp(1.0, bin.shift);
      v.population.push_back(bin.population);
      v.start.push_back(bin.population > 0 ? plain(o, bin.first * wide - 0.5) : none);
      v.width.push_back(bin.population > 0 ? wide * o.scale.quantum : none);
      v.mean.push_back(h.ready(b) ? plain(o, static_cast<double>(bin.mean)) : none);
      v.low.push_back(h.ready(b) ? plain(o, static_cast<double>(bin.low)) : none);
      v.high.push_back(h.ready(b) ? plain(o, static_cast<double>(bin.high)) : none);
      for (int k = 0; k < v.sections; ++k) v.counts.push_back(static_cast<double>(h.counts(b)[k]));
    }
    v.bin = bins_[i];
    v.value = values_[i];
    v.average = h.average();
    v.above = h.above();
    v.below = h.below();
    return v;
  }

  HistogramSettings settings_;
  std::vector<Histogram<A>> histograms_;
  std::vector<SaturationWatch> watches_;  // none without a horizon
  std::vector<Point> points_;             // of each watch
  std::vector<typename A::Value> explanatory_;
  std::vector<int> bins_;  // of the last sample
  std::vector<double> values_;
  double due_ = 0, learnt_ = 0;  // s
  bool judging_ = false;
};

std::unique_ptr<Estimator> make_histograms(const Datasheet& sheet, const StageSpec& spec) {
  HistogramSettings settings = read_settings(sheet, spec.settings);
  const std::string arithmetic = spec.settings.word_or("arithmetic", "floating");
  if (arithmetic == "integer") return std::make_unique<HistogramStage<IntegerArithmetic>>(std::move(settings));
  if (arithmetic == "floating") return std::make_unique<HistogramStage<FloatingArithmetic>>(std::move(settings));
  throw InputError(
      fmt::format("{}: 'arithmetic' is '{}'; it must be floating or integer", spec.settings.where(), arithmetic));
}

FAULTLINE_ESTIMATOR(histogram, {"histogram", "histogram", false, make_histograms});

}  // namespace
}  // namespace faultline
