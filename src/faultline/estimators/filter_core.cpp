// A state estimator with its process model inside a stage (estimator.h). Setting: model; the others are the model's.
#include <algorithm>
#include <array>
#include <cmath>

#include "faultline/estimators/state_estimator.h"

namespace faultline {
namespace {

class FilterCore : public Estimator {
 public:
  FilterCore(const Datasheet& sheet, const StageSpec& spec)
      : model_(make_process_model(spec.settings.word("model"), sheet, spec.settings)),
        filter_(make_state_estimator(spec.type, *model_)),
        measured_(model_->measured_channels()),
        states_(model_->states().size()),
        period_(sheet.sample_period) {
    for (const int channel : measured_) names_.push_back(sheet.channels[static_cast<std::size_t>(channel)].name);
  }

  std::vector<State> states() const override { return model_->states(); }
  std::vector<std::string> innovation_names() const override { return names_; }

  void begin(const double* channels) override {
    std::array<double, kMaximumStates> state{}, variance{};
    model_->initial(channels, state.data(), variance.data());
    filter_->reset(state.data(), variance.data());
    model_->take_inputs(channels);
    observed_ = 0;
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override {
    std::array<double, kMaximumOutputs> y{};
    std::array<bool, kMaximumOutputs> use{};
    model_->measurement(channels, y.data());
    observed_ = 0;
    for (std::size_t i = 0; i < measured_.size(); ++i) {
      use[i] = status[measured_[i]] == ChannelStatus::good && std::isfinite(y[i]);  // NaN: it says nothing
      observed_ += use[i];
    }
    if (model_->inputs_at_end()) model_->take_inputs(channels);
    for (int i = 0; i < steps; ++i) filter_->predict(dt / steps, dt / steps / period_);
    filter_->correct(y.data(), use.data());
    model_->take_inputs(channels);
    return std::all_of(filter_->state(), filter_->state() + states_, [](double v) { return std::isfinite(v); });
  }

  void write(const double* channels, bool begun, Estimate& estimate) const override {
    estimate.covariance.resize(states_ * states_);
    filter_->covariance(estimate.covariance.data());
    estimate.state.assign(filter_->state(), filter_->state() + states_);
    estimate.innovation.assign(filter_->innovation(), filter_->innovation() + measured_.size());
    estimate.innovation_std.assign(filter_->innovation_std(), filter_->innovation_std() + measured_.size());
    estimate.normalised_innovation = filter_->normalised_innovation();
    estimate.observed = begun ? 0 : observed_;
    model_->quantities(channels, filter_->state(), estimate.covariance.data(), estimate.quantities);
    model_->innovation_quantities(estimate.innovation.data(), estimate.innovation_std.data(), estimate.quantities);
  }

 private:
  std::unique_ptr<ProcessModel> model_;
  std::unique_ptr<StateEstimator> filter_;
  std::vector<int> measured_;
  std::vector<std::string> names_;
  std::size_t states_;
  double period_;
  int observed_ = 0;
};

}  // namespace

std::unique_ptr<Estimator> make_filter(const Datasheet& sheet, const StageSpec& spec) {
  return std::make_unique<FilterCore>(sheet, spec);
}

}  // namespace faultline
