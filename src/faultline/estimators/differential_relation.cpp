// A linear differential equation between channels of a rig as a relation (relation_model.h): the continuous-time
// parameter estimation of Young (1981) and Isermann (1993), as in Yu (1997), equations (1)-(10), (18).
//
//   relation: "y' = p_1 u_1 + p_2 u_2' + ..."     channels, one ' a derivative; any channel on either side
// Every term goes through the same state variable filter (signal/state_variable_filter.h), so the equation holds
// between what comes out; its derivatives are the filter's. Least squares see u_i times `first` and p_i over `first`.
//
// Settings: relation; units, of the parameters, between commas, such as "1/s, rpm/(s bar)": in these they are given and
// told; first, a list: values at the start, not 0, of about the right size; filter_order [up to 4]; bandwidth [rad/s];
// interpolation [0 to 3]; excitation: smallest |p_first u| that says something, in the SI unit of the left side; least
// [none]: of the left side's channel, below which the equation does not hold (dry friction of a shaft that hardly
// turns): such rows are left out.
//
// Noise: the channels' noise_std and rounding, white, through the filter, at p = first; its autocovariance goes to the
// covariance of the estimates (coloured_noise.h). The filters begin at the first sample, and again after a hole of more
// than 1/bandwidth (or of two samples where that is longer); no row is given until (order + 6)/bandwidth later. A
// sample in which one of the channels is missing, out of range or, where it is noisy, at the end of its range (it may
// be anything beyond) is no sample for the filters. The innovation bears the name of the channel on the left.
// Blind to terms that the equation lacks (a constant torque, an offset): they move the parameters. Noise of the u_i
// pulls all p_i towards zero, the more the less the channels move.
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/estimators/recursive_least_squares.h"
#include "faultline/estimators/relation_model.h"
#include "faultline/signal/error.h"
#include "faultline/signal/state_variable_filter.h"
#include "faultline/signal/units.h"

namespace faultline {
namespace {

constexpr double kSlowest = 0.01, kFastest = 10;  // bandwidth times sample period
constexpr double kSettling = 6;                   // more than the order, in 1/bandwidth: (w t)^(n-1) e^(-w t) is small
constexpr double kLeastCorrelation = 0.005;       // that counts
constexpr double kHoleSamples = 3;                // from one sample to the next over two lost ones

int whole(const Settings& settings, const std::string& key, int minimum, int maximum) {
  const double value = settings.number(key, minimum, maximum);
  if (value != std::floor(value))
    throw InputError(fmt::format("{}: '{}' is {:g}; it must be a whole number", settings.where(), key, value));
  return static_cast<int>(value);
}

// Between commas; units have spaces within.
std::vector<std::string> texts_of(const std::string& list) {
  std::vector<std::string> result;
  std::istringstream parts(list);
  for (std::string part; std::getline(parts >> std::ws, part, ',');) result.push_back(part);
  return result;
}

// A noisy reading at the end of its range may be anything beyond.
bool within(const Channel& channel, double value) {
  return channel.noise_std == 0 || (value > channel.minimum && value < channel.maximum);
}

struct Term {
  std::size_t signal;  // among those filtered
  int derivative;
};

class DifferentialRelation : public RelationModel {
 public:
  DifferentialRelation(const Datasheet& sheet, const Settings& settings)
      : known_(sheet.channels),
        period_(sheet.sample_period),
        where_(settings.where()),
        order_(whole(settings, "filter_order", 1, StateVariableFilter::kMaximumOrder)),
        bandwidth_(settings.number("bandwidth", kSlowest / period_, kFastest / period_)),
        interpolation_(whole(settings, "interpolation", 0, StateVariableFilter::kMaximumInterpolation)),
        hole_(std::max(kHoleSamples * period_, 1 / bandwidth_) + period_ / 2) {
    read(settings.word("relation"));
    units_ = texts_of(settings.word("units"));
    first_ =
        settings.list("first", names_.size(), -std::numeric_limits<double>::max(), std::numeric_limits<double>::max());
    excitation_ = settings.number("excitation", std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
    least_ = settings.number_or("least", -std::numeric_limits<double>::max(), -std::numeric_limits<double>::max(),
                                std::numeric_limits<double>::max());
    if (units_.size() != names_.size())
      throw InputError(fmt::format("{}: 'units' must name {} units, one for each of {}; it names {}", where_,
                                   names_.size(), fmt::join(names_, ", "), units_.size()));
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (first_[i] == 0)
        throw InputError(
            fmt::format("{}: 'first' of {} is 0; give a value of about the right size", where_, names_[i]));
      si_.push_back(unit_in_si(i));
    }
    filter_ = std::make_unique<StateVariableFilter>(order_, bandwidth_, interpolation_, channels_.size());
    signals_.resize(channels_.size());
  }

