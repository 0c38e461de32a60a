// The branches of the cooling circuit as a Kalman filter sees them: per branch P_2 and d = F c = c/b, driven by
// measured q_2 and P_1.
// Source: Iannetti et al. (2015), equations (8), (11)-(18); its misprints are told in config/cooling_circuit.
//
//   P_2' = -F q_2 + d q_2^0.125 sqrt(P_1 - P_2),  d a random walk;  y = P_2;  F = 1/b
// scheme euler: one explicit step, as printed. With the b of the datasheet its A(1,1) is about -150 (chamber): the
// prediction is
//   unstable, the gain almost 1, and the residual after correction is the innovation shrunk to a few Pa whatever the
//   model says.
// scheme exact: with w = sqrt(P_1 - P_2), w* = F q_2^0.875/d, v = w/w*, the equation separates:
//   v + ln|1 - v| = v_0 + ln|1 - v_0| - K,   K = d^2 q_2^-0.75 dt/(2 F),   P_2(t + dt) = P_1 - (w* v)^2
//   K is 20 to 150 at 1 ms: P_2 then is P_1 - w*^2 with the P_1 and q_2 of the same instant, and a filter of it is an
//   honest one of d.
// The printed (13) keeps the power 0.125 in the derivative by q; right is 0.125 q^-0.875, used here in both schemes.
// Where P_1 <= P_2 or q_2 is below `smallest_flow` the equation says nothing (paper: raise a flag): P_2 holds,
// `reversed` is 1.
// {b}_normalised_residual: the innovation over sqrt(S + what the transducers of this rig scatter by beyond the noise
// that the filter was told). That is learnt from their second differences in the first second with flow, and counts by
// how steep P_1 - P_2 is: |P_1 - P_2| ~ q^1.75, so a flow meter's noise is nothing while a valve opens and most at full
// flow.
// Settings: pressure_walk (Pa) and coefficient_walk (relative to d) per step, flow_noise (kg/s), inlet_noise and
// outlet_noise (Pa), residual: before or after the correction, which {b}_pressure_residual shows.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "faultline/estimators/process_model.h"
#include "faultline/signal/error.h"
#include "faultline/signal/own_level.h"

namespace faultline {
namespace {

enum { kPressure, kCoefficient, kPerBranch };
enum { kResidual, kTestResidual, kTubeCoefficient, kReversed, kFlows, kQuantities };

constexpr double kSteady = 40;  // exp(-K) beyond this is nothing

struct Step {
  double pressure, by_pressure, by_coefficient, by_flow, by_inlet;
};

// By how much the variance of a transducer's readings is beyond `noise`^2, by second differences of white noise.
class BeyondNoise {
 public:
  explicit BeyondNoise(double noise) : variance_(noise * noise), own_(variance_, kWidest) {}
  void add(double reading) {
    const double second = reading - 2 * last_ + before_;
    before_ = last_;
    last_ = reading;
    if (++rows_ > 2) own_.add(second * second / 6);
  }
  double variance() const { return own_.known() ? own_.level() - variance_ : 0; }

