// The pump-controlled cylinder as Kalman filters see it, to estimate chamber pressures from the position and at most
// some of the pressures. Source: Kilic et al. 2014, equations (17)-(28); parameters nominal, SI units.
//
//   x = position, velocity, P_A, P_B;  u = w_1, w_2 held over a period;  y = position and, by `pressures`, P_A, P_B
//   pump_cylinder_linear      x+ = Phi x + G u exactly, of (17): constant volumes and `bulk_modulus`, no gravity and no
//                             dry friction
//   pump_cylinder_nonlinear   x+ = x + phi(f dt) dt x', x' of (23), f of (25), phi(m) = (exp(m) - 1)/m, in shorter
//                             steps where friction turns over within one; Phi = exp(f dt)
// Dry friction in (23) by `friction`: signed, F_c tanh(v/friction_width), with its own term in f22; unsigned, F_c as it
// is printed; none. Q is added per period as it stands: scaled by T, as (28) says, it leaves pressures unmeasured.
//
// Settings: pressures (none, a, b, both); process_noise, initial_variance (4), measurement_noise (position, P_A, P_B);
// pressure_sum, where the inputs are to be as printed: w_dyn = n_2 from the commands, and the offset speeds of this sum
// whatever the rig has; without it the measured speeds. A state whose channel is not measured starts from the offset
// speeds' level.
//
// Quantities: per measured channel its reading; every state with `_estimate`; per row of y
// `CHANNEL_innovation` over its standard deviation; per pressure `CHANNEL_residual`, reading minus estimate; per
// pump `CHANNEL_residual`, measured speed minus command.
// Fails where the level is not what the speeds say: with the position alone only the difference gamma P_A - P_B shows.
#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <unsupported/Eigen/MatrixFunctions>

#include "faultline/estimators/process_model.h"
#include "faultline/numerics/quick_tanh.h"
#include "faultline/signal/error.h"
#include "rigs/pump_cylinder/plant.h"

namespace faultline {
namespace {

enum { kPosition, kVelocity, kPressureA, kPressureB, kStates };

constexpr double kTurn = 0.5,
                 kShortest = 0.1e-3;  // friction widths and s: of a step that is halved, of one that is not
// Within which x+ is taken as linear: a step is then off by less than 1 um, 0.6 mm/s and 0.01 MPa.
constexpr struct {
  double position = 1e-4, velocity = 0.1, pressure = 1e6, force = 40;  // m; friction widths; Pa; N on the piston
} kNear;
// Sizes that make the entries of f alike, so that its exponential takes few terms.
const Eigen::Vector4d kSizes(1e-3, 1, 1e7, 1e7);

using Square = Eigen::Matrix4d;

// exp(m), and phi(m) b with phi(m) = (exp(m) - 1)/m, by Taylor's polynomials of degree 6 and squarings: within 1e-7 of
// the largest entry, in a third of the time of the library's exponential, which goes on to the last digit.
Square exponential(Square m, Eigen::Vector4d& b) {
  const double norm = m.cwiseAbs().rowwise().sum().maxCoeff();
  int squarings = 0;
  for (double left = norm; left > 0.25 && squarings < 60; left /= 2) ++squarings;
  m *= std::ldexp(1.0, -squarings);
  b *= std::ldexp(1.0, -squarings);
  const Square m2 = m * m, m3 = m * m2;
  Square e = m3 * (m / 24 + m2 / 120 + m3 / 720);
  e += m3 / 6 + m2 / 2 + m + Square::Identity();
  const Eigen::Vector4d b1 = m * b, b2 = m2 * b, b3 = m3 * b;
  b += b1 / 2 + b2 / 6 + b3 / 24 + m3 * (b1 / 120 + b2 / 720 + b3 / 5040);
  for (; squarings > 0; --squarings) {
    b += (e * b).eval();
    e = (e * e).eval();
  }
  return e;
}

using Rows = Eigen::Matrix<double, kStates, kStates, Eigen::RowMajor>;

class PressureModel : public ProcessModel {
 public:
  PressureModel(const Datasheet& sheet, const Settings& settings) : p_(sheet, sheet.nominal()) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const char* name) { return nominal[static_cast<std::size_t>(sheet.parameter(name))]; };
    weight_ = p_.mass * p_.gravity;
    per_mass_ = 1 / p_.mass;
    area_ratio_ = p_.cap_area / p_.rod_area;
    offset_ratio_ = value("offset_ratio");
    offset_gain_ = value("offset_gain");
    process_noise_ = settings.list("process_noise", kStates, 0, 1e300);
    initial_variance_ = settings.list("initial_variance", kStates, 0, 1e300);
    const std::vector<double> noise = settings.list("measurement_noise", 3, 1e-300, 1e300);
    const std::string pressures = settings.word("pressures");
    if (pressures != "none" && pressures != "a" && pressures != "b" && pressures != "both")
      throw InputError(settings.where() + ": 'pressures' is '" + pressures + "'; it is none, a, b or both");
    for (const char* name : {"position", "chamber_a_pressure", "chamber_b_pressure", "pump1_speed", "pump2_speed"}) {
      sensors_.push_back(sheet.channel(name));
      channels_.push_back(sheet.channels[static_cast<std::size_t>(sensors_.back())]);
    }
    const bool used[3] = {true, pressures == "a" || pressures == "both", pressures == "b" || pressures == "both"};
    for (std::size_t i = 0; i < 3; ++i) {
      if (!used[i]) continue;
      rows_.push_back(i);
      measured_.push_back(sensors_[i]);
      observed_.push_back(i == 0 ? kPosition : static_cast<int>(i) + 1);
      measurement_noise_.push_back(noise[i]);
    }
    commands_ = {sheet.channel("pump1_speed_command"), sheet.channel("pump2_speed_command")};
    has_sum_ = settings.has("pressure_sum");
    if (has_sum_) sum_ = settings.number("pressure_sum", 0, 1e8);
    driving_ = has_sum_ ? commands_ : std::vector<int>{sensors_[3], sensors_[4]};
  }

