// Relations between the channels of a rig that are linear in unknown coefficients: y_i = h_i' theta_i. Each is fitted
// by its own recursive least squares. y and h may be filtered (state variable filters), so a model has memory. Models
// register themselves.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/registry.h"

namespace faultline {

struct Relation {
  std::string name;                 // of its residual
  std::vector<State> coefficients;  // theta
  std::vector<double> first;        // theta at the start
  std::vector<int> channels;        // that y and h need
  double excitation = 0;            // smallest |h| that says something
  // Size of each coefficient: h comes times scale, least squares work on theta over scale; empty: 1.
  std::vector<double> scale = {};
  // Autocovariance of what the sensors' noise leaves of the relation, from lag 0 on (coloured_noise.h); empty: white,
  // of a size that is measured.
  std::vector<double> noise = {};
};

class RelationModel {
 public:
  virtual ~RelationModel() = default;

  virtual std::vector<Relation> relations() const = 0;
  virtual void reset(const double* channels) = 0;  // begins anew with this sample
  // From the last sample to this one, dt in s.
  virtual void advance(const double* channels, const ChannelStatus* status, double dt) = 0;
  // What came before is another rig's: no rows until the filters have forgotten it.
  virtual void renew() {}
  // Writes h, returns y, for the last sample; NaN where its row is not to be used.
  virtual double row(std::size_t relation, double* h) const = 0;
  // Further quantities, after the coefficients. Names and number never change.
  virtual void quantities(const double* channels, std::vector<Quantity>& result) const = 0;
};

struct RelationModelType {
  static constexpr const char* kKind = "relation model";
  std::string name;
  std::unique_ptr<RelationModel> (*make)(const Datasheet& sheet, const Settings& settings);
};

template <class T>
std::unique_ptr<RelationModel> make_relation_model_of(const Datasheet& sheet, const Settings& settings) {
  return std::make_unique<T>(sheet, settings);
}

// InputError that lists the known models where there is none of that name.
inline std::unique_ptr<RelationModel> make_relation_model(const std::string& name, const Datasheet& sheet,
                                                          const Settings& settings) {
  return registry<RelationModelType>().require(name, settings.where()).make(sheet, settings);
}

}  // namespace faultline

#define FAULTLINE_RELATION_MODEL(name, ...) FAULTLINE_REGISTER(RelationModelType, name, __VA_ARGS__)
