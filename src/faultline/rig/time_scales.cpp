#include "faultline/rig/time_scales.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "faultline/numerics/integrator.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::array kLevels = {0.5, 0.3, 0.7, 0.2, 0.8, 0.4, 0.6, 0.1, 0.9};  // of the commands' ranges
constexpr int kLongestLevel = 2000;                                            // sample periods
constexpr double kRest = 0.02;          // of what a state moved through, in the second half of a level
constexpr double kDifference = 1e-5;    // of a state's size: third root of the rounding error
constexpr double kLongestMemory = 1e5;  // sample periods
constexpr double kNoModePeriods = 100;  // sample periods: as a sampling rate is commonly chosen
constexpr double kSettled = 0.05;       // of a state's way
constexpr double kMoved = 0.1;          // of what a state moves through in the test, from which a step moved it
constexpr double kModeSettles = 3;      // scales, to 5 %
constexpr double kLongestBend = 50;     // samples
constexpr std::size_t kNoises = 16;     // that a watch is tried with: up to 3e4 times the channel's
constexpr int kFirstPoint = 4, kPointRatio = 4;  // sample periods; from one point to the next

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Modes of one point.
struct Modes {
  double slowest = 0, fastest = 0;  // s; 0: none
  int integrators = 0;
};

Modes modes_of(const Eigen::MatrixXd& jacobian, double period) {
  Modes modes;
  const Eigen::VectorXcd values = Eigen::EigenSolver<Eigen::MatrixXd>(jacobian, false).eigenvalues();
  for (const auto& value : values) {
    const double decay = -value.real(), rate = std::abs(value);
    if (decay * kLongestMemory * period < 1) {
      ++modes.integrators;
      continue;
    }
    modes.slowest = std::max({modes.slowest, 1 / decay, period});
    if (rate * period <= 1) modes.fastest = modes.fastest > 0 ? std::min(modes.fastest, 1 / rate) : 1 / rate;
  }
  return modes;
}

// The detector of noise, as the model's own motion goes by, set for several noises at once.
class BendWatch {
 public:
  BendWatch(double noise, double resolution) : least_(noise * noise + resolution * resolution / 12) {}
  void take(double square) {
    double own = least_;
    for (Noise& n : noises_) {
      const double limit = kNoisyLimit * kNoisyLimit * own;
      n.mean += (std::min(square, limit * kNoisyWindow / 3) - n.mean) / kNoisyWindow;
      n.beyond = n.mean > limit ? n.beyond + 1 : 0;
      n.longest = std::max(n.longest, n.beyond);
      own *= 4;
    }
  }
  Bends bends() const {
    Bends bends;
    for (const Noise& n : noises_) {
      bends.samples = n.longest;
      if (n.longest <= kLongestBend) break;
      bends.noise *= 2;
    }
    return bends;
  }

 private:
  struct Noise {
    double mean = 0, beyond = 0, longest = 0;  // samples
  };
  double least_;
  std::array<Noise, kNoises> noises_;
};

class Tester {
 public:
  explicit Tester(const Datasheet& sheet)
      : sheet_(sheet),
        type_(find_rig_type(sheet.rig)),
        effects_(sheet, nominal_effects(sheet), sheet.sample_period, 1),
        period_(sheet.sample_period) {
    if (!type_)
      throw InputError(
          fmt::format("{}: this build has the datasheet of '{}' but not its equations", sheet.file, sheet.rig));
    rig_ = type_->make(sheet, sheet.nominal(), effects_);
    integrator_ = make_integrator(*rig_);
    substeps_ = model_substeps(sheet, {});
    const std::size_t n = sheet.states.size();
    states_ = static_cast<std::size_t>(rig_->states());
    channels_.resize(sheet.channels.size());
    shown_.resize(sheet.channels.size());
    low_.assign(states_, kInfinity);
    high_.assign(states_, -kInfinity);
    half_.resize(states_);
    before_.resize(sheet.channels.size());
    last_ = before_;
    for (const Channel& channel : sheet.channels) bends_.emplace_back(channel.noise_std, channel.resolution);
    result_.lowest.resize(n);
    result_.highest.resize(n);
  }

