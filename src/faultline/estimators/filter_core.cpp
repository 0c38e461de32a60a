// State estimators with their process model inside a stage (estimator.h), one on each part of the model. Setting:
// model;
// the others are the model's.
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
        own_(model_->parts()),
        states_(model_->states().size()),
        period_(sheet.sample_period) {
    for (const int channel : model_->measured_channels())
      names_.push_back(sheet.channels[static_cast<std::size_t>(channel)].name);
    if (own_.empty()) add(*model_, spec.type);
    for (const std::unique_ptr<ProcessModel>& model : own_) add(*model, spec.type);
  }

  std::vector<State> states() const override { return model_->states(); }
  std::vector<std::string> innovation_names() const override { return names_; }

  void begin(const double* channels) override {
    std::array<double, kMaximumStates> state{}, variance{};
    for (const Part& part : parts_) {
      part.model->initial(channels, state.data(), variance.data());
      part.filter->reset(state.data(), variance.data());
      part.model->take_inputs(channels);
    }
    observed_ = 0;
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override {
    observed_ = 0;
    bool finite = true;
    for (const Part& part : parts_) finite = advance(part, channels, status, dt, steps) && finite;
    return finite;
  }

  void write(const double* channels, bool begun, Estimate& estimate) const override {
    estimate.covariance.assign(states_ * states_, 0);
    estimate.state.resize(states_);
    estimate.innovation.resize(names_.size());
    estimate.innovation_std.resize(names_.size());
    estimate.normalised_innovation = 0;
    estimate.observed = begun ? 0 : observed_;
    std::size_t state = 0, output = 0;
    for (const Part& part : parts_) {
      const StateEstimator& filter = *part.filter;
      std::array<double, kMaximumStates * kMaximumStates> covariance;
      filter.covariance(covariance.data());
      for (std::size_t i = 0; i < part.states; ++i)
        std::copy_n(&covariance[i * part.states], part.states, &estimate.covariance[(state + i) * states_ + state]);
      std::copy_n(filter.state(), part.states, &estimate.state[state]);
      std::copy_n(filter.innovation(), part.measured.size(), &estimate.innovation[output]);
      std::copy_n(filter.innovation_std(), part.measured.size(), &estimate.innovation_std[output]);
      estimate.normalised_innovation += filter.normalised_innovation();
      state += part.states;
      output += part.measured.size();
    }
    model_->quantities(channels, estimate.state.data(), estimate.covariance.data(), estimate.quantities);
    model_->innovation_quantities(estimate.innovation.data(), estimate.innovation_std.data(), estimate.quantities);
  }

 private:
  struct Part {
    ProcessModel* model;
    std::unique_ptr<StateEstimator> filter;
    std::vector<int> measured;
    std::size_t states;
  };

  void add(ProcessModel& model, const std::string& type) {
    parts_.push_back({&model, make_state_estimator(type, model), model.measured_channels(), model.states().size()});
  }

  bool advance(const Part& part, const double* channels, const ChannelStatus* status, double dt, int steps) {
    std::array<double, kMaximumOutputs> y{};
    std::array<bool, kMaximumOutputs> use{};
    part.model->measurement(channels, y.data());
    for (std::size_t i = 0; i < part.measured.size(); ++i) {
      use[i] = status[part.measured[i]] == ChannelStatus::good && std::isfinite(y[i]);  // NaN: it says nothing
      observed_ += use[i];
    }
    if (part.model->inputs_at_end()) part.model->take_inputs(channels);
    for (int i = 0; i < steps; ++i) part.filter->predict(dt / steps, dt / steps / period_);
    part.filter->correct(y.data(), use.data());
    part.model->take_inputs(channels);
    return std::all_of(part.filter->state(), part.filter->state() + part.states,
                       [](double v) { return std::isfinite(v); });
  }

  std::unique_ptr<ProcessModel> model_;
  std::vector<std::unique_ptr<ProcessModel>> own_;  // its parts; empty: it is the only one
  std::vector<Part> parts_;
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
