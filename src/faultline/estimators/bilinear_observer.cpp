#include "faultline/estimators/bilinear_observer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kStepsPerTimeConstant = 1;  // of the fastest: a Runge-Kutta step is then good to 1 %
constexpr double kSettled = 1e-3;            // of an initial error that may be left
constexpr int kMostRiccatiSteps = 100000;
constexpr double kRiccatiTolerance = 1e-10;
constexpr double kDifference = 1e-4;    // relative, of a parameter
constexpr double kBlock = 1;            // s: several time constants of what is left in a residual
constexpr double kMargin = 2;           // standard errors
constexpr double kUnsettled = 1.0 / 3;  // of the learning, in which theta is still far off
constexpr double kSame = 3;             // times the noise so far, up to which a block is healthy still
constexpr double kFarthest = 3;         // tolerances off the datasheet, around which the equations are made linear
constexpr double kWidest = 100;         // times the tolerances' variance, that a followed parameter may be uncertain

double spectral_radius(const Matrix& a) { return a.eigenvalues().cwiseAbs().maxCoeff(); }

// e^(a dt) by scaling and squaring of the fourth-order series, which is the Runge-Kutta step's own.
Matrix transition(const Matrix& a, double dt, int steps) {
  const Matrix x = a * (dt / steps), one = Matrix::Identity(a.rows(), a.cols());
  const Matrix single = one + x * (one + x / 2 * (one + x / 3 * (one + x / 4)));
  Matrix all = one;
  for (int i = 0; i < steps; ++i) all = single * all;
  return all;
}

RecursiveLeastSquaresSettings prior(std::size_t parameters) {
  return {1, 1, static_cast<double>(std::max<std::size_t>(parameters, 1)), 0};
}

}  // namespace

BilinearObserver::BilinearObserver(const Datasheet& sheet, const StageSpec& spec)
    : model_(make_bilinear_model(spec.settings.word("model"), sheet, spec.settings)),
      inputs_(model_->inputs()),
      channels_(sheet.channels),
      measured_(model_->measured_channels()),
      used_(model_->driving_channels()),
      nominal_(sheet.nominal()),
      period_(sheet.sample_period),
      learn_(spec.settings.number("learn", 0, 1e8)),
      fit_(1, prior(1)) {
  used_.insert(used_.end(), measured_.begin(), measured_.end());
  for (const std::string& name : split_words(spec.settings.word_or("learnt", ""))) {
    const int at = sheet.parameter(name);
    const Parameter& p = sheet.parameters[static_cast<std::size_t>(at)];
    if (!(p.tolerance > 0) || p.nominal == 0)
      throw InputError(
          fmt::format("{}: '{}' has no tolerance, so there is nothing to learn of it", spec.settings.where(), name));
    learnt_.push_back(at);
    tolerance_.push_back(p.tolerance * p.nominal);
  }
  if (learnt_.size() > static_cast<std::size_t>(kMaximumRegressors))
    throw InputError(fmt::format("{}: at most {} parameters can be learnt, 'learnt' has {}", spec.settings.where(),
                                 kMaximumRegressors, learnt_.size()));
  fit_ = RecursiveLeastSquares(static_cast<int>(std::max<std::size_t>(learnt_.size(), 1)), prior(learnt_.size()));
  if (spec.settings.has("forgetting") && !learnt_.empty()) {
    const auto n = static_cast<int>(learnt_.size());
    followed_.emplace(n, RecursiveLeastSquaresSettings{spec.settings.number("forgetting", 0.5, 1), 1, kWidest * n, 0});
    for (const int at : learnt_) {
      const Parameter& p = sheet.parameters[static_cast<std::size_t>(at)];
      followed_states_.push_back({p.name, p.symbol, p.unit});
    }
  }

  std::vector<int> unknown;
  const std::vector<State> states = model_->states();
  for (const std::string& name : split_words(spec.settings.word_or("unknown", ""))) {
    const auto found = std::find_if(states.begin(), states.end(), [&](const State& s) { return s.name == name; });
    if (found == states.end())
      throw InputError(
          fmt::format("{}: 'unknown' names '{}', which is no state of the model", spec.settings.where(), name));
    unknown.push_back(static_cast<int>(found - states.begin()));
  }
  decoupling_ = decouple(model_->system(nominal_), unknown);
  if (!decoupling_.exists)
    throw InputError(fmt::format(
        "{}: the unknown inputs cannot be decoupled, rank(C E) < rank(E): measure what they act upon, or name fewer",
        spec.settings.where()));
  if (decoupling_.h.rows() == 0)
    throw InputError(fmt::format("{}: the unknown inputs take all measurements, no residual is left: name fewer",
                                 spec.settings.where()));
  build();
  find_gain(spec.settings);
}