  StepTest run() {
    std::array<bool, kLevels.size()> inside{};
    for (std::size_t i = 0; i < kLevels.size(); ++i) inside[i] = hold(kLevels[i]);
    take_range(inside);
    for (std::size_t i = 0; i < sheet_.states.size(); ++i) {
      result_.lowest[i] = std::min(low_[i], high_[i]);
      result_.highest[i] = std::max(low_[i], high_[i]);
    }
    for (const BendWatch& watch : bends_) result_.bends.push_back(watch.bends());
    TimeScales& scales = result_.scales;
    scales.fastest_s = fastest_.empty() ? period_ : median(fastest_);
    scales.slowest_s = std::max(slowest_.empty() ? kNoModePeriods * period_ : median(slowest_), scales.fastest_s);
    if (!hidden_.empty()) scales.hidden_s = median(hidden_);
    scales.settling_s = settled_.empty() ? kModeSettles * scales.slowest_s : median(settled_);
    return std::move(result_);
  }

 private:
  void set_channels(double fraction) {
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      const Channel& channel = sheet_.channels[c];
      if (channel.role == Role::input) channels_[c] = input_value(sheet_, channel);
      if (channel.role != Role::command) continue;
      channels_[c] = channel.ground_truth ? std::clamp(0.0, channel.minimum, channel.maximum)
                                          : channel.minimum + fraction * (channel.maximum - channel.minimum);
    }
    for (std::size_t c = 0; c < channels_.size(); ++c)
      if (!sheet_.channels[c].predicted_by.empty())
        channels_[c] = channels_[static_cast<std::size_t>(sheet_.channel(sheet_.channels[c].predicted_by))];
  }

  // False where the rig cannot be held there: no state of rest, no finite state, or an output beyond its range.
  bool hold(double fraction) {
    set_channels(fraction);
    if (!running_) {
      std::fill_n(integrator_->state(), states_, 0.0);
      try {
        rig_->start(channels_.data(), integrator_->state());
      } catch (const InputError&) {
        return false;
      }
      effects_.reset();
      running_ = true;
      rows_ = 0;
    }
    int next_point = kFirstPoint;
    bool inside = true;
    way_.clear();
    for (int k = 1; k <= kLongestLevel; ++k) {
      if (!advance()) return running_ = false;
      inside = look() && inside;
      way_.insert(way_.end(), integrator_->state(), integrator_->state() + states_);
      const bool doubled = (k & (k - 1)) == 0 && k >= kFirstPoint;
      const bool rests = doubled && at_rest();
      if (doubled) std::copy_n(integrator_->state(), states_, half_.begin());
      if (k == next_point || rests || k == kLongestLevel) take_point();
      if (k == next_point) next_point *= kPointRatio;
      if (!rests) continue;
      take_settling();
      break;
    }
    return inside;
  }

  // Of a level that came to rest.
  void take_settling() {
    const std::size_t rows = way_.size() / states_;
    std::size_t longest = 0;
    for (std::size_t i = 0; i < states_; ++i) {
      const auto off = [&](std::size_t row) { return std::abs(way_[row * states_ + i] - integrator_->state()[i]); };
      double largest = 0;
      for (std::size_t row = 0; row < rows; ++row) largest = std::max(largest, off(row));
      if (largest <= kMoved * (high_[i] - low_[i])) continue;
      std::size_t row = rows;
      while (row > 0 && off(row - 1) <= kSettled * largest) --row;
      longest = std::max(longest, row + 1);
    }
    if (longest > 0) settled_.push_back(static_cast<double>(longest) * period_);
  }

  bool advance() {
    for (int i = 0; i < substeps_; ++i) {
      integrator_->step(time_, period_ / substeps_, channels_.data());
      time_ += period_ / substeps_;
    }
    const double* state = integrator_->state();
    for (std::size_t i = 0; i < states_; ++i) {
      if (!std::isfinite(state[i])) return false;
      low_[i] = std::min(low_[i], state[i]);
      high_[i] = std::max(high_[i], state[i]);
    }
    return true;
  }

  // Whether every output is within its range.
  bool look() {
    std::copy(channels_.begin(), channels_.end(), shown_.begin());
    rig_->outputs(time_, integrator_->state(), shown_.data());
    bool inside = true;
    ++rows_;
    for (std::size_t c = 0; c < shown_.size(); ++c) {
      const Channel& channel = sheet_.channels[c];
      if (channel.role != Role::output) continue;
      inside = inside && shown_[c] >= channel.minimum && shown_[c] <= channel.maximum;
      const double second = shown_[c] - 2 * last_[c] + before_[c];
      before_[c] = last_[c];
      last_[c] = shown_[c];
      if (rows_ >= 3) bends_[c].take(second * second / 6);
    }
    return inside;
  }

  // Since the level was half as long.
  bool at_rest() const {
    for (std::size_t i = 0; i < states_; ++i)
      if (std::abs(integrator_->state()[i] - half_[i]) > kRest * (high_[i] - low_[i])) return false;
    return true;
  }

  double size_of(std::size_t i) const {
    const double seen = std::max(std::abs(low_[i]), std::abs(high_[i]));
    if (seen > 0) return seen;
    const int channel = i < sheet_.states.size() ? sheet_.states[i].channel : -1;
    if (channel < 0) return 1;
    const Channel& c = sheet_.channels[static_cast<std::size_t>(channel)];
    return std::max(std::abs(c.minimum), std::abs(c.maximum));
  }

  void take_point() {
    const auto n = static_cast<Eigen::Index>(states_);
    const Eigen::Map<const Eigen::VectorXd> state(integrator_->state(), n);
    Eigen::MatrixXd jacobian(n, n);  // of the states in their sizes
    Eigen::VectorXd probe = state, above(n), below(n), middle(n);
    rig_->derivative(time_, probe.data(), channels_.data(), middle.data());
    for (Eigen::Index j = 0; j < n; ++j) {
      const double size = size_of(static_cast<std::size_t>(j)), step = kDifference * size;
      probe[j] = state[j] + step;
      rig_->derivative(time_, probe.data(), channels_.data(), above.data());
      probe[j] = state[j] - step;
      rig_->derivative(time_, probe.data(), channels_.data(), below.data());
      probe[j] = state[j];
      // A root of a level that cannot be negative: from above alone.
      jacobian.col(j) =
          below.allFinite() ? Eigen::VectorXd((above - below) / (2 * step)) : Eigen::VectorXd((above - middle) / step);
      jacobian.col(j) *= size;
    }
    for (Eigen::Index i = 0; i < n; ++i) jacobian.row(i) /= size_of(static_cast<std::size_t>(i));
    if (!jacobian.allFinite()) return;
    const Modes modes = modes_of(jacobian, period_);
    if (modes.slowest > 0) slowest_.push_back(modes.slowest);
    if (modes.fastest > 0) fastest_.push_back(modes.fastest);
    std::vector<Eigen::Index> unseen;
    for (std::size_t i = 0; i < sheet_.states.size(); ++i)
      if (sheet_.states[i].channel < 0) unseen.push_back(static_cast<Eigen::Index>(i));
    if (!unseen.empty())
      if (const double hidden = modes_of(jacobian(unseen, unseen), period_).slowest; hidden > 0)
        hidden_.push_back(hidden);
    result_.scales.integrators = std::max(result_.scales.integrators, modes.integrators);
    result_.points.push_back({{state.data(), state.data() + sheet_.states.size()}, shown_});
  }

  // The longest run of levels, side by side, that keep every output inside; none: all levels.
  void take_range(const std::array<bool, kLevels.size()>& inside) {
    std::vector<std::pair<double, bool>> levels;
    for (std::size_t i = 0; i < kLevels.size(); ++i) levels.push_back({kLevels[i], inside[i]});
    std::sort(levels.begin(), levels.end());
    std::size_t longest = 0;
    for (std::size_t i = 0, length = 0; i < levels.size(); ++i) {
      length = levels[i].second ? length + 1 : 0;
      if (length <= longest) continue;
      longest = length;
      result_.high_fraction = levels[i].first;
      result_.low_fraction = levels[i + 1 - length].first;
    }
  }

  const Datasheet& sheet_;
  const RigType* type_;
  EffectSet effects_;
  double period_;
  std::unique_ptr<Rig> rig_;
  std::unique_ptr<Integrator> integrator_;
  int substeps_ = 1, rows_ = 0;
  std::size_t states_ = 0;
  bool running_ = false;
  double time_ = 0;
  std::vector<double> channels_, shown_;
  std::vector<double> low_, high_, half_;                     // per state
  std::vector<double> last_, before_;                         // per channel
  std::vector<BendWatch> bends_;                              // likewise
  std::vector<double> slowest_, fastest_, settled_, hidden_;  // s
  std::vector<double> way_;                                   // states of the present level, one row a period
  StepTest result_;
};

}  // namespace

StepTest step_test(const Datasheet& sheet) { return Tester(sheet).run(); }
TimeScales time_scales(const Datasheet& sheet) { return step_test(sheet).scales; }

double input_value(const Datasheet& sheet, const Channel& channel) {
  for (const InputSignal& input : sheet.inputs)
    if (input.channel == channel.name) return input.level.value;
  return 0.5 * (channel.minimum + channel.maximum);
}

}  // namespace faultline