  std::vector<Relation> relations() const override {
    Relation relation;
    relation.name = channel(left_.signal).name;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      relation.coefficients.push_back({names_[i], names_[i], units_[i]});
      relation.scale.push_back(std::abs(first_[i]));
    }
    relation.first = first_;
    for (const std::size_t c : channels_) relation.channels.push_back(static_cast<int>(c));
    relation.excitation = excitation_;
    relation.noise = noise();
    return {relation};
  }

  void reset(const double* channels) override {
    take(channels);
    filter_->reset(signals_.data());
    settled_ = since_ = 0;
  }

  void advance(const double* channels, const ChannelStatus* status, double dt) override {
    since_ += dt;
    fresh_ = std::all_of(channels_.begin(), channels_.end(), [&](std::size_t c) {
      return status[c] == ChannelStatus::good && within(known_[c], channels[c]);
    });
    if (!fresh_) return;
    if (since_ > hole_) return reset(channels);
    take(channels);
    filter_->step(signals_.data(), since_);
    settled_ += since_;
    since_ = 0;
  }

  void renew() override { settled_ = 0; }

  double row(std::size_t, double* h) const override {
    if (!fresh_ || settled_ < (order_ + kSettling) / bandwidth_ || filter_->value(left_.signal, 0) < least_)
      return std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < right_.size(); ++i)
      h[i] = si_[i] * filter_->value(right_[i].signal, right_[i].derivative);
    return filter_->value(left_.signal, left_.derivative);
  }

  void quantities(const double*, std::vector<Quantity>&) const override {}

 private:
  const Channel& channel(std::size_t signal) const { return known_[channels_[signal]]; }

  [[noreturn]] void refuse(const std::string& text, const std::string& why) const {
    throw InputError(
        fmt::format("{}: 'relation' is \"{}\": {}; write it as \"level' = a level + b inflow\", with a ' "
                    "for each derivative",
                    where_, text, why));
  }

  Term term(const std::string& text, std::string word) {
    Term result{0, 0};
    for (; !word.empty() && word.back() == '\''; word.pop_back()) ++result.derivative;
    if (result.derivative >= order_)
      refuse(text, fmt::format("a filter of order {} has no derivative {} of '{}' (its highest is {})", order_,
                               result.derivative, word, order_ - 1));
    const int found = find_channel(known_, word);
    if (found < 0) {
      std::vector<std::string> known;
      for (const Channel& c : known_) known.push_back(c.name);
      refuse(text, fmt::format("the rig has no channel '{}'; it has {}", word, fmt::join(known, ", ")));
    }
    const auto place = std::find(channels_.begin(), channels_.end(), static_cast<std::size_t>(found));
    result.signal = static_cast<std::size_t>(place - channels_.begin());
    if (place == channels_.end()) channels_.push_back(static_cast<std::size_t>(found));
    return result;
  }

