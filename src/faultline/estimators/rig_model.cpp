// rig_model: any rig's own equations as filters see them (rig/step_model.h), so that a rig without an observer of its
// own has a state estimator.
//
//   x      the datasheet's states;  u  commands and measured inputs;  y  output channels that are no ground truth (at
//          most kMaximumOutputs: those that measure a state first)
//   x+     = the rig over one sample period, commands held, measured inputs linear;  y = outputs before their sensors
//   R      noise_std^2 + resolution^2/12 of each channel, at least (1e-5 of its range)^2
//   x_0    a measured state is what its channel says, with R; another one the rig's own start under the first sample's
//          commands, with the variance of what it moved through in a step test (uniform: (highest - lowest)^2/12)
//   Q      the parameters' tolerances: the mean square, over the points of a step test (rig/time_scales.h), of the
//          change of x+ in one period by a tolerance of each parameter, all added; and by the noise of measured inputs.
//          A parameter that is off makes an error b in every step, which a filter of gain K lets grow to b/K; K follows
//          root(Q/R), so that at Q = b^2 this is as large as the rest of the innovation, and at most doubles its
//          variance. At least (1e-3 of what the state moves through)^2 T/tau: no equations are exact.
// A reading at the end of its range says only that the value is there or beyond: it is left out.
//
// Jacobians by central differences of 1e-4 of what a state moves through. Quantities: every channel as measured, every
// state (with `_estimate`, and its standard deviation), and per output the innovation over its standard deviation
// (`CHANNEL_innovation`).
// Settings: process_noise, measurement_noise, initial_variance (lists; as above without them).
// InputError for more than kMaximumStates states, and for a rig without outputs. Fails where states that nothing shows
// do not settle: they keep their prior.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "faultline/estimators/process_model.h"
#include "faultline/rig/step_model.h"
#include "faultline/rig/time_scales.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kDifference = 1e-4;   // of what a state moves through
constexpr double kLeastNoise = 1e-5;   // of a channel's range: no reading is exact
constexpr double kLeastMotion = 1e-3;  // of what a state moves through, per slowest time scale

class RigModel : public ProcessModel {
 public:
  RigModel(const Datasheet& sheet, const Settings& settings)
      : sheet_(sheet),
        n_(sheet.states.size()),
        model_(std::make_unique<StepModel>(sheet, std::vector<double>(), 2 * static_cast<int>(n_))) {
    if (n_ > static_cast<std::size_t>(kMaximumStates))
      throw InputError(fmt::format("rig_model takes rigs of up to {} states, {} has {}; write a process model of fewer",
                                   kMaximumStates, sheet.rig, n_));
    choose_outputs();
    const StepTest test = step_test(sheet);
    for (std::size_t i = 0; i < n_; ++i) {
      const double moved = test.highest[i] - test.lowest[i];
      const double size = std::max(std::abs(test.highest[i]), std::abs(test.lowest[i]));
      spread_.push_back(moved > 0 ? moved : size > 0 ? size : 1);
      middle_.push_back(0.5 * (test.highest[i] + test.lowest[i]));
    }
    for (std::vector<double>* v : {&before_, &now_, &shown_}) v->resize(sheet.channels.size());
    for (std::vector<double>* v : {&probe_, &above_, &below_}) v->resize(n_);
    for (std::vector<double>* v : {&y_above_, &y_below_}) v->resize(measured_.size());
    process_noise_ = settings.has("process_noise") ? settings.list("process_noise", n_, 0, 1e300) : noise_of(test);
    for (const int channel : measured_) {
      const Channel& c = sheet.channels[static_cast<std::size_t>(channel)];
      measurement_noise_.push_back(std::max(variance_of(c), std::pow(kLeastNoise * (c.maximum - c.minimum), 2)));
    }
    if (settings.has("measurement_noise"))
      measurement_noise_ = settings.list("measurement_noise", measured_.size(), 1e-300, 1e300);
    for (std::size_t i = 0; i < n_; ++i)
      initial_variance_.push_back(row_of_[i] >= 0 ? measurement_noise_[static_cast<std::size_t>(row_of_[i])]
                                                  : spread_[i] * spread_[i] / 12);
    if (settings.has("initial_variance")) initial_variance_ = settings.list("initial_variance", n_, 0, 1e300);
  }

  std::vector<State> states() const override { return sheet_.states; }
  std::vector<int> measured_channels() const override { return measured_; }
  std::vector<int> driving_channels() const override { return driving_; }
  std::vector<double> process_noise() const override { return process_noise_; }
  std::vector<double> measurement_noise() const override { return measurement_noise_; }

