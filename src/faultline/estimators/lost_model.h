// Whether the model has lost the rig: stretches in a row of which it leaves much more than of those before, though no
// cause of the datasheet was found in them. One such stretch is a motion that was not seen before, of which the next is
// usual again. What a stretch leaves usually, with parameters learnt anew, is the median over earlier ones that were
// looked at closely: a model that is always wrong by as much has lost nothing.
//
// Evidence as in response_settings.h.
#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <limits>

#include "faultline/estimators/response_settings.h"
#include "faultline/numerics/quantiles.h"

namespace faultline {

class LostModel {
 public:
  explicit LostModel(const ResponseSettings& settings)
      : new_(settings.new_fraction * settings.threshold_evidence),
        strange_(settings.lost_fraction * settings.threshold_evidence),
        stretches_(settings.lost_stretches) {}

  // A stretch that began at `begin` [s], with so much beyond what is known, of which parameters, learnt anew, leave
  // `left`.
  void hear(double begin, double beyond, double left) {
    const double more = left - usual();
    if (std::min(beyond, more) <= least_news()) {
      end();
      lefts_.push_back(left);
      if (lefts_.size() > kRemembered) lefts_.pop_front();
      return;
    }
    if (count_++ == 0) since_ = begin;
    evidence_ += more;
  }
  // One with so little beyond what is known that it was not looked at closely: where the model is lost, like those
  // before.
  void pass(double beyond) {
    if (!lost() || beyond <= new_) return end();
    evidence_ += evidence_ / static_cast<double>(count_);
    ++count_;
  }
  void reset() {
    end();
    lefts_.clear();
  }
  void end() {
    count_ = 0;
    evidence_ = 0;
  }

  bool strange() const { return count_ > 0; }  // the last one was
  bool lost() const { return count_ >= stretches_; }
  double since() const { return since_; }  // s
  double evidence() const { return evidence_; }
  // What a cause must explain at least to be the one: half of what came in over as many stretches.
  double least() const {
    return lost() ? 0.5 * evidence_ / static_cast<double>(count_) * static_cast<double>(stretches_) : 0;
  }

 private:
  static constexpr std::size_t kRemembered = 15;  // stretches

  double least_news() const { return lost() ? new_ : strange_; }
  // Before anything was heard nothing is strange.
  double usual() const {
    return lefts_.empty() ? std::numeric_limits<double>::infinity() : median({lefts_.begin(), lefts_.end()});
  }

  double new_, strange_;
  std::size_t stretches_, count_ = 0;
  double since_ = 0, evidence_ = 0;
  std::deque<double> lefts_;  // of stretches that were not strange
};

}  // namespace faultline
