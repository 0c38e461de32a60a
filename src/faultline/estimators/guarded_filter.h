// A filter that can do without a transducer: it watches some of its measured channels, leaves out the one that lies,
// tells its estimate in place of the reading, and takes the reading back when it agrees again.
//
// A bank of the same filter on the same model with other measurement sets: the main one on all channels that are
// trusted; the reference without any watched channel; and for each watched channel one on those that are trusted less
// that channel. d_c is the mean over `average` of reading minus reference, less what is usual (learnt over `learn`,
// then followed over `memory` while nothing is suspected), C the covariance of all d on the healthy rig, learnt alike,
// plus (0.15 least)^2 each. What happens in the process moves all d together; a transducer that lies by l
// moves its own alone. With e = C^-1 d, l_c = e_c/(C^-1)_cc explains the share e_c^2/(C^-1)_cc of the misfit d'e
// (generalised least squares, one hypothesis a channel). The channel that explains most is not trusted any more when
//
//   |l_c| > least_c,  it explains more than the next by `margin`,  and leaves less than 4 for each other channel
//
// as long as two are trusted; when its reading r follows the motion that the reference p predicts less than half as
// much as usual while the others do, and hardly moves by itself,
//
//   gain = cov(r, p)/var(p),  gain + 2 sigma < usual gain/2,  var(p) > (least/4)^2,
//   var(r) - R < (usual gain/2)^2 var(p),
//   sigma^2 = ((var(r - gain p) - R) average/(2 learn) + R T/(2 learn))/var(p)
//
// (variances over `learn`: what is beyond the transducer's noise R is taken to last `average`); or when it stands at an
// end of its range for `average` while the filter without it is not within `least` of one. It is trusted again after
// `release` s within least/2 of what the filter without it predicts (plus what is usual of that) and, where it did not
// follow, of following. Nothing is held against a reading within `average` of a sample in which a channel that is not
// watched could not be read. This is structured residuals (Gertler, Fault Detection and Diagnosis in Engineering
// Systems, 1998) on a bank of filters.
// Settings: filter (a state estimator), model and its own; least (per channel that the model measures, in its unit; 0:
// not watched; two watched or more), margin (of chi square), average, learn, memory, release (s).
// Quantities after the model's, per watched channel: CHANNEL_best, the reading while trusted, else the estimate without
// it plus what is usual of reading minus it, with a standard deviation (the filter's, or what it missed the healthy
// reading by beyond R, if that is more: a filter does not know its model's error); CHANNEL_virtual, that always;
// CHANNEL_replaced, 0 while trusted, else by how much it lies: reading minus that estimate, averaged.
// Fails where the rig begins with a transducer that lies, and where a process moves one reading alone: a new load on a
// piston, say, may look as the lie of one chamber's pressure.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/estimators/state_estimator.h"

namespace faultline {

class GuardedFilter : public Estimator {
 public:
  GuardedFilter(const Datasheet& sheet, const StageSpec& spec);

  std::vector<State> states() const override { return model_->states(); }
  std::vector<std::string> innovation_names() const override { return names_; }
  void begin(const double* channels) override;
  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override;
  void write(const double* channels, bool begun, Estimate& estimate) const override;

 private:
  using Outputs = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaximumOutputs, 1>;
  using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaximumOutputs, kMaximumOutputs>;
  struct Guard {
    std::size_t row, state;  // of y; the state that it is
    std::string channel, unit;
    double least, minimum, maximum;
    std::unique_ptr<StateEstimator> without;
    bool trusted = true, readable = true, frozen = false;
    double reading = 0, predicted = 0, predicted_variance = 0;                   // now; predicted without it
    double slow_reading = 0, slow_reference = 0, own = 0, both = 0, motion = 0;  // means; (co)variances about them
    double off = 0, usual_off = 0;      // mean of reading - reference; the same on the healthy rig
    double apart = 0, usual_apart = 0;  // mean of reading - predicted, likewise
    double noise = 0;                   // R
    double spread = 0;                  // mean square of reading - predicted on the healthy rig
    double usual_gain = 0, moved = 0;   // of that motion, and s in which there was enough
    double calm = 0, silent = 0;        // s, for which it has agreed, has stood at an end of its range
  };

  void look(double dt);
  void follow(double dt);  // what is usual
  struct Suspect {
    std::size_t guard = 0;
    double lie = 0, margin = 0;  // in units of its least
    bool plausible = false;      // what the lie leaves is usual
  };
  Suspect suspect() const;
  void accuse();
  static double change(const Guard& guard) { return guard.off - guard.usual_off; }
  static double stand_in(const Guard& guard) { return guard.predicted + guard.usual_apart; }
  void forgive(double dt);
  bool tells(const Guard& guard) const;  // whether the motion is enough
  double follows(const Guard& guard, double& sigma) const;

  std::unique_ptr<ProcessModel> model_;
  std::unique_ptr<StateEstimator> main_, reference_;
  std::vector<Guard> guards_;
  std::vector<int> measured_;
  std::vector<std::string> names_;
  std::size_t states_;
  double period_, average_, learn_, memory_, release_, margin_;
  Covariance usual_;                    // of change() on the healthy rig; lower triangle
  double age_ = 0;                      // s
  double seen_ = 0;                     // s, for which all channels that are not watched have been readable
  std::vector<std::size_t> unwatched_;  // rows
  bool quiet_ = true;                   // nothing is suspected
  int observed_ = 0;
};

}  // namespace faultline