 private:
  static constexpr double kWidest = 100;
  double variance_;
  OwnLevel own_;
  double last_ = 0, before_ = 0;
  int rows_ = 0;
};

// Of a branch, by the part of the filter that steps it, for the whole, which tells.
struct Transducers {
  BeyondNoise outlet, inlet, flow;
  std::array<double, 3> last{};  // readings
  double beyond = 0;             // Pa^2, of the innovation
};

struct Branch {
  std::string name;
  int inlet, outlet, flow;          // channels
  double inverse_b;                 // F
  double nominal;                   // d
  double p1 = 0, q = 0, root8 = 0;  // inputs held for the next step; root8 = q^0.125
  bool flows = false;
  std::shared_ptr<Transducers> transducers;
  // The last step that was asked for since; dt 0: none.
  mutable Step step{};
  mutable std::array<double, 2> x{};
  mutable double dt = 0;
};

class CoolingBranchesModel : public ProcessModel {
 public:
  CoolingBranchesModel(const Datasheet& sheet, const Settings& settings)
      : smallest_flow_(settings.number("smallest_flow", 1e-6, 100)),
        inlet_noise_(settings.number("inlet_noise", 1e-3, 1e7)),
        flow_noise_(settings.number("flow_noise", 1e-9, 100)),
        outlet_noise_(settings.number("outlet_noise", 1e-3, 1e7)),
        pressure_walk_(settings.number("pressure_walk", 0, 1e7)),
        coefficient_walk_(settings.number("coefficient_walk", 0, 1)),
        initial_spread_(settings.number("initial_spread", 1e-6, 1)) {
    const std::vector<double> nominal = sheet.nominal();
    if (sheet.branches.empty() || sheet.branches.size() * kPerBranch > static_cast<std::size_t>(kMaximumStates))
      throw InputError(fmt::format("{}: the model cooling_branches needs 1 to {} branches, the datasheet has {}",
                                   settings.where(), kMaximumStates / kPerBranch, sheet.branches.size()));
    for (const std::string& b : sheet.branches) {
      const auto value = [&](const char* name) { return nominal[static_cast<std::size_t>(sheet.parameter(b + name))]; };
      Branch branch;
      branch.name = b;
      branch.inlet = sheet.channel(b + "_inlet_pressure");
      branch.outlet = sheet.channel(b + "_outlet_pressure");
      branch.flow = sheet.channel(b + "_mass_flow");
      branch.inverse_b = 1 / value("_b");
      branch.nominal = value("_c") / value("_b");
      branch.transducers = std::make_shared<Transducers>(unheard());
      branches_.push_back(branch);
    }
    exact_ = choice(settings, "scheme", "exact", "euler");
    after_ = choice(settings, "residual", "after", "before");
  }

  std::vector<std::unique_ptr<ProcessModel>> parts() const override {
    std::vector<std::unique_ptr<ProcessModel>> result;
    for (const Branch& b : branches_) {
      auto part = std::make_unique<CoolingBranchesModel>(*this);
      part->branches_ = {b};
      result.push_back(std::move(part));
    }
    return result;
  }

  std::vector<State> states() const override {
    std::vector<State> result;
    for (const Branch& b : branches_) {
      result.push_back({b.name + "_outlet_pressure", "P_2", "Pa"});
      result.push_back({b.name + "_d", "d", "1"});
    }
    return result;
  }
  std::vector<int> measured_channels() const override {
    std::vector<int> result;
    for (const Branch& b : branches_) result.push_back(b.outlet);
    return result;
  }
  std::vector<int> driving_channels() const override {
    std::vector<int> result;
    for (const Branch& b : branches_) result.insert(result.end(), {b.inlet, b.flow});
    return result;
  }
  std::vector<double> process_noise() const override {
    std::vector<double> result;
    for (const Branch& b : branches_)
      result.insert(result.end(), {pressure_walk_ * pressure_walk_, square(coefficient_walk_ * b.nominal)});
    return result;
  }
  std::vector<double> measurement_noise() const override {
    return std::vector<double>(branches_.size(), square(outlet_noise_));
  }
  std::vector<double> input_noise() const override {
    std::vector<double> result;
    for (std::size_t i = 0; i < branches_.size(); ++i)
      result.insert(result.end(), {square(flow_noise_), square(inlet_noise_)});
    return result;
  }

  void initial(const double* channels, double* state, double* variance) const override {
    for (const Branch& b : branches_) {
      *b.transducers = unheard();
      *state++ = channels[b.outlet];
      *state++ = b.nominal;
      *variance++ = square(outlet_noise_);
      *variance++ = square(initial_spread_ * b.nominal);
    }
  }

  void take_inputs(const double* channels) override {
    for (Branch& b : branches_) {
      b.p1 = channels[b.inlet];
      b.q = channels[b.flow];
      b.dt = 0;
      b.flows = b.q > smallest_flow_ && b.p1 > channels[b.outlet];
      b.root8 = b.flows ? std::sqrt(std::sqrt(std::sqrt(b.q))) : 0.0;
      if (b.flows) hear(b, channels[b.outlet]);
    }
  }

