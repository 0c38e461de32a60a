// What a rig's balances say of each fault of its datasheet, for the signature isolator. A balance is a parity
// relation: an equation of the rig between measured channels whose residual is zero on a healthy rig. A model names
// features (quantities of an estimator stage), residuals that are zero while nothing has changed, and hypotheses:
// faults of one unknown size each.
//
// A hypothesis is tried by taking its effect out of the features: residuals(features, reference, h, size) are those
// that a rig without the fault would show if fault h of that size explained what is measured. The right one, of the
// right size, leaves nothing. Its derivative by the size is the fault's signature. Models register themselves by
// name.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/rig/alarm_kind.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/registry.h"

namespace faultline {

struct Hypothesis {
  AlarmKind kind = AlarmKind::fault;  // or sensor
  std::string effect, port;           // of the datasheet
  std::string text;                   // one sentence
  std::string size_name, size_unit;
  double unit = 1;            // a small size, for differences
  double low = 0, high = 0;   // allowed sizes, counted from no effect
  std::vector<int> channels;  // of the rig: not sought while one of these is already known to be off
  std::string drift_unit;     // of a sensor's offset per second; empty: a slow change of this is not a drift
  double rise = -1;           // s, time constant with which a step of it shows; -1: not told apart by that
  int feature = -1;           // what the sensor itself shows; -1: whether it is stuck cannot be seen
  double shown_from = 0;      // the effect's no-effect value: what is told is this plus the size
};

// The fault `name` (effect@port) of a rig's one list, its size within ten times the datasheet's range; nothing where
// that list does not have it.
std::optional<Hypothesis> listed(const std::vector<FaultHypothesis>& all, const std::string& name, std::string text);

class BalanceModel {
 public:
  virtual ~BalanceModel() = default;

  virtual std::vector<std::string> features() const = 0;        // names of quantities
  virtual std::vector<double> feature_noise() const = 0;        // white, per sample, one sigma
  virtual std::vector<std::string> residuals() const = 0;       // names, for messages
  virtual std::vector<std::string> residual_kinds() const = 0;  // by which settings are given, one per residual
  virtual std::vector<Hypothesis> hypotheses() const = 0;
  // Which channels of the rig each residual rests on.
  virtual std::vector<std::vector<int>> residual_channels() const = 0;
  // Coefficients at the balances, from mean features of a healthy rig; `reference` has one entry per residual.
  virtual void reference(const double* features, double* reference) const = 0;
  // What the change of the operating point since `learnt` may do to each residual because the balances are only
  // nearly right; one sigma, zero at the same point.
  virtual void errors(const double* features, const double* learnt, double* error) const = 0;
  // hypothesis -1: as measured.
  virtual void residuals(const double* features, const double* reference, int hypothesis, double size,
                         double* result) const = 0;
};

struct BalanceModelType {
  static constexpr const char* kKind = "balance model";
  std::string name;
  std::unique_ptr<BalanceModel> (*make)(const Datasheet& sheet, const Settings& settings);
};

template <class T>
std::unique_ptr<BalanceModel> make_balance_model_of(const Datasheet& sheet, const Settings& settings) {
  return std::make_unique<T>(sheet, settings);
}

// InputError that lists the known models where there is none of that name.
inline std::unique_ptr<BalanceModel> make_balance_model(const std::string& name, const Datasheet& sheet,
                                                        const Settings& settings) {
  return registry<BalanceModelType>().require(name, settings.where()).make(sheet, settings);
}

}  // namespace faultline

#define FAULTLINE_BALANCE_MODEL(name, ...) FAULTLINE_REGISTER(BalanceModelType, name, __VA_ARGS__)