BilinearObserver::Equations BilinearObserver::equations_at(const std::vector<double>& parameters) const {
  const Matrix &t = decoupling_.t, &m = decoupling_.m, &n = decoupling_.n;
  const Eigen::Index q = t.rows(), p = n.cols(), blocks = 1 + static_cast<Eigen::Index>(learnt_.size());
  const BilinearSystem nominal = model_->system(parameters);
  Matrix mn(m.rows(), q + p);
  mn << m, n;
  Equations e{Matrix::Zero(blocks * q, q + p), Matrix::Zero(blocks * q, nominal.b.cols()), {}};
  e.products.assign(nominal.products.size(), Matrix::Zero(blocks * q, q + p));
  const auto put = [&](Eigen::Index block, const BilinearSystem& system, double factor) {
    e.kernel.middleRows(block * q, q) += factor * t * system.a * mn;
    e.drive.middleRows(block * q, q) += factor * t * system.b;
    for (std::size_t i = 0; i < e.products.size(); ++i)
      if (system.products[i].size() > 0) e.products[i].middleRows(block * q, q) += factor * t * system.products[i] * mn;
  };
  put(0, nominal, 1);
  for (std::size_t j = 0; j < learnt_.size(); ++j) {
    const auto at = static_cast<std::size_t>(learnt_[j]);
    const double change = kDifference * nominal_[at];
    std::vector<double> moved = parameters;
    for (const double side : {1.0, -1.0}) {
      moved[at] = parameters[at] + side * change;
      put(static_cast<Eigen::Index>(j) + 1, model_->system(moved), side * tolerance_[j] / (2 * change));
    }
  }
  return e;
}

void BilinearObserver::build() {
  const Eigen::Index q = decoupling_.t.rows(), p = decoupling_.n.cols();
  const Eigen::Index blocks = 1 + static_cast<Eigen::Index>(learnt_.size());
  at_nominal_ = equations_at(nominal_);
  for (std::size_t j = 0; j < learnt_.size(); ++j) {
    std::vector<double> moved = nominal_;
    moved[static_cast<std::size_t>(learnt_[j])] += tolerance_[j];
    Equations e = equations_at(moved);
    moved[static_cast<std::size_t>(learnt_[j])] -= 2 * tolerance_[j];
    const Equations less = equations_at(moved);
    e.kernel = (e.kernel - less.kernel) / 2;
    e.drive = (e.drive - less.drive) / 2;
    for (std::size_t i = 0; i < e.products.size(); ++i) e.products[i] = (e.products[i] - less.products[i]) / 2;
    by_parameter_.push_back(std::move(e));
  }
  // What is zero wherever it is stays out of the steps.
  for (std::size_t i = 0; i < at_nominal_.products.size(); ++i) {
    const bool none =
        at_nominal_.products[i].isZero(0) &&
        std::all_of(by_parameter_.begin(), by_parameter_.end(), [i](auto& e) { return e.products[i].isZero(0); });
    if (!none) continue;
    at_nominal_.products[i].resize(0, 0);
    for (Equations& e : by_parameter_) e.products[i].resize(0, 0);
  }
  kernel_ = at_nominal_.kernel;
  drive_ = at_nominal_.drive;
  products_ = at_nominal_.products;
  around_.assign(learnt_.size(), 0);

  const auto inputs = static_cast<Eigen::Index>(inputs_.size());
  for (Vector* v : {&u_, &u_before_, &u_now_}) v->setZero(inputs);
  for (Vector* v : {&y_, &y_before_, &y_now_}) v->setZero(p);
  wy_.setZero(q + p);
  stacked_.setZero(blocks * q);
  now_ = kernel_;
  for (Matrix* x : {&state_, &tried_, &k1_, &k2_, &k3_, &k4_}) x->setZero(q, blocks);
  sensitivity_.setZero(decoupling_.h.rows(), blocks - 1);
  residual_.setZero(decoupling_.h.rows());
  residual_std_.setZero(decoupling_.h.rows());
}

