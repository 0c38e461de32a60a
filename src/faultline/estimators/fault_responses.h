// Which effect, and how much of it, explains what a rig's model does not: by the response of the model to every
// effect that its datasheet allows, in the motion that was recorded. Sources: Gustafsson, Adaptive Filtering and
// Change Detection (2000), chapter 9 (likelihood ratio with marginalised sizes); Isermann, Fault-Diagnosis Systems
// (2006), chapter 9.
//
// Stretches of samples give the sums of stretch_model.h, in which all hypotheses are screened to first order
// (attribution/screening.h), many times over: as a change (the fault is in the last stretch only, in the last two, ...
// of the recent ones) and from the start (it is in all); the most evidence decides. While nothing is wrong the model is
// made linear anew around what it learnt of the parameters. The best few hypotheses are refined on the model with the
// effect in it, and a second fault is searched for beside the first (fault_search.h).
//
// What was found is told once stretches that had no part in finding it confirm it (confirmation.h): with the fault as
// it was found, the model must explain them better.
//
// Most stretches say what those before them said. One whose misfit with all that is known (known_model.h) is the usual
// one cannot win evidence for any other cause, so it costs one run of the model and is not looked at further, while
// well or while a fault lasts.
//
// Units: amplitudes as in FaultHypothesis; evidence is twice a log-likelihood ratio (response_settings.h). A fault
// whose least amplitude at the threshold lies beyond its range is not observable in this motion.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "faultline/estimators/confirmation.h"
#include "faultline/estimators/fault_search.h"
#include "faultline/estimators/known_model.h"
#include "faultline/estimators/lost_model.h"
#include "faultline/estimators/plausibility.h"

namespace faultline {

class FaultResponses {
 public:
  FaultResponses(const Datasheet& sheet, const ResponseSettings& settings);

  void reset();
  // A stretch of stretch_collector.h; everything below is found anew.
  void judge(const Recording& stretch);

  const std::vector<FaultHypothesis>& hypotheses() const { return model_.hypotheses(); }
  // While a fault is there: best first, refined ones only. Empty: nothing is wrong, or not surely.
  const std::vector<RankedFault>& first() const { return confirmation_.given() ? first_ : none_; }
  // What that would be, while it is undecided.
  const std::vector<RankedFault>& suspected() const { return undecided() ? first_ : none_; }
  // The same for what is wrong beside the first.
  const std::vector<RankedFault>& second() const { return confirmation_.given() ? second_ : none_; }
  // Something is suspected that the next stretches must confirm; not for ever: a rig that rests confirms nothing.
  bool undecided() const { return event_ && !confirmation_.given() && age_ <= settings_.recent_stretches; }
  // The same, and enough is known of the rig: the next stretches may say more at once. Before that it takes another
  // motion, not more of the same.
  bool hurries() const { return undecided() && stretches_ > settings_.early_stretches; }
  // A channel that is not what it is called explains more (plausibility.h); empty: none does.
  const std::string& doubt() const { return reading_.text; }
  // Port of the transducer or the command that is stuck, where that is the doubt; else empty.
  std::string stuck() const { return stuck_port(sheet_, reading_); }
  // Faults at every place of the rig would have shown so far: it moved, or is held where all of them show.
  bool shows() const { return shows_; }
  // s, start of the first stretch that shows it
  double since() const { return lost() ? lost_.since() : reading_.is_stuck() ? reading_.since : since_; }
  // No cause was found for what the model does not follow, stretch after stretch.
  bool lost() const { return !event_ && !explained_ && lost_.lost(); }
  // Of the best, refined or not; of a stretch not looked at closely, what there could be at most; of what is not
  // confirmed no more than the threshold. While no fault is there but residuals hold more than the rig without faults
  // explains (explained_ratio), or the model is far off it, at least weighed_from(); where it is lost, the threshold.
  double evidence() const {
    if (event_) return confirmation_.given() ? evidence_ : std::min(evidence_, settings_.threshold_evidence);
    if (lost()) return std::max(lost_.evidence(), settings_.threshold_evidence);
    return explained_ ? evidence_ : std::max(evidence_, weighed_from(settings_));
  }
  std::uint64_t runs() const { return model_.runs(); }  // of the model so far
  // Per hypothesis, over all stretches so far (forgetting as set): standard error of the amplitude of a fault that
  // comes after as much healthy motion. Large where the motion does not show it.
  std::vector<double> amplitude_errors() const;
  // Cosines between the responses to hypotheses after parameters and start states are projected out, over the same.
  Eigen::MatrixXd cosines() const;

