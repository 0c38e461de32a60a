// A discrete-time model as estimators see it: x+ = f(x, u, dt) + v, y = h(x) + w, v ~ N(0, Q dt/T), w ~ N(0, R). Any
// number of unknown parameters may stand among the states as random walks. Where the inputs u are measured, their noise
// may be given too: it reaches the states through G = df/du. Models register themselves by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/registry.h"

namespace faultline {

constexpr int kMaximumStates = 16;
constexpr int kMaximumOutputs = 8;
constexpr int kMaximumNoisyInputs = 16;

class ProcessModel {
 public:
  virtual ~ProcessModel() = default;

  // Models of which this one consists side by side: no state, input or output of one is another's, and theirs one after
  // the other are this one's. Filters run on each of them, and ask the whole for quantities only. Empty: there are
  // none.
  virtual std::vector<std::unique_ptr<ProcessModel>> parts() const { return {}; }

  virtual std::vector<State> states() const = 0;              // names and units, in the model's scaling
  virtual std::vector<int> measured_channels() const = 0;     // rows of y, as channels of the rig
  virtual std::vector<int> driving_channels() const = 0;      // channels that take_inputs reads
  virtual std::vector<double> process_noise() const = 0;      // diagonal of Q, per sample period
  virtual std::vector<double> measurement_noise() const = 0;  // diagonal of R
  // First state and the diagonal of its covariance, from the first sample.
  virtual void initial(const double* channels, double* state, double* variance) const = 0;

  virtual void take_inputs(const double* channels) = 0;  // held for the next predict
  // Whether a step rests on the inputs at its end (states that settle within a step) rather than at its beginning.
  virtual bool inputs_at_end() const { return false; }
  // Scaled; NaN where a reading says nothing (at the end of a transducer's range): that row is then left out.
  virtual void measurement(const double* channels, double* y) const = 0;
  virtual void predict(const double* state, double dt, double* next) const = 0;  // dt in s
  // From several states of `n` values, one after the other: the first, and up to 2 n others around it.
  virtual void predict_all(const double* all, int n, int count, double dt, double* next) const {
    for (int i = 0; i < count; ++i) predict(all + i * n, dt, next + i * n);
  }
  virtual void observe(const double* state, double* y) const = 0;
  // Where y is plainly some of the states: which, one per row of y. Empty: filters ask observe(). Saves them most of a
  // correction.
  virtual std::vector<int> observed_states() const { return {}; }

  // A = df/dx, states x states, row after row; false where the model has none (an extended Kalman filter then refuses
  // it).
  virtual bool jacobian(const double* /*state*/, double /*dt*/, double* /*a*/) const { return false; }
  // Both, where they share their effort. Asked for only where jacobian() gives one.
  virtual void predict_linear(const double* state, double dt, double* next, double* a) const {
    predict(state, dt, next);
    jacobian(state, dt, a);
  }
  // Whether x+ is as good as linear between two states: f(b) = f(a) + A(a)(b - a).
  virtual bool near(const double* /*a*/, const double* /*b*/) const { return false; }
  // C = dh/dx, outputs x states, row after row; asked for only where observed_states() is empty.
  virtual bool observe_jacobian(const double* /*state*/, double* /*c*/) const { return false; }
  // Variance of each noisy input; input_jacobian writes G, states x inputs, row after row.
  virtual std::vector<double> input_noise() const { return {}; }
  virtual void input_jacobian(const double* /*state*/, double /*dt*/, double* /*g*/) const {}

  // Derived quantities with physical units; `covariance` row after row. Names and number never change.
  virtual void quantities(const double* channels, const double* state, const double* covariance,
                          std::vector<Quantity>& result) const = 0;
  // Those of them that rest on the innovation (measured minus predicted) and its predicted standard deviation; after
  // quantities().
  virtual void innovation_quantities(const double* /*innovation*/, const double* /*innovation_std*/,
                                     std::vector<Quantity>& /*result*/) const {}
};

struct ProcessModelType {
  static constexpr const char* kKind = "process model";
  std::string name;
  std::unique_ptr<ProcessModel> (*make)(const Datasheet& sheet, const Settings& settings);
};

template <class T>
std::unique_ptr<ProcessModel> make_process_model_of(const Datasheet& sheet, const Settings& settings) {
  return std::make_unique<T>(sheet, settings);
}

// InputError that lists the known models where there is none of that name.
inline std::unique_ptr<ProcessModel> make_process_model(const std::string& name, const Datasheet& sheet,
                                                        const Settings& settings) {
  return registry<ProcessModelType>().require(name, settings.where()).make(sheet, settings);
}

}  // namespace faultline

#define FAULTLINE_PROCESS_MODEL(name, ...) FAULTLINE_REGISTER(ProcessModelType, name, __VA_ARGS__)
