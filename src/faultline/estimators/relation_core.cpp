// A bank of recursive least squares, one for each relation of a model, inside a stage (estimator.h). Settings:
// forgetting, initial_covariance (of the coefficients at the start, in units of noise variance over the square of the
// least excitation), covariance_limit (times the initial covariance). The coefficients are the first quantities of the
// estimate. The innovation is y - h' theta before the correction; its predicted sigma the running root mean square of
// itself.
#include <array>
#include <cmath>

#include "faultline/estimators/estimator.h"
#include "faultline/estimators/recursive_least_squares.h"
#include "faultline/estimators/relation_model.h"

namespace faultline {
namespace {

class RelationCore : public Estimator {
 public:
  RelationCore(const Datasheet& sheet, const StageSpec& spec)
      : model_(make_relation_model(spec.settings.word("model"), sheet, spec.settings)),
        relations_(model_->relations()) {
    const double forgetting = spec.settings.number("forgetting", 0.5, 1);
    const double variance = spec.settings.number("initial_covariance", 1e-12, 1e12);
    const double limit = spec.settings.number("covariance_limit", 1, 1e12);
    for (const Relation& relation : relations_) {
      const auto n = static_cast<int>(relation.coefficients.size());
      // In units of 1/|h|^2 at the least excitation: the same numbers then suit rows of any size.
      const double unit = variance / (relation.excitation * relation.excitation);
      fits_.emplace_back(n, RecursiveLeastSquaresSettings{forgetting, unit, limit * n * unit, relation.excitation});
      used_.push_back(false);
    }
  }

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override {
    std::vector<std::string> names;
    for (const Relation& relation : relations_) names.push_back(relation.name);
    return names;
  }

  void begin(const double* channels) override {
    model_->reset(channels);
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      fits_[i].reset(relations_[i].first.data());
      used_[i] = false;
    }
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override {
    for (int i = 0; i < steps; ++i) model_->advance(channels, dt / steps);
    std::array<double, kMaximumRegressors> h{};
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      bool good = true;
      for (const int channel : relations_[i].channels) good = good && status[channel] == ChannelStatus::good;
      if (!good) {
        used_[i] = false;
        continue;
      }
      const double y = model_->row(i, h.data());
      used_[i] = fits_[i].step(h.data(), y);
    }
    return true;
  }

  void write(const double* channels, bool, Estimate& estimate) const override {
    estimate.innovation.resize(fits_.size());
    estimate.innovation_std.resize(fits_.size());
    estimate.observed = 0;
    estimate.normalised_innovation = 0;
    std::size_t at = 0;
    if (estimate.quantities.empty())
      for (const Relation& relation : relations_)
        for (const State& c : relation.coefficients) estimate.quantities.push_back({c.name, c.unit, 0, 0});
    model_->quantities(channels, estimate.quantities);
    for (std::size_t i = 0; i < fits_.size(); ++i) {
      const double std = std::sqrt(fits_[i].noise_variance());
      estimate.innovation[i] = used_[i] ? fits_[i].residual() : 0.0;
      estimate.innovation_std[i] = used_[i] ? std : 0.0;
      if (used_[i] && std > 0) {
        estimate.normalised_innovation += estimate.innovation[i] * estimate.innovation[i] / (std * std);
        ++estimate.observed;
      }
      for (std::size_t c = 0; c < relations_[i].coefficients.size(); ++c, ++at) {
        estimate.quantities[at].value = fits_[i].parameters()[c];
        estimate.quantities[at].std = fits_[i].standard_deviation(static_cast<int>(c));
      }
    }
  }

 private:
  std::unique_ptr<RelationModel> model_;
  std::vector<Relation> relations_;
  std::vector<RecursiveLeastSquares> fits_;
  std::vector<bool> used_;
};

FAULTLINE_ESTIMATOR(recursive_least_squares,
                    {"recursive_least_squares", "parameter", false, make_estimator_of<RelationCore>});

}  // namespace

}  // namespace faultline