void BilinearObserver::find_gain(const Settings& settings) {
  const Eigen::Index q = decoupling_.t.rows(), p = decoupling_.n.cols();
  const std::vector<double> noise =
      settings.list("process_noise", static_cast<std::size_t>(decoupling_.t.cols()), 0, 1e12);
  const auto at = [&](double part) {
    Matrix kernel = kernel_.topRows(q);
    for (std::size_t i = 0; i < inputs_.size(); ++i)
      if (products_[i].size() > 0)
        kernel += (inputs_[i].low + part * (inputs_[i].high - inputs_[i].low)) * products_[i].topRows(q);
    return kernel;
  };
  double fastest = 0;
  for (const double part : {0.0, 0.5, 1.0}) fastest = std::max(fastest, spectral_radius(at(part).leftCols(q)));
  substeps_ = std::max(1, static_cast<int>(std::ceil(fastest * period_ / kStepsPerTimeConstant)));

  Vector measured(p), state(decoupling_.t.cols());
  for (Eigen::Index i = 0; i < p; ++i) {
    const Channel& c = channels_[static_cast<std::size_t>(measured_[static_cast<std::size_t>(i)])];
    measured[i] = c.noise_std * c.noise_std + c.resolution * c.resolution / 12;
  }
  for (Eigen::Index i = 0; i < state.size(); ++i)
    state[i] = noise[static_cast<std::size_t>(i)] * noise[static_cast<std::size_t>(i)];
  const Matrix middle = at(0.5), d = middle.rightCols(p), &h = decoupling_.h;
  const Matrix phi = transition(middle.leftCols(q), period_, substeps_);
  const Matrix added = decoupling_.t * state.asDiagonal() * decoupling_.t.transpose() * period_ +
                       d * measured.asDiagonal() * d.transpose() * period_ * period_;
  const Matrix r = decoupling_.w * measured.asDiagonal() * decoupling_.w.transpose();
  Matrix covariance = added, s;
  gain_.setZero(q, h.rows());
  for (int i = 0; i < kMostRiccatiSteps; ++i) {
    s = h * covariance * h.transpose() + r;
    const Matrix gain = s.ldlt().solve(h * covariance).transpose();
    const double change = (gain - gain_).norm();
    gain_ = gain;
    covariance = phi * (covariance - gain * h * covariance) * phi.transpose() + added;
    covariance = (covariance + covariance.transpose()).eval() / 2;
    if (change <= kRiccatiTolerance * gain_.norm() && i > 10) break;
  }
  innovation_std_ = s.diagonal().cwiseSqrt();
  double slowest = 0;
  for (const double part : {0.0, 0.5, 1.0}) {
    const Matrix error = (Matrix::Identity(q, q) - gain_ * h) * transition(at(part).leftCols(q), period_, substeps_);
    slowest = std::max(slowest, spectral_radius(error));
  }
  if (!(slowest < 1))
    throw InputError(
        fmt::format("{}: the observer does not settle (largest pole {:.6g} a sample): what is left after "
                    "decoupling is not detectable; name fewer unknown inputs or give process_noise",
                    settings.where(), slowest));
  settle_ = static_cast<int>(std::ceil(std::log(kSettled) / std::log(std::max(slowest, 1e-3))));
}