  void read(const std::string& text) {
    std::istringstream words(text);
    std::string word, sign;
    if (!(words >> word >> sign) || sign != "=") refuse(text, "there is no '=' behind its first word");
    left_ = term(text, word);
    for (std::string name; words >> name;) {
      if (!(words >> word)) refuse(text, fmt::format("'{}' stands alone at its end", name));
      if (std::find(names_.begin(), names_.end(), name) != names_.end())
        refuse(text, fmt::format("two parameters are called '{}'", name));
      names_.push_back(name);
      right_.push_back(term(text, word));
      if (words >> sign && sign != "+") refuse(text, fmt::format("'{}' stands where '+' should", sign));
    }
    if (names_.empty() || names_.size() > kMaximumRegressors)
      refuse(text, fmt::format("it has {} parameters where 1 to {} are allowed", names_.size(), kMaximumRegressors));
  }

  // How much one unit of a parameter is in SI, if it measures what the relation says.
  double unit_in_si(std::size_t i) const {
    const Unit y = parse_unit(channel(left_.signal).unit), u = parse_unit(channel(right_[i].signal).unit);
    Unit unit;
    try {
      unit = parse_unit(units_[i]);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: 'units' of {}: {}", where_, names_[i], error.what()));
    }
    for (std::size_t d = 0; d < y.dimension.size(); ++d) {
      const double seconds = d == 2 ? right_[i].derivative - left_.derivative : 0;
      if (std::abs(y.dimension[d] - u.dimension[d] + seconds - unit.dimension[d]) > 1e-9)
        throw InputError(fmt::format("{}: 'units' gives {} in {}, which is not ({})/s^{} per ({})/s^{}", where_,
                                     names_[i], units_[i], channel(left_.signal).unit, left_.derivative,
                                     channel(right_[i].signal).unit, right_[i].derivative));
    }
    return unit.scale;
  }

  void take(const double* channels) {
    for (std::size_t s = 0; s < channels_.size(); ++s) signals_[s] = channels[channels_[s]];
  }

  std::vector<double> noise() const {
    // What one wrong sample of each channel leaves of the relation: its response through the filter.
    StateVariableFilter filter(order_, bandwidth_, interpolation_, 1);
    const double zero = 0, one = 1;
    filter.reset(&zero);
    for (int k = 0; k < StateVariableFilter::kMaximumInterpolation; ++k) filter.step(&zero, period_);
    const auto memory = static_cast<std::size_t>((order_ + 20) / (bandwidth_ * period_)) + 10;
    std::vector<std::vector<double>> left(channels_.size(), std::vector<double>(memory));
    for (std::size_t k = 0; k < memory; ++k) {
      filter.step(k == 0 ? &one : &zero, period_);
      left[left_.signal][k] += filter.value(0, left_.derivative);
      for (std::size_t i = 0; i < right_.size(); ++i)
        left[right_[i].signal][k] -= first_[i] * si_[i] * filter.value(0, right_[i].derivative);
    }
    std::vector<double> result(memory, 0);
    std::size_t last = 0;
    for (std::size_t lag = 0; lag < memory; ++lag) {
      for (std::size_t s = 0; s < channels_.size(); ++s) {
        const Channel& c = channel(s);
        const double variance = c.noise_std * c.noise_std + c.resolution * c.resolution / 12;
        for (std::size_t k = lag; k < memory; ++k) result[lag] += variance * left[s][k] * left[s][k - lag];
      }
      if (std::abs(result[lag]) > kLeastCorrelation * result[0]) last = lag;
    }
    if (result[0] == 0) return {};
    result.resize(last + 1);
    return result;
  }

  std::vector<Channel> known_;
  double period_;  // s
  std::string where_;
  int order_;
  double bandwidth_;
  int interpolation_;
  double hole_;
  Term left_{};
  std::vector<Term> right_;
  std::vector<std::string> names_, units_;
  std::vector<double> first_, si_;
  double excitation_ = 0, least_ = 0;
  std::vector<std::size_t> channels_;  // of the rig, that are filtered
  std::unique_ptr<StateVariableFilter> filter_;
  std::vector<double> signals_;
  double settled_ = 0, since_ = 0;  // s, of the filters; since the last sample they took
  bool fresh_ = true;
};

FAULTLINE_RELATION_MODEL(differential_relation,
                         {"differential_relation", make_relation_model_of<DifferentialRelation>});

}  // namespace
}  // namespace faultline