  void initial(const double* channels, double* state, double* variance) const override {
    phase_ = Phase::fresh;
    model_->prepare(0, channels, shown_.data());
    try {
      model_->start(shown_.data(), state);
    } catch (const InputError&) {  // no state of rest there
      std::copy(middle_.begin(), middle_.end(), state);
    }
    for (std::size_t i = 0; i < n_; ++i) {
      variance[i] = initial_variance_[i];
      if (row_of_[i] < 0) continue;
      const double shown = reading(static_cast<std::size_t>(row_of_[i]), channels);
      state[i] = std::isnan(shown) ? channels[measured_[static_cast<std::size_t>(row_of_[i])]] : shown;
      if (std::isnan(shown)) variance[i] = spread_[i] * spread_[i] / 12;
    }
  }

  // The stage asks before each prediction, with the sample to which it leads, and after the correction with the same
  // one: commands act from the sample before, measured inputs run from there to this one.
  bool inputs_at_end() const override { return true; }
  void take_inputs(const double* channels) override {
    if (phase_ != Phase::ahead) {
      before_ = now_;
      model_->prepare(0, channels, now_.data());
    }
    if (phase_ != Phase::settled) before_ = now_;
    phase_ = phase_ == Phase::settled ? Phase::ahead : Phase::settled;
  }

  void measurement(const double* channels, double* y) const override {
    for (std::size_t i = 0; i < measured_.size(); ++i) y[i] = reading(i, channels);
  }
  void predict(const double* state, double dt, double* next) const override {
    model_->advance(state, before_.data(), now_.data(), dt, next);
  }
  void predict_all(const double* all, int, int count, double dt, double* next) const override {
    model_->advance_all(all, count, before_.data(), now_.data(), dt, next);
  }
  void observe(const double* state, double* y) const override {
    model_->outputs(state, now_.data(), shown_.data());
    for (std::size_t i = 0; i < measured_.size(); ++i) y[i] = shown_[static_cast<std::size_t>(measured_[i])];
  }
  std::vector<int> observed_states() const override { return observed_; }

  bool jacobian(const double* state, double dt, double* a) const override {
    differences(state, n_, a, above_, below_, [&](const double* x, double* next) { predict(x, dt, next); });
    return true;
  }
  bool observe_jacobian(const double* state, double* c) const override {
    differences(state, measured_.size(), c, y_above_, y_below_, [&](const double* x, double* y) { observe(x, y); });
    return true;
  }

  void quantities(const double* channels, const double* state, const double* covariance,
                  std::vector<Quantity>& result) const override {
    const std::size_t count = sheet_.channels.size();
    if (result.empty()) {
      for (const Channel& c : sheet_.channels) result.push_back({c.name, c.unit, 0, 0});
      for (const State& s : sheet_.states) result.push_back({s.name + "_estimate", s.unit, 0, 0});
      for (const int channel : measured_)
        result.push_back({sheet_.channels[static_cast<std::size_t>(channel)].name + "_innovation", "1", 0, 0});
    }
    for (std::size_t c = 0; c < count; ++c) result[c].value = channels[c];
    for (std::size_t i = 0; i < n_; ++i) {
      result[count + i].value = state[i];
      result[count + i].std = std::sqrt(std::max(0.0, covariance[i * n_ + i]));
    }
  }
  void innovation_quantities(const double* innovation, const double* innovation_std,
                             std::vector<Quantity>& result) const override {
    for (std::size_t i = 0; i < measured_.size(); ++i)
      result[sheet_.channels.size() + n_ + i].value = innovation_std[i] > 0 ? innovation[i] / innovation_std[i] : 0;
  }

 private:
  enum class Phase { fresh, settled, ahead };  // what take_inputs was told last: nothing, the present, what comes

  static double variance_of(const Channel& c) { return c.noise_std * c.noise_std + c.resolution * c.resolution / 12; }