  bool inputs_at_end() const override { return exact_; }

  void measurement(const double* channels, double* y) const override {
    for (const Branch& b : branches_) *y++ = channels[b.outlet];
  }
  void observe(const double* x, double* y) const override {
    for (std::size_t i = 0; i < branches_.size(); ++i) y[i] = x[kPerBranch * i];
  }
  std::vector<int> observed_states() const override {
    std::vector<int> result;
    for (std::size_t i = 0; i < branches_.size(); ++i) result.push_back(kPerBranch * static_cast<int>(i));
    return result;
  }

  void predict(const double* x, double dt, double* next) const override {
    for (const Branch& b : branches_) {
      next[kPressure] = b.flows ? step(b, x, dt).pressure : x[kPressure];
      next[kCoefficient] = x[kCoefficient];
      x += kPerBranch;
      next += kPerBranch;
    }
  }

  bool jacobian(const double* x, double dt, double* a) const override {
    const std::size_t n = kPerBranch * branches_.size();
    std::fill_n(a, n * n, 0.0);
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const Branch& b = branches_[i];
      const std::size_t row = kPerBranch * i;
      const Step step = b.flows ? this->step(b, x + row, dt) : Step{0, 1, 0, 0, 0};
      a[row * n + row] = step.by_pressure;
      a[row * n + row + 1] = step.by_coefficient;
      a[(row + 1) * n + row + 1] = 1;
    }
    return true;
  }

  void input_jacobian(const double* x, double dt, double* g) const override {
    const std::size_t inputs = 2 * branches_.size();
    std::fill_n(g, kPerBranch * branches_.size() * inputs, 0.0);
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const Branch& b = branches_[i];
      if (!b.flows) continue;
      const Step step = this->step(b, x + kPerBranch * i, dt);
      g[kPerBranch * i * inputs + 2 * i] = step.by_flow;
      g[kPerBranch * i * inputs + 2 * i + 1] = step.by_inlet;
    }
  }