  std::vector<State> states() const override {
    return {{"position", "x", "m"},
            {"velocity", "v", "m/s"},
            {"chamber_a_pressure", "P_A", "Pa"},
            {"chamber_b_pressure", "P_B", "Pa"}};
  }
  std::vector<int> measured_channels() const override { return measured_; }
  std::vector<int> driving_channels() const override { return driving_; }
  std::vector<double> process_noise() const override { return process_noise_; }
  std::vector<double> measurement_noise() const override { return measurement_noise_; }
  std::vector<int> observed_states() const override { return observed_; }

  void initial(const double* channels, double* state, double* variance) const override {
    const double sum = has_sum_ ? sum_ : offset_speed(channels) / offset_gain_;
    state[kPosition] = channels[sensors_[0]];
    state[kVelocity] = 0;
    state[kPressureA] = (sum + weight_ / p_.rod_area) / (1 + area_ratio_);
    state[kPressureB] = sum - state[kPressureA];
    for (std::size_t i = 0; i < rows_.size(); ++i) state[observed_[i]] = channels[measured_[i]];
    std::copy(initial_variance_.begin(), initial_variance_.end(), variance);
  }

  void take_inputs(const double* channels) override {
    speed1_ = channels[driving_[0]];
    speed2_ = channels[driving_[1]];
    if (!has_sum_) return;
    const double dynamic = speed2_ - offset_speed(channels);
    speed2_ = dynamic + offset_gain_ * sum_;
    speed1_ = (area_ratio_ - 1) * dynamic + offset_ratio_ * offset_gain_ * sum_;
  }

  // NaN at the ends of a transmitter's range.
  void measurement(const double* channels, double* y) const override {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Channel& c = channels_[rows_[i]];
      y[i] = channels[measured_[i]];
      if (y[i] <= c.minimum || y[i] >= c.maximum) y[i] = std::nan("");
    }
  }
  void observe(const double* state, double* y) const override {
    for (std::size_t i = 0; i < rows_.size(); ++i) y[i] = state[observed_[i]];
  }

  void quantities(const double* channels, const double* state, const double* covariance,
                  std::vector<Quantity>& result) const override {
    if (result.empty()) {
      for (const Channel& c : channels_) result.push_back({c.name, c.unit, 0, 0});
      for (const State& s : states()) result.push_back({s.name + "_estimate", s.unit, 0, 0});
      for (std::size_t i = 1; i < channels_.size(); ++i)
        result.push_back({channels_[i].name + "_residual", channels_[i].unit, 0, 0});
      for (const std::size_t row : rows_) result.push_back({channels_[row].name + "_innovation", "1", 0, 0});
    }
    const std::size_t state_at = channels_.size(), residual_at = state_at + kStates;
    for (std::size_t i = 0; i < channels_.size(); ++i) result[i].value = channels[sensors_[i]];
    for (std::size_t i = 0; i < kStates; ++i) {
      result[state_at + i].value = state[i];
      result[state_at + i].std = std::sqrt(std::max(0.0, covariance[i * kStates + i]));
    }
    for (std::size_t i = 0; i < 2; ++i) {
      result[residual_at + i].value = channels[sensors_[i + 1]] - state[i + 2];
      result[residual_at + i].std = result[state_at + i + 2].std;
      result[residual_at + 2 + i].value = channels[sensors_[i + 3]] - channels[commands_[i]];
    }
  }
  void innovation_quantities(const double* innovation, const double* innovation_std,
                             std::vector<Quantity>& result) const override {
    for (std::size_t i = 0; i < rows_.size(); ++i)
      result[channels_.size() + kStates + 4 + i].value = innovation_std[i] > 0 ? innovation[i] / innovation_std[i] : 0;
  }

 protected:
  // psi p_sum of what the pumps do: w_1 = (gamma - 1) w_dyn + lambda psi p_sum, w_2 = w_dyn + psi p_sum.
  double offset_speed(const double* channels) const {
    return (channels[driving_[0]] - (area_ratio_ - 1) * channels[driving_[1]]) / (offset_ratio_ - area_ratio_ + 1);
  }

  CylinderParameters p_;
  double weight_, per_mass_, area_ratio_, offset_ratio_, offset_gain_;
  double speed1_ = 0, speed2_ = 0;

 private:
  bool has_sum_ = false;
  double sum_ = 0;
  std::vector<double> process_noise_, measurement_noise_, initial_variance_;
  std::vector<int> sensors_, commands_, measured_, driving_, observed_;
  std::vector<std::size_t> rows_;  // of y: which of sensors_
  std::vector<Channel> channels_;  // of sensors_
};