std::vector<std::string> BilinearObserver::innovation_names() const {
  // A residual goes by the output that it is mostly made of.
  std::vector<std::string> names;
  for (Eigen::Index i = 0; i < decoupling_.w.rows(); ++i) {
    Eigen::Index most = 0;
    decoupling_.w.row(i).cwiseAbs().maxCoeff(&most);
    names.push_back(channels_[static_cast<std::size_t>(measured_[static_cast<std::size_t>(most)])].name);
  }
  return names;
}

void BilinearObserver::read(const double* channels) {
  model_->take_inputs(channels, u_.data());
  for (Eigen::Index i = 0; i < y_.size(); ++i) y_[i] = channels[measured_[static_cast<std::size_t>(i)]];
}

void BilinearObserver::equations(double fraction) {
  for (Eigen::Index i = 0; i < u_.size(); ++i)
    u_now_[i] =
        inputs_[static_cast<std::size_t>(i)].held ? u_before_[i] : u_before_[i] + fraction * (u_[i] - u_before_[i]);
  y_now_ = y_before_ + fraction * (y_ - y_before_);
  now_ = kernel_;
  for (std::size_t i = 0; i < products_.size(); ++i)
    if (products_[i].size() > 0) now_ += u_now_[static_cast<Eigen::Index>(i)] * products_[i];
}

void BilinearObserver::slope(const Matrix& state, Matrix& rate) {
  const Eigen::Index q = state.rows();
  wy_ << state.col(0), y_now_;
  stacked_.noalias() = now_.lazyProduct(wy_);
  stacked_.noalias() += drive_.lazyProduct(u_now_);
  rate = Eigen::Map<const Matrix>(stacked_.data(), q, state.cols());
  rate.rightCols(state.cols() - 1).noalias() += now_.topLeftCorner(q, q).lazyProduct(state.rightCols(state.cols() - 1));
}

void BilinearObserver::step(double dt, double from, double to) {
  equations(from);
  slope(state_, k1_);
  equations(0.5 * (from + to));
  tried_ = state_ + 0.5 * dt * k1_;
  slope(tried_, k2_);
  tried_ = state_ + 0.5 * dt * k2_;
  slope(tried_, k3_);
  equations(to);
  tried_ = state_ + dt * k3_;
  slope(tried_, k4_);
  state_ += dt / 6 * (k1_ + 2 * k2_ + 2 * k3_ + k4_);
}

Vector BilinearObserver::rate(const Vector& w, const Vector& y, const Vector& u) const {
  const Eigen::Index q = w.size();
  Matrix kernel = kernel_.topRows(q);
  for (std::size_t i = 0; i < products_.size(); ++i)
    if (products_[i].size() > 0) kernel += u[static_cast<Eigen::Index>(i)] * products_[i].topRows(q);
  return kernel.leftCols(q) * w + kernel.rightCols(y.size()) * y + drive_.topRows(q) * u;
}

void BilinearObserver::begin(const double* channels) {
  read(channels);
  if (!u_.allFinite()) u_.setZero();
  u_before_ = u_;
  y_before_ = y_;
  const std::array<double, kMaximumRegressors> nominal{};
  make_linear(nominal.data());
  equations(0);
  const Eigen::Index q = state_.rows();
  // Steady state of these inputs, where there is one.
  state_.setZero();
  const Eigen::FullPivLU<Matrix> lu(now_.topLeftCorner(q, q));
  if (lu.isInvertible()) state_.col(0) = -lu.solve(now_.topRightCorner(q, y_.size()) * y_ + drive_.topRows(q) * u_);
  fit_ = RecursiveLeastSquares(static_cast<int>(std::max<std::size_t>(learnt_.size(), 1)), prior(learnt_.size()));
  if (followed_) followed_->reset(nominal.data());
  noise_variance_ = 1;
  learnt_for_ = block_ = block_rows_ = block_for_ = blocks_ = blocks_sum_ = blocks_square_ = 0;
  steady_ = observed_ = 0;
  residual_.setZero();
  residual_std_.setZero();
}

