// An isolator turns the estimates of a rig's stages into a finding: which fault or sensor it is, where, how large, and
// what else it might be. Settings of all: stage (an estimator of the rig; its first where there is none given).
#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/alarm_kind.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/reference.h"
#include "faultline/signal/error.h"
#include "faultline/signal/registry.h"

namespace faultline {

struct Finding {
  bool active = false;
  double since = 0;                     // s, when it began, as estimated
  AlarmKind kind = AlarmKind::unknown;  // fault, sensor or unknown
  std::string effect, port;             // of the datasheet; empty where none is claimed
  // effect@port of what it cannot be told from; where no effect is claimed: the candidates, the likeliest first
  std::vector<std::string> equivalent;
  std::string text;  // one sentence, without size
  bool has_size = false;
  std::string size_name, size_unit;
  double size = 0, low = 0, high = 0;  // 90 % bounds
  double none = 0;                     // the size that is no effect; may be infinite
  double confidence = 0;               // 0..1, that it is the effect named
  std::string too_small;               // while it is not active: what is seen, and is less than is told; else empty
};

// Whether `name` is effect@port, without making that string.
inline bool is_named(const std::string& name, const std::string& effect, const std::string& port) {
  const std::size_t at = effect.size();
  return name.size() == at + 1 + port.size() && name[at] == '@' && name.compare(0, at, effect) == 0 &&
         name.compare(at + 1, port.size(), port) == 0;
}

// They name the same, or one is among what the other cannot be told from.
inline bool is_one_cause(const Finding& f, const Finding& g) {
  const auto lists = [](const Finding& a, const Finding& b) {
    return std::any_of(a.equivalent.begin(), a.equivalent.end(),
                       [&](const std::string& name) { return is_named(name, b.effect, b.port); });
  };
  return (f.effect == g.effect && f.port == g.port) || lists(f, g) || lists(g, f);
}

class Isolator {
 public:
  virtual ~Isolator() = default;
  virtual void reset() = 0;
  // `doubted`: one flag per channel of the rig, set where its transducer is already known to be off.
  virtual void process(const Estimate& estimate, const std::vector<bool>& doubted, Finding& finding) = 0;
  // Whether its findings stand against the detectors': it weighed every fault of the datasheet against all that was
  // measured. What a detector takes for something else is then not told, and what a detector found waits until the
  // isolator has judged that time.
  virtual bool overrules() const { return false; }
  // Whether it weighed every effect of the library at every port, and not the faults of a table alone.
  virtual bool weighs_every_effect() const { return false; }
  // Whether its findings are worth nothing where the rig's model does not explain the measurements.
  virtual bool rests_on_model() const { return true; }
  // Whether its findings rest on every channel of the rig, so that one that is off spoils them.
  virtual bool rests_on_all_channels() const { return false; }
  // Whether it judged that the rig without any fault explains all that was measured.
  virtual bool finds_all_explained() const { return false; }
  virtual double judged_until() const { return std::numeric_limits<double>::infinity(); }  // s
  // Whether faults would have shown in what it judged: a rig that stands still shows few.
  virtual bool could_see() const { return true; }
  // Since when [s] something may be wrong that what comes next must confirm; NaN: nothing.
  virtual double undecided_since() const { return std::numeric_limits<double>::quiet_NaN(); }
  // Where something is undecided, whether that may be the cause which such a finding names.
  virtual bool suspects(const Finding&) const { return true; }
  // As Detector has them: what it learnt of the healthy rig, and to judge by that instead of learning.
  virtual std::optional<Reference> reference() const { return {}; }
  virtual void restore(const Reference&) { throw InputError("this type of isolator keeps no reference"); }
};

struct IsolatorType {
  static constexpr const char* kKind = "isolator type";
  std::string name;
  std::unique_ptr<Isolator> (*make)(const Datasheet& sheet, const StageSpec& spec);
};

template <class T>
std::unique_ptr<Isolator> make_isolator_of(const Datasheet& sheet, const StageSpec& spec) {
  return std::make_unique<T>(sheet, spec);
}

// InputError that lists the known types where there is none of that name.
inline std::unique_ptr<Isolator> make_isolator(const Datasheet& sheet, const StageSpec& spec) {
  return registry<IsolatorType>().require(spec.type, spec.settings.where()).make(sheet, spec);
}

}  // namespace faultline

#define FAULTLINE_ISOLATOR(name, ...) FAULTLINE_REGISTER(IsolatorType, name, __VA_ARGS__)
