// A rig, or a part of it, as a bilinear system with inputs that are not known:
//   x' = (A + sum over i of u_i A_i) x + B u + E d,   y = C x
// u are computed from channels (products and roots of measured quantities included), d is anything. Which state
// equations are acted upon by d is the user's choice (decoupling.h), so E is not the model's. Models register
// themselves by name.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/registry.h"

namespace faultline {

struct BilinearSystem {
  Eigen::MatrixXd a;                      // states x states
  std::vector<Eigen::MatrixXd> products;  // A_i, one per input; of size zero where there is no product with that input
  Eigen::MatrixXd b;                      // states x inputs
  Eigen::MatrixXd c;                      // outputs x states
};

struct BilinearInput {
  std::string name, unit;
  bool held = false;         // constant from one sample to the next (a command); else linear between samples
  double low = 0, high = 0;  // usual range, over which stability is checked
};

class BilinearModel {
 public:
  virtual ~BilinearModel() = default;

  virtual std::vector<State> states() const = 0;
  virtual std::vector<BilinearInput> inputs() const = 0;
  virtual std::vector<int> measured_channels() const = 0;  // rows of y, as channels of the rig
  virtual std::vector<int> driving_channels() const = 0;   // further channels that inputs() need
  // At these parameters, in the datasheet's order.
  virtual BilinearSystem system(const std::vector<double>& parameters) const = 0;
  // NaN where the equations do not hold: that sample is then no evidence.
  virtual void take_inputs(const double* channels, double* u) const = 0;
};

struct BilinearModelType {
  static constexpr const char* kKind = "bilinear model";
  std::string name;
  std::unique_ptr<BilinearModel> (*make)(const Datasheet& sheet, const Settings& settings);
};

template <class T>
std::unique_ptr<BilinearModel> make_bilinear_model_of(const Datasheet& sheet, const Settings& settings) {
  return std::make_unique<T>(sheet, settings);
}

// InputError that lists the known models where there is none of that name.
inline std::unique_ptr<BilinearModel> make_bilinear_model(const std::string& name, const Datasheet& sheet,
                                                          const Settings& settings) {
  return registry<BilinearModelType>().require(name, settings.where()).make(sheet, settings);
}

}  // namespace faultline

#define FAULTLINE_BILINEAR_MODEL(name, ...) FAULTLINE_REGISTER(BilinearModelType, name, __VA_ARGS__)