bool BilinearObserver::advance(const double* channels, const ChannelStatus* status, double dt, int steps) {
  read(channels);
  const bool says = u_.allFinite();
  if (!says) u_ = u_before_;
  const int n = steps * substeps_;
  for (int i = 0; i < n; ++i) step(dt / n, static_cast<double>(i) / n, static_cast<double>(i + 1) / n);
  u_before_ = u_;
  y_before_ = y_;
  observed_ = 0;
  residual_.setZero();
  residual_std_.setZero();
  // A noisy reading that stands at the end of its range may be anything beyond.
  const bool good =
      says && std::all_of(used_.begin(), used_.end(), [&](int c) {
        const Channel& channel = channels_[static_cast<std::size_t>(c)];
        return status[c] == ChannelStatus::good &&
               (channel.noise_std == 0 || (channels[c] > channel.minimum && channels[c] < channel.maximum));
      });
  // What happened between lost samples is not known either.
  steady_ = good && steps == 1 ? steady_ + 1 : 0;
  if (!good) return state_.allFinite();

  sensitivity_.noalias() = decoupling_.h.lazyProduct(state_.rightCols(state_.cols() - 1));
  residual_.noalias() = decoupling_.w.lazyProduct(y_);
  residual_.noalias() -= decoupling_.h.lazyProduct(state_.col(0));
  state_.col(0).noalias() += gain_.lazyProduct(residual_);
  state_.rightCols(state_.cols() - 1).noalias() -= gain_.lazyProduct(sensitivity_);

  const bool settled = steady_ > settle_;
  const bool learning = learn_ > 0 && learnt_for_ < learn_;
  std::array<double, kMaximumRegressors> g{};
  for (Eigen::Index i = 0; i < residual_.size(); ++i) {
    const double unit = innovation_std_[i];
    double spread = 1;
    for (Eigen::Index j = 0; j < sensitivity_.cols(); ++j) {
      g[static_cast<std::size_t>(j)] = sensitivity_(i, j) / unit;
      residual_[i] += sensitivity_(i, j) * around_[static_cast<std::size_t>(j)];
    }
    if (settled && learning) fit_.step(g.data(), residual_[i] / unit);
    if (settled && followed_) followed_->step(g.data(), residual_[i] / unit);
    for (Eigen::Index j = 0; j < sensitivity_.cols(); ++j) {
      residual_[i] -= unit * g[static_cast<std::size_t>(j)] * fit_.parameters()[j];
      for (Eigen::Index k = 0; k < sensitivity_.cols(); ++k)
        spread += g[static_cast<std::size_t>(j)] * g[static_cast<std::size_t>(k)] *
                  fit_.covariance(static_cast<int>(j), static_cast<int>(k));
    }
    if (settled) {
      block_ += residual_[i] * residual_[i] / (unit * unit * spread);
      ++block_rows_;
    }
    residual_std_[i] = unit * std::sqrt(noise_variance_ * spread);
  }
  if (settled && learning) learn(dt);
  if (settled && learn_ > 0) learn_noise(dt);
  const bool linear = learnt_for_ >= kUnsettled * learn_;  // around about the right parameters
  if (settled && (!learning || (followed_ && linear))) observed_ = static_cast<int>(residual_.size());
  return state_.allFinite();
}

