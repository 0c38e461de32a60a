// All that is known of a rig: parameters, nuisance effects, faults that were found; and whether a stretch says anything
// else. One run of the model tells.
//
//   misfit = sum over segments of  weight |C r_w|^2
//
// r_w: residuals of the model with all that is known in it, start states projected out; C: the first cosines of each
// output over a segment (stretch_model.h); weight: one over their mean square, which is what the model is usually off
// by, or over twice the most that was usual so far, so that what grows beyond does not become the usual. What any
// effect could explain of a stretch is at most what its misfit has beyond the usual one: that of noise and of the
// model's usual error, the median over healthy stretches that were looked at closely.
//
// What a stretch leaves beyond white noise (StretchModel::beyond_noise) bounds what any effect could explain, but the
// model's usual error is in it too. Stretches that were weighed and held no fault tell how much of it no cause
// explains: their median.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "faultline/estimators/stretch_model.h"

namespace faultline {

class KnownModel {
 public:
  explicit KnownModel(const StretchModel& model) : model_(model) {}

  void forget_misfits() {  // of healthy stretches: the model is linear around another point
    misfits_.clear();
    squares_.clear();
    inexplicable_.clear();
  }
  void forget_starts() { lately_.clear(); }  // nothing is borrowed from stretches before
  // Nothing is wrong: theta from the point, around which stretches responded. `recent`: oldest first.
  void learn_healthy(const ModelPoint& point, const Eigen::VectorXd& theta,
                     const std::vector<std::unique_ptr<Stretch>>& recent);
  // `faults` are there, in the last `count` of them.
  void learn_fault(const ModelPoint& point, const Eigen::VectorXd& theta, const std::vector<EffectSpec>& faults,
                   const std::vector<std::unique_ptr<Stretch>>& recent, std::size_t count);
  const ModelPoint& known() const { return known_; }
  // What the stretch's misfit has beyond the usual one; closely where that is more than `news`.
  double beyond(Stretch& stretch, double news);
  double beyond(const Stretch& stretch) const { return stretch.misfit - usual_; }  // as found before
  double healthy() const { return healthy_; }                                      // misfit
  void learn_inexplicable(double per_stretch);  // of healthy stretches that were weighed
  double inexplicable() const;                  // of a stretch; 0 where nothing was weighed

 private:
  // The largest mean square of what healthy segments leave, times kBeyondUsual.
  double most_usual() const;
  double misfit(const Stretch& stretch, const Eigen::MatrixXf& residuals, const StartProjection& starts) const;
  // One run; the start states' part is borrowed from a stretch before where that leaves less than `enough`, else more
  // runs find the stretch's own.
  double misfit(const Stretch& stretch, double enough);
  void keep_starts(std::shared_ptr<const StartProjection> starts);

  const StretchModel& model_;
  ModelPoint known_;
  double usual_ = 0;  // misfit of what holds nothing but that
  double healthy_ = 0;
  double with_fault_ = 0;                                      // largest mean square of a segment then; 0: no fault
  std::deque<double> misfits_, squares_, inexplicable_;        // of healthy stretches; squares_: largest of a segment
  std::deque<std::shared_ptr<const StartProjection>> lately_;  // of stretches before
};

}  // namespace faultline