class LinearModel : public PressureModel {
 public:
  LinearModel(const Datasheet& sheet, const Settings& settings) : PressureModel(sheet, settings) {
    const double modulus = settings.number("bulk_modulus", 1e6, 1e11);
    const double a = modulus / p_.volume_a, b = modulus / p_.volume_b;
    system_.setZero();
    system_(kPosition, kVelocity) = 1;
    system_(kVelocity, kVelocity) = -p_.viscous / p_.mass;
    system_(kVelocity, kPressureA) = p_.cap_area / p_.mass;
    system_(kVelocity, kPressureB) = -p_.rod_area / p_.mass;
    system_(kPressureA, kVelocity) = -p_.cap_area * a;
    system_(kPressureA, kPressureA) = -2 * (p_.internal + p_.external_a) * a;
    system_(kPressureA, kPressureB) = p_.internal * a;
    system_(kPressureB, kVelocity) = p_.rod_area * b;
    system_(kPressureB, kPressureA) = p_.internal * b;
    system_(kPressureB, kPressureB) = -(p_.internal + p_.external_b) * b;
    system_(kPressureA, kStates) = system_(kPressureA, kStates + 1) = p_.displacement * a;
    system_(kPressureB, kStates + 1) = -p_.displacement * b;
    discretise(sheet.sample_period);
  }

  void predict(const double* state, double dt, double* next) const override {
    discretise(dt);
    Augmented x;
    x << state[0], state[1], state[2], state[3], speed1_, speed2_;
    const Eigen::Vector4d moved = transition_.topRows<kStates>() * x;
    std::copy_n(moved.data(), kStates, next);
  }
  bool jacobian(const double*, double dt, double* a) const override {
    discretise(dt);
    Eigen::Map<Rows>{a} = transition_.topLeftCorner<kStates, kStates>();
    return true;
  }

 private:
  using Augmented = Eigen::Matrix<double, kStates + 2, 1>;
  using Extended = Eigen::Matrix<double, kStates + 2, kStates + 2>;

  // [Phi G; 0 I] = exp([A B; 0 0] dt).
  void discretise(double dt) const {
    if (dt == step_) return;
    Augmented sizes;
    sizes << kSizes, 1, 1;
    const Extended scaled = dt * sizes.cwiseInverse().asDiagonal() * system_ * sizes.asDiagonal();
    const Extended exponential = scaled.exp();
    transition_ = sizes.asDiagonal() * exponential * sizes.cwiseInverse().asDiagonal();
    step_ = dt;
  }

  Extended system_;
  mutable Extended transition_;
  mutable double step_ = -1;
};

class NonlinearModel : public PressureModel {
 public:
  NonlinearModel(const Datasheet& sheet, const Settings& settings) : PressureModel(sheet, settings) {
    const std::string friction = settings.word("friction");
    if (friction != "signed" && friction != "unsigned" && friction != "none")
      throw InputError(settings.where() + ": 'friction' is '" + friction + "'; it is signed, unsigned or none");
    if (friction == "signed") signed_ = p_.coulomb;
    if (friction == "unsigned") constant_ = p_.coulomb;
    if (friction == "signed") sharpness_ = 1 / settings.number("friction_width", 1e-3, 1);
  }

  void predict(const double* state, double dt, double* next) const override { step(state, dt, next); }
  bool jacobian(const double* state, double dt, double* a) const override {
    double next[kStates];
    predict_linear(state, dt, next, a);
    return true;
  }
  void predict_linear(const double* state, double dt, double* next, double* a) const override {
    Eigen::Map<Rows>{a} = kSizes.asDiagonal() * step(state, dt, next) * kSizes.cwiseInverse().asDiagonal();
  }

