// Whether the model has lost the rig: stretches in a row that it does not follow, though no cause of the datasheet was
// found in them. One such stretch is a motion that was not seen before, of which the next is usual again.
//
// Evidence as in response_settings.h.
#pragma once

#include <cstddef>

#include "faultline/estimators/response_settings.h"

namespace faultline {

class LostModel {
 public:
  explicit LostModel(const ResponseSettings& settings)
      : new_(settings.new_fraction * settings.threshold_evidence),
        strange_(settings.lost_fraction * settings.threshold_evidence),
        stretches_(settings.lost_stretches) {}

  // A stretch that began at `begin` [s], with so much beyond what is usual; 0 of one that parameters, learnt anew,
  // explain.
  void hear(double begin, double beyond) {
    if (beyond <= (lost() ? new_ : strange_)) return reset();
    if (count_++ == 0) since_ = begin;
    evidence_ += beyond;
  }
  void reset() { *this = LostModel(new_, strange_, stretches_); }

  bool lost() const { return count_ >= stretches_; }
  double since() const { return since_; }  // s
  double evidence() const { return evidence_; }
  // What a cause must explain at least to be the one: half of what came in over as many stretches.
  double least() const {
    return lost() ? 0.5 * evidence_ / static_cast<double>(count_) * static_cast<double>(stretches_) : 0;
  }

 private:
  LostModel(double news, double strange, std::size_t stretches)
      : new_(news), strange_(strange), stretches_(stretches) {}

  double new_, strange_;
  std::size_t stretches_, count_ = 0;
  double since_ = 0, evidence_ = 0;
};

}  // namespace faultline
