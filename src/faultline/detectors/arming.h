// When a detector counts: while a quantity is above a value, for instance the time since a bench fires steadily.
// Settings:
//   armed_by      a quantity; without it the detector always counts
//   armed_above   its value, above which the detector counts
#pragma once

#include <string>

#include "faultline/detectors/detector.h"

namespace faultline {

class Arming {
 public:
  explicit Arming(const Settings& s)
      : quantity_(s.word_or("armed_by", "")), above_(quantity_.empty() ? 0 : s.number("armed_above", -1e12, 1e12)) {}
  void find(const Estimate& estimate) {
    if (!quantity_.empty()) at_ = find_quantity(estimate, quantity_);
  }
  bool armed(const Estimate& estimate) const { return quantity_.empty() || estimate.quantities[at_].value > above_; }

 private:
  std::string quantity_;
  double above_;
  std::size_t at_ = 0;
};

}  // namespace faultline