  bool near(const double* a, const double* b) const override {
    return std::abs(a[kPosition] - b[kPosition]) < kNear.position &&
           std::abs(a[kVelocity] - b[kVelocity]) * sharpness_ < kNear.velocity &&
           std::abs(a[kPressureA] - b[kPressureA]) < kNear.pressure &&
           std::abs(a[kPressureB] - b[kPressureB]) < kNear.pressure &&
           std::abs(p_.cap_area * (a[kPressureA] - b[kPressureA]) - p_.rod_area * (a[kPressureB] - b[kPressureB])) <
               kNear.force;
  }

 private:
  template <class Vector>
  double inflow_a(const Vector& x) const {
    return p_.displacement * (speed1_ + speed2_) - 2 * (p_.internal + p_.external_a) * x[kPressureA] +
           p_.internal * x[kPressureB] - p_.cap_area * x[kVelocity];
  }
  template <class Vector>
  double inflow_b(const Vector& x) const {
    return p_.rod_area * x[kVelocity] - p_.displacement * speed2_ + p_.internal * x[kPressureA] -
           (p_.internal + p_.external_b) * x[kPressureB];
  }
  // As step_once(), in shorter steps where friction turns over within one.
  Square step(const double* x, double dt, double* next) const {
    const Square slope = step_once(x, dt, next);
    if (!(std::abs(next[kVelocity] - x[kVelocity]) * sharpness_ > kTurn) || dt < kShortest) return slope;
    double middle[kStates];
    const Square first = step(x, dt / 2, middle);
    return step(middle, dt / 2, next) * first;
  }
  // x+ = x + phi(F dt) dt f(x): exact where f, (23), is linear, to second order in how it bends. Returns exp(F dt) in
  // kSizes, which is dx+/dx to first order.
  Square step_once(const double* x, double dt, double* next) const {
    const double volume_a = p_.volume_a + p_.cap_area * x[kPosition],
                 volume_b = p_.volume_b - p_.rod_area * x[kPosition];
    const double beta_a = p_.oil.value(x[kPressureA]), beta_b = p_.oil.value(x[kPressureB]);
    const double stiff_a = beta_a / volume_a, stiff_b = beta_b / volume_b;
    const double into_a = inflow_a(x), into_b = inflow_b(x);
    const double level = signed_ > 0 ? quick_tanh(x[kVelocity] * sharpness_) : 0;
    const double force = p_.cap_area * x[kPressureA] - p_.rod_area * x[kPressureB] - p_.viscous * x[kVelocity];
    Eigen::Vector4d moved(x[kVelocity], (force - constant_ - signed_ * level - weight_) * per_mass_, stiff_a * into_a,
                          stiff_b * into_b);
    Square f = Square::Zero();  // (25)
    f(kPosition, kVelocity) = 1;
    f(kVelocity, kVelocity) = -(p_.viscous + signed_ * (1 - level * level) * sharpness_) * per_mass_;
    f(kVelocity, kPressureA) = p_.cap_area * per_mass_;
    f(kVelocity, kPressureB) = -p_.rod_area * per_mass_;
    f(kPressureA, kPosition) = -p_.cap_area * stiff_a * into_a / volume_a;
    f(kPressureA, kVelocity) = -p_.cap_area * stiff_a;
    f(kPressureA, kPressureA) =
        p_.oil.slope(x[kPressureA], beta_a) * into_a / volume_a - 2 * (p_.internal + p_.external_a) * stiff_a;
    f(kPressureA, kPressureB) = p_.internal * stiff_a;
    f(kPressureB, kPosition) = p_.rod_area * stiff_b * into_b / volume_b;
    f(kPressureB, kVelocity) = p_.rod_area * stiff_b;
    f(kPressureB, kPressureA) = p_.internal * stiff_b;
    f(kPressureB, kPressureB) =
        p_.oil.slope(x[kPressureB], beta_b) * into_b / volume_b - (p_.internal + p_.external_b) * stiff_b;
    moved = dt * moved.cwiseQuotient(kSizes);
    const Square result = exponential(dt * kSizes.cwiseInverse().asDiagonal() * f * kSizes.asDiagonal(), moved);
    Eigen::Map<Eigen::Vector4d>{next} = Eigen::Map<const Eigen::Vector4d>(x) + moved.cwiseProduct(kSizes);
    return result;
  }

  double signed_ = 0, constant_ = 0, sharpness_ = 0;
};

FAULTLINE_PROCESS_MODEL(pump_cylinder_linear, {"pump_cylinder_linear", make_process_model_of<LinearModel>});
FAULTLINE_PROCESS_MODEL(pump_cylinder_nonlinear, {"pump_cylinder_nonlinear", make_process_model_of<NonlinearModel>});

}  // namespace
}  // namespace faultline