  void quantities(const double* channels, const double* x, const double* covariance,
                  std::vector<Quantity>& result) const override {
    const std::size_t n = kPerBranch * branches_.size();
    if (result.empty())
      for (const Branch& b : branches_) {
        result.push_back({b.name + "_pressure_residual", "Pa", 0, 0});
        result.push_back({b.name + "_normalised_residual", "1", 0, 0});
        result.push_back({b.name + "_c_filtered", "kg^0.875/(s^0.875 Pa^0.5)", 0, 0});
        result.push_back({b.name + "_reversed", "1", 0, 0});
        result.push_back({b.name + "_flows", "1", 0, 0});
      }
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const Branch& b = branches_[i];
      Quantity* q = &result[kQuantities * i];
      const std::size_t d = kPerBranch * i + kCoefficient;
      q[kResidual].value = channels[b.outlet] - x[kPerBranch * i];
      q[kTubeCoefficient].value = x[d] / b.inverse_b;
      q[kTubeCoefficient].std = std::sqrt(std::max(0.0, covariance[d * n + d])) / b.inverse_b;
      q[kFlows].value = channels[b.flow] > smallest_flow_ ? 1 : 0;
      q[kReversed].value = channels[b.flow] > smallest_flow_ && channels[b.inlet] <= channels[b.outlet] ? 1 : 0;
    }
  }

  void innovation_quantities(const double* innovation, const double* innovation_std,
                             std::vector<Quantity>& result) const override {
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      Quantity* q = &result[kQuantities * i];
      const double std = std::sqrt(square(innovation_std[i]) + branches_[i].transducers->beyond);
      q[kTestResidual].value = std > 0 ? innovation[i] / std : 0.0;
      q[kTestResidual].std = 1;
      if (!after_) q[kResidual].value = innovation[i];
      q[kResidual].std = innovation_std[i];
    }
  }

 private:
  static double square(double value) { return value * value; }
  static bool choice(const Settings& settings, const std::string& key, const char* yes, const char* no) {
    const std::string word = settings.word(key);
    if (word != yes && word != no)
      throw InputError(fmt::format("{}: '{}' is '{}'; it must be {} or {}", settings.where(), key, word, yes, no));
    return word == yes;
  }

  Transducers unheard() const {
    return {BeyondNoise(outlet_noise_), BeyondNoise(inlet_noise_), BeyondNoise(flow_noise_), {}, 0};
  }

  // A filter takes the inputs of each sample twice.
  static void hear(const Branch& b, double outlet) {
    Transducers& t = *b.transducers;
    const std::array<double, 3> readings = {outlet, b.p1, b.q};
    if (readings == t.last) return;
    t.last = readings;
    t.outlet.add(outlet);
    t.inlet.add(b.p1);
    t.flow.add(b.q);
    t.beyond = t.outlet.variance() + t.inlet.variance() + t.flow.variance() * square(1.75 * (b.p1 - outlet) / b.q);
  }

  // A filter asks three times for the same one.
  Step step(const Branch& b, const double* x, double dt) const {
    if (b.x[0] != x[0] || b.x[1] != x[1] || b.dt != dt) {
      b.step = exact_ ? exact(b, x, dt) : euler(b, x, dt);
      b.x = {x[0], x[1]};
      b.dt = dt;
    }
    return b.step;
  }

  static Step euler(const Branch& b, const double* x, double dt) {
    const double w = std::sqrt(std::max(b.p1 - x[kPressure], 1.0));
    const double flow = b.root8 * w, slope = dt * x[kCoefficient] * b.root8 / (2 * w);
    return {x[kPressure] + dt * (x[kCoefficient] * flow - b.inverse_b * b.q), 1 - slope, dt * flow,
            dt * (0.125 * x[kCoefficient] * flow / b.q - b.inverse_b), slope};
  }

  static Step exact(const Branch& b, const double* x, double dt) {
    const double d = std::max(x[kCoefficient], 1e-3 * b.nominal);
    const double settled = b.inverse_b * b.q / (b.root8 * d);  // w*
    const double rate = d * b.root8 * dt / (2 * settled);      // K
    double v = 1, fade = 0, by_start = 0, by_rate = 0;
    if (rate < kSteady) {
      const double start = std::max(std::sqrt(std::max(b.p1 - x[kPressure], 0.0)) / settled, 1e-6);
      // 1 - v = (1 - v_0) exp(v_0 - v - K), by Newton's method; v lies between v_0 and 1.
      v = std::max(1 - (1 - start) * std::exp(-rate), start < 1 ? start : 1.0);
      for (int i = 0; i < 8; ++i) {
        fade = std::exp(start - v - rate);
        const double off = 1 - v - (1 - start) * fade;
        v -= off / (-1 + (1 - start) * fade);
      }
      fade = std::exp(start - v - rate);
      by_start = start / v * fade;       // dv/dv_0
      by_rate = (1 - start) * fade / v;  // dv/dK
      const double to_pressure = 2 * settled * settled * v;
      const double by_pressure = to_pressure * by_start / (2 * start * settled * settled);
      const double by_settled = -2 * settled * v * v + to_pressure * by_start * start / settled;
      return {b.p1 - square(settled * v), by_pressure, -by_settled * settled / d - to_pressure * by_rate * 2 * rate / d,
              by_settled * 0.875 * settled / b.q + to_pressure * by_rate * 0.75 * rate / b.q, 1 - by_pressure};
    }
    const double drop = settled * settled;
    return {b.p1 - drop, 0, 2 * drop / d, -1.75 * drop / b.q, 1};
  }

  std::vector<Branch> branches_;
  double smallest_flow_, inlet_noise_, flow_noise_, outlet_noise_, pressure_walk_, coefficient_walk_, initial_spread_;
  bool exact_ = true, after_ = true;
};

FAULTLINE_PROCESS_MODEL(cooling_branches, {"cooling_branches", make_process_model_of<CoolingBranchesModel>});

}  // namespace
}  // namespace faultline
