// A bank of recursive least squares, one for each relation of a model, inside a stage (estimator.h). Settings:
// forgetting, initial_covariance (of the coefficients at the start, in units of noise variance over the square of the
// least excitation), covariance_limit (times the initial covariance), renewal [never]: how many sigma of its noise a
// row may be off; from there on it is another rig's, about whose coefficients old rows know nothing. The covariance is
// then that of the start again, and filters forget before they give rows. Without it least squares over rows of both
// rigs fit neither until the old ones are forgotten. The coefficients are the first quantities of the estimate. The
// innovation is y - h' theta before the correction; its predicted sigma the running root mean square of itself.
// Coefficients that are estimated together (a relation of several) are the state too, with their covariance.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "faultline/estimators/coloured_noise.h"
#include "faultline/estimators/estimator.h"
#include "faultline/estimators/recursive_least_squares.h"
#include "faultline/estimators/relation_model.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kNever = 1e9;  // sigma

struct Fit {
  Relation relation;
  RecursiveLeastSquares squares;
  std::optional<ColouredNoise> noise;
  bool used = false;
  double innovation = 0;
};

class RelationCore : public Estimator {
 public:
  RelationCore(const Datasheet& sheet, const StageSpec& spec)
      : model_(make_relation_model(spec.settings.word("model"), sheet, spec.settings)) {
    const double forgetting = spec.settings.number("forgetting", 0.5, 1);
    const double variance = spec.settings.number("initial_covariance", 1e-12, 1e12);
    const double limit = spec.settings.number("covariance_limit", 1, 1e12);
    renewal_ = spec.settings.number_or("renewal", kNever, 3, kNever);
    for (Relation& relation : model_->relations()) {
      const auto n = static_cast<int>(relation.coefficients.size());
      // In units of 1/|h|^2 at the least excitation: the same numbers then suit rows of any size.
      const double unit = variance / (relation.excitation * relation.excitation);
      if (renewal_ < kNever && relation.noise.empty())
        throw InputError(fmt::format("{}: 'renewal' needs a model that says how large its noise is; '{}' does not",
                                     spec.settings.where(), spec.settings.word("model")));
      if (relation.scale.empty()) relation.scale.assign(relation.coefficients.size(), 1);
      if (n > 1) states_ += relation.coefficients.size();
      RecursiveLeastSquares squares(n, {forgetting, unit, limit * n * unit, relation.excitation});
      std::optional<ColouredNoise> noise;
      if (!relation.noise.empty()) noise.emplace(n, relation.noise, unit);
      fits_.push_back({std::move(relation), squares, std::move(noise)});
    }
  }

  // Coefficients that are estimated together, so that their covariance is told.
  std::vector<State> states() const override {
    std::vector<State> result;
    for (const Fit& fit : fits_)
      if (fit.relation.coefficients.size() > 1)
        result.insert(result.end(), fit.relation.coefficients.begin(), fit.relation.coefficients.end());
    return result;
  }
  std::vector<std::string> innovation_names() const override {
    std::vector<std::string> names;
    for (const Fit& fit : fits_) names.push_back(fit.relation.name);
    return names;
  }

  void begin(const double* channels) override {
    model_->reset(channels);
    for (Fit& fit : fits_) {
      std::array<double, kMaximumRegressors> first{};
      for (std::size_t c = 0; c < fit.relation.first.size(); ++c)
        first[c] = fit.relation.first[c] / fit.relation.scale[c];
      fit.squares.reset(first.data());
      if (fit.noise) fit.noise->reset();
      fit.used = false;
    }
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int) override {
    model_->advance(channels, status, dt);
    std::array<double, kMaximumRegressors> h{};
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      Fit& fit = fits_[i];
      fit.used = std::all_of(fit.relation.channels.begin(), fit.relation.channels.end(),
                             [&](int channel) { return status[channel] == ChannelStatus::good; });
      if (fit.used) {
        const double y = model_->row(i, h.data());
        for (std::size_t c = 0; c < fit.relation.scale.size(); ++c) h[c] *= fit.relation.scale[c];
        std::array<double, kMaximumRegressors> before{};
        std::copy_n(fit.squares.parameters(), fit.relation.scale.size(), before.begin());
        fit.used = fit.squares.step(h.data(), y);
        fit.innovation = fit.squares.residual();
        if (fit.used && renewal_ < kNever && fit.squares.surprise() > renewal_ * renewal_ * fit.relation.noise[0]) {
          model_->renew();
          fit.squares.reset(before.data());
          fit.noise->reset();
          continue;
        }
      }
      if (!fit.noise) continue;
      if (fit.used)
        fit.noise->take(h.data(), fit.squares.forgetting());
      else
        fit.noise->skip();
    }
    return true;
  }

  void write(const double* channels, bool, Estimate& estimate) const override {
    estimate.innovation.resize(fits_.size());
    estimate.innovation_std.resize(fits_.size());
    estimate.state.resize(states_);
    estimate.covariance.resize(states_ * states_);
    estimate.observed = 0;
    estimate.normalised_innovation = 0;
    std::size_t at = 0, state = 0;
    if (estimate.quantities.empty())
      for (const Fit& fit : fits_)
        for (const State& c : fit.relation.coefficients) estimate.quantities.push_back({c.name, c.unit, 0, 0});
    model_->quantities(channels, estimate.quantities);
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      const Fit& fit = fits_[i];
      const double std = std::sqrt(fit.squares.noise_variance());
      estimate.innovation[i] = fit.used ? fit.innovation : 0.0;
      estimate.innovation_std[i] = fit.used ? std : 0.0;
      if (fit.used && std > 0) {
        estimate.normalised_innovation += estimate.innovation[i] * estimate.innovation[i] / (std * std);
        ++estimate.observed;
      }
      const std::size_t n = fit.relation.coefficients.size();
      std::array<double, kMaximumRegressors * kMaximumRegressors> covariance;
      covariance_of(fit, covariance.data());
      for (std::size_t r = 0; r < n; ++r, ++at) {
        estimate.quantities[at].value = fit.relation.scale[r] * fit.squares.parameters()[r];
        estimate.quantities[at].std = std::sqrt(covariance[r * n + r]);
        if (n == 1) continue;
        estimate.state[state + r] = estimate.quantities[at].value;
        for (std::size_t c = 0; c < n; ++c)
          estimate.covariance[(state + r) * states_ + state + c] = covariance[r * n + c];
      }
      if (n > 1) state += n;
    }
  }

 private:
  static void covariance_of(const Fit& fit, double* result) {
    const std::size_t n = fit.relation.scale.size();
    if (fit.noise)
      fit.noise->covariance(fit.squares, result);
    else
      fit.squares.parameter_covariance(result);
    for (std::size_t r = 0; r < n; ++r)
      for (std::size_t c = 0; c < n; ++c) result[r * n + c] *= fit.relation.scale[r] * fit.relation.scale[c];
  }

  std::unique_ptr<RelationModel> model_;
  std::vector<Fit> fits_;
  std::size_t states_ = 0;
  double renewal_ = kNever;
};

FAULTLINE_ESTIMATOR(recursive_least_squares,
                    {"recursive_least_squares", "parameter", false, make_estimator_of<RelationCore>});

}  // namespace

}  // namespace faultline