  // Those that measure a state come first, where there are more than a filter takes.
  void choose_outputs() {
    for (const bool of_state : {true, false})
      for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
        const Channel& channel = sheet_.channels[c];
        if (channel.role == Role::command || channel.role == Role::input) {
          if (of_state) driving_.push_back(static_cast<int>(c));
          continue;
        }
        if (channel.role != Role::output || channel.ground_truth) continue;
        const bool is_state = std::any_of(sheet_.states.begin(), sheet_.states.end(),
                                          [&](const State& s) { return s.channel == static_cast<int>(c); });
        if (is_state == of_state && measured_.size() < static_cast<std::size_t>(kMaximumOutputs))
          measured_.push_back(static_cast<int>(c));
      }
    if (measured_.empty())
      throw InputError(
          fmt::format("rig_model needs an output channel; {} has none that is no ground truth", sheet_.rig));
    std::sort(measured_.begin(), measured_.end());
    row_of_.assign(n_, -1);
    observed_.assign(measured_.size(), -1);
    for (std::size_t i = 0; i < n_; ++i)
      for (std::size_t row = 0; row < measured_.size(); ++row)
        if (measured_[row] == sheet_.states[i].channel) {
          row_of_[i] = static_cast<int>(row);
          observed_[row] = static_cast<int>(i);
        }
    if (std::find(observed_.begin(), observed_.end(), -1) != observed_.end()) observed_.clear();
  }

  // Before the sensor's static effects; NaN at the ends of its range.
  double reading(std::size_t row, const double* channels) const {
    const auto channel = static_cast<std::size_t>(measured_[row]);
    const Channel& c = sheet_.channels[channel];
    if (channels[channel] <= c.minimum || channels[channel] >= c.maximum) return std::nan("");
    return model_->undo_sensor(channel, channels[channel], 0);
  }

  std::vector<double> noise_of(const StepTest& test) const {
    std::vector<double> changes(n_), next(n_), other(n_);
    const auto add = [&] {
      for (std::size_t i = 0; i < n_; ++i) {
        const double change = other[i] - next[i];
        if (std::isfinite(change)) changes[i] += change * change / static_cast<double>(test.points.size());
      }
    };
    const double period = sheet_.sample_period;
    for (std::size_t p = 0; p < sheet_.parameters.size(); ++p) {
      if (sheet_.parameters[p].tolerance <= 0) continue;
      std::vector<double> parameters = sheet_.nominal();
      parameters[p] *= 1 + sheet_.parameters[p].tolerance;
      StepModel changed(sheet_, parameters);
      for (const StepTest::Point& point : test.points) {
        const double* channels = point.channels.data();
        model_->advance(point.state.data(), channels, channels, period, next.data());
        changed.advance(point.state.data(), channels, channels, period, other.data());
        add();
      }
    }
    for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
      const double variance = variance_of(sheet_.channels[c]);
      if (sheet_.channels[c].role != Role::input || variance <= 0) continue;
      for (const StepTest::Point& point : test.points) {
        std::vector<double> channels = point.channels;
        model_->advance(point.state.data(), channels.data(), channels.data(), period, next.data());
        channels[c] += std::sqrt(variance);
        model_->advance(point.state.data(), channels.data(), channels.data(), period, other.data());
        add();
      }
    }
    const double remembered = test.scales.slowest_s / period;  // samples
    std::vector<double> noise(n_);
    for (std::size_t i = 0; i < n_; ++i) {
      const double least = kLeastMotion * spread_[i];
      noise[i] = std::max(changes[i], least * least / remembered);
    }
    return noise;
  }

  // d function / d state, rows x states, row after row.
  template <class Function>
  void differences(const double* state, std::size_t rows, double* result, std::vector<double>& above,
                   std::vector<double>& below, Function&& function) const {
    std::copy_n(state, n_, probe_.begin());
    for (std::size_t j = 0; j < n_; ++j) {
      const double step = kDifference * spread_[j];
      probe_[j] = state[j] + step;
      function(probe_.data(), above.data());
      probe_[j] = state[j] - step;
      function(probe_.data(), below.data());
      probe_[j] = state[j];
      for (std::size_t i = 0; i < rows; ++i) result[i * n_ + j] = (above[i] - below[i]) / (2 * step);
    }
  }

  Datasheet sheet_;
  std::size_t n_;
  std::unique_ptr<StepModel> model_;
  std::vector<int> measured_, driving_, observed_;
  std::vector<int> row_of_;              // per state: the row of y that shows it, or -1
  std::vector<double> spread_, middle_;  // per state: what it moves through in a step test
  std::vector<double> process_noise_, measurement_noise_, initial_variance_;
  std::vector<double> before_, now_;  // per channel, as they reach the plant
  mutable Phase phase_ = Phase::fresh;
  mutable std::vector<double> shown_, probe_, above_, below_, y_above_, y_below_;
};

FAULTLINE_PROCESS_MODEL(rig_model, {"rig_model", make_process_model_of<RigModel>});

}  // namespace
}  // namespace faultline