 private:
  // Which of the recent stretches hold the fault: the last `stretches`, or (no change) these and all before.
  struct Window {
    bool change = false;
    std::size_t stretches = 0;
  };
  Stretches latest(std::size_t count) const;     // newest first
  std::vector<ModelPoint> explanations() const;  // of the latest stretch, by what was found
  bool says_nothing_new();                       // the latest stretch
  void pass_over();
  Eigen::VectorXd theta() const;  // best, from the point
  double unexplained(const Stretch& stretch) const;
  // Of the stretches that responded, beyond so much of each: evidence that no effect can exceed.
  double unexplained(double usual = 0) const;
  void judge_stretch();  // the latest
  bool stays_stuck();    // so it needs no more judging
  void look_what_shows();
  void respond_all();
  void weigh_all();
  void learn_parameters();  // around what they seem to be, the model is made linear anew
  bool relinearise();       // whether anything moved
  bool search_parameters(const Stretches& all, std::vector<bool>& straight);
  void keep_healthy(const Recording& recording);
  Eigen::MatrixXd known_from(const Eigen::VectorXd& step) const;
  void move(const Eigen::VectorXd& step);
  void forget_oldest();
  void remember_oldest();
  double speaks_for() const;  // evidence of the latest stretch alone for the fault, as it was found
  bool over() const { return speaks_for() < -settings_.over_evidence; }  // it no longer shows it
  void doubt_once_more();
  Eigen::MatrixXd prior(const Window& window) const;  // [r T]'[r T] of what is known of theta
  std::vector<RankedFault> screen(const Window& window) const;
  std::vector<RankedFault> find_window();  // sets window_; what it screened there
  Scene scene() const;                     // of window_
  // [r T] of sums over [r T D].
  template <class Sums>
  auto known_part(Sums& sums) const {
    return sums.topLeftCorner(1 + model_.parameters(), 1 + model_.parameters());
  }
  // What best_of() goes by while a fault lasts.
  std::map<std::size_t, double> remembered() const;
  void find_healthy_or_fault();
  bool follow();  // the fault that is there; false: all causes must be weighed anew
  void look_beside(const Eigen::MatrixXd& before);
  bool look_since(const Scene& now, std::vector<RankedFault>& ranked);
  void end_event();
  std::vector<EffectSpec> found_effects() const;
  void know_healthy();
  void know_fault(const Scene& scene);
  Eigen::MatrixXd information() const;

  Datasheet sheet_;
  ResponseSettings settings_;
  StretchModel model_;
  ModelPoint point_;  // around which the model is made linear
  std::vector<std::unique_ptr<Stretch>> recent_;
  Eigen::MatrixXd reference_;  // sums of the stretches before the recent ones
  double doubt_ = 0;           // what might have been explained in those of them that were not weighed
  bool event_ = false;
  std::size_t shown_ = 0;  // latest stretches that may show a fault: those before hold nothing that is unexplained
  Window window_;
  std::vector<RankedFault> first_, second_;
  const std::vector<RankedFault> none_;
  bool young_ = false;                        // the event is a change that came while little had been learnt
  bool explained_ = false;                    // the latest stretches looked at closely, by the rig without faults
  std::map<std::size_t, double> candidates_;  // amplitudes of the hypotheses that explained the fault best
  double since_ = 0, evidence_ = 0, refined_at_ = 0, refined_amplitude_ = 0;
  KnownModel known_;
  LostModel lost_;
  Confirmation confirmation_;   // of the event
  bool was_given_ = false;      // before the latest stretch
  OtherReading reading_;        // of the event
  ModelPoint known_before_;     // of the rig, when the event was found
  Recording before_;            // the last stretch without the fault, where there is one
  Found found_;                 // what the event was found by
  std::deque<Recording> past_;  // healthy ones before the recent, newest last
  unsigned age_ = 0;            // of the event, in stretches
  unsigned stretches_ = 0;      // since the beginning
  bool shows_ = false;
};

}  // namespace faultline