void BilinearObserver::make_linear(const double* theta) {
  kernel_ = at_nominal_.kernel;
  drive_ = at_nominal_.drive;
  for (std::size_t i = 0; i < products_.size(); ++i) products_[i] = at_nominal_.products[i];
  for (std::size_t j = 0; j < learnt_.size(); ++j) {
    around_[j] = std::clamp(theta[j], -kFarthest, kFarthest);
    kernel_ += around_[j] * by_parameter_[j].kernel;
    drive_ += around_[j] * by_parameter_[j].drive;
    for (std::size_t i = 0; i < products_.size(); ++i)
      if (products_[i].size() > 0) products_[i] += around_[j] * by_parameter_[j].products[i];
  }
}

void BilinearObserver::learn(double dt) {
  const double before = learnt_for_;
  learnt_for_ += dt;
  if (std::floor(learnt_for_ / kBlock) > std::floor(before / kBlock)) make_linear(fit_.parameters());
}

// A block of what is left; says how large that is on the healthy rig.
void BilinearObserver::learn_noise(double dt) {
  if (learnt_for_ < kUnsettled * learn_) block_ = block_rows_ = block_for_ = 0;
  block_for_ += dt;
  if (block_for_ < kBlock || block_rows_ == 0) return;
  const double mean = block_ / block_rows_;
  block_ = block_rows_ = block_for_ = 0;
  if (learnt_for_ >= learn_ && blocks_ > 1 && mean > kSame * noise_variance_) return;
  ++blocks_;
  blocks_sum_ += mean;
  blocks_square_ += mean * mean;
  if (blocks_ < 2) return;
  const double spread = std::max(0.0, (blocks_square_ - blocks_sum_ * blocks_sum_ / blocks_) / (blocks_ - 1));
  noise_variance_ = std::max(blocks_sum_ / blocks_ + kMargin * std::sqrt(spread / blocks_), 1e-12);
}

void BilinearObserver::write(const double*, bool, Estimate& estimate) const {
  const auto n = static_cast<std::size_t>(residual_.size());
  if (estimate.quantities.empty()) {
    const std::vector<std::string> names = innovation_names();
    for (std::size_t i = 0; i < n; ++i) {
      Eigen::Index most = 0;
      decoupling_.w.row(static_cast<Eigen::Index>(i)).cwiseAbs().maxCoeff(&most);
      const std::string unit = channels_[static_cast<std::size_t>(measured_[static_cast<std::size_t>(most)])].unit;
      estimate.quantities.push_back({names[i] + "_residual", unit, 0, 0});
      estimate.quantities.push_back({names[i] + "_normalised_residual", "1", 0, 1});
    }
  }
  estimate.innovation.assign(residual_.data(), residual_.data() + n);
  estimate.innovation_std.assign(residual_std_.data(), residual_std_.data() + n);
  estimate.observed = observed_;
  estimate.normalised_innovation = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double normalised = observed_ > 0 ? estimate.innovation[i] / estimate.innovation_std[i] : 0.0;
    estimate.normalised_innovation += normalised * normalised;
    estimate.quantities[2 * i].value = estimate.innovation[i];
    estimate.quantities[2 * i].std = estimate.innovation_std[i];
    estimate.quantities[2 * i + 1].value = normalised;
  }
  if (!followed_) return;
  const std::size_t p = learnt_.size();
  estimate.state.resize(p);
  estimate.covariance.resize(p * p);
  followed_->parameter_covariance(estimate.covariance.data());
  // That of the noise which learning found, not of the latest residuals: they hold the fault.
  const double noise = followed_->noise_variance() > 0 ? noise_variance_ / followed_->noise_variance() : 0;
  for (std::size_t i = 0; i < p; ++i) {
    estimate.state[i] = nominal_[static_cast<std::size_t>(learnt_[i])] + tolerance_[i] * followed_->parameters()[i];
    for (std::size_t j = 0; j < p; ++j) estimate.covariance[i * p + j] *= noise * tolerance_[i] * tolerance_[j];
  }
}

namespace {

FAULTLINE_ESTIMATOR(bilinear_observer, {"bilinear_observer", "kalman", false, make_estimator_of<BilinearObserver>});

}  // namespace

}  // namespace faultline
