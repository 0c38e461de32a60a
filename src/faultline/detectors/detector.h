// A detector turns estimates into a detection: whether something is there, since when, how large, how sure.
// It reads quantities and innovation statistics only, so that it works the same live, in replay and offline. Settings
// of all:
//   kind, effect, port, text   what a detection means (kind: a word of rig/alarm_kind.h)
//   minimum_time  s            how long the condition must hold before it counts
//   release_time  s            how long it must be gone before it ends
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/reference.h"
#include "faultline/signal/error.h"
#include "faultline/signal/registry.h"

namespace faultline {

// s, of times that a datasheet may set: of rigs sampled every 0.1 ms to every 100 s, which may take a million samples
// to settle.
constexpr double kShortest = 1e-6, kLongest = 1e8;

struct Detection {
  bool active = false;
  double since = 0;  // s, when the condition began
  bool has_size = false;
  double size = 0, low = 0, high = 0;  // in size_unit, with 90 % bounds
  double per_effect =
      0;  // size per unit of the effect's own size (a leak flow per coefficient); 0: not to be converted
  double confidence = 0;  // 0..1, that it is there
  bool blind = false;     // it could not show itself now: not observable in this motion
};

// What a detector holds against its threshold: for choosing that threshold from healthy recordings.
struct Criterion {
  double value = std::numeric_limits<double>::quiet_NaN();  // NaN while there is not evidence enough to ask
  double threshold = 0;                                     // as set; an alarm needs value > threshold
  const char* setting = nullptr;                            // its name in the datasheet; null: this detector has none
  double offset = 0;                                        // setting = offset + threshold
};

class Detector {
 public:
  virtual ~Detector() = default;
  virtual void reset() = 0;
  virtual void process(const Estimate& estimate, Detection& detection) = 0;
  virtual Criterion criterion() const { return {}; }
  virtual std::string size_name() const { return ""; }
  virtual std::string size_unit() const { return ""; }
  // What it learnt of the healthy rig, for later runs; none if there is nothing to learn or not yet learnt.
  virtual std::optional<Reference> reference() const { return {}; }
  // Before the first estimate: to judge by this at once instead of learning. InputError where it does not fit.
  virtual void restore(const Reference&) { throw InputError("this type of detector keeps no reference"); }
};

struct DetectorType {
  static constexpr const char* kKind = "detector type";
  std::string name;
  std::unique_ptr<Detector> (*make)(const Datasheet& sheet, const StageSpec& spec);
};

// For a T that asks for the datasheet too, or for its settings only.
template <class T>
std::unique_ptr<Detector> make_detector_of(const Datasheet& sheet, const StageSpec& spec) {
  if constexpr (std::is_constructible_v<T, const Datasheet&, const StageSpec&>)
    return std::make_unique<T>(sheet, spec);
  else
    return std::make_unique<T>(spec.settings);
}

// InputError that lists the known types where there is none of that name.
inline std::unique_ptr<Detector> make_detector(const Datasheet& sheet, const StageSpec& spec) {
  return registry<DetectorType>().require(spec.type, spec.settings.where()).make(sheet, spec);
}

// The place of a quantity in an estimate, looked up once; InputError that lists what there is.
std::size_t find_quantity(const Estimate& estimate, const std::string& name);

}  // namespace faultline

#define FAULTLINE_DETECTOR(name, ...) FAULTLINE_REGISTER(DetectorType, name, __VA_ARGS__)
