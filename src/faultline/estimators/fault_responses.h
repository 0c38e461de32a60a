// Which effect, and how much of it, explains what a rig's model does not: by the response of the model to every effect that its
// datasheet allows, in the motion that was recorded.
// Sources: Gustafsson, Adaptive Filtering and Change Detection (2000), chapter 9 (likelihood ratio with marginalised sizes); Isermann,
// Fault-Diagnosis Systems (2006), chapter 9.
//
// Stretches of samples are cut into segments with smoothed start states (fit/segment_model.h). r: whitened residuals of the nominal
// model, T: their answer to each parameter (per tolerance) and each nuisance effect of the datasheet (as listed), d_h: to fault h per
// amplitude. Parameters are known to one tolerance and what earlier stretches said, so to first order fault h of amplitude a costs
//
//   L_h(a) = min over theta of  |r_ref + T_ref theta|^2 + |r + T theta + d_h a|^2 + theta' theta
//   a_h = -(b - C' Lambda^-1 n)/D_h,  D_h = g - C' Lambda^-1 C,  evidence E_h = L(0) - L_h(a_h) = a_h^2 D_h
//
// with n = T'r, C = T'd, b = d'r, g = d'd and Lambda = 1 + T'T over all stretches. Many times over: as a change (the fault is in the last
// stretch only, in the last two, ... of the recent ones) and from the start (it is in all); the most evidence decides. Squares are divided by `inflation`: residuals of a model that is a little wrong
// are not independent. While nothing is wrong the model is made linear anew around what it learnt of the parameters. A segment counts by one over its mean square where that is above 1. The best few are refined by Gauss-Newton
// steps on the model with the effect in it, and searched for a second fault beside the first.
//
// Units: amplitudes as in FaultHypothesis. D_h says what could be seen: a fault whose least amplitude at the threshold lies beyond
// its range is not observable in this motion.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "faultline/estimators/fault_hypothesis.h"
#include "faultline/fit/segment_model.h"

namespace faultline {

struct ResponseSettings {
  std::size_t segment = 100;  // samples
  std::size_t segments = 4;   // counted per stretch; one more runs before them, so that effects with memory settle
  double every = 2;           // s between the beginnings of stretches
  std::size_t recent = 3;     // stretches in which a fault is looked for
  double memory = 10;         // stretches: how long earlier ones speak for the parameters
  double inflation = 30;      // of variances
  double threshold = 30;      // evidence from which there is a fault
  std::size_t refined = 6;    // hypotheses that are refined
  int jobs = 1;               // threads
};

struct RankedFault {
  std::size_t hypothesis = 0;
  double amplitude = 0, std = 0;
  double evidence = 0;
};

class FaultResponses {
 public:
  FaultResponses(const Datasheet& sheet, const ResponseSettings& settings);
  ~FaultResponses();

  void reset();
  // One sample; `good`: all channels are fit to be used. True where a stretch ended and everything below was found anew.
  bool add(double time, const double* channels, bool good);
  // The two halves of add(), for those who cannot wait: collect() says that take() has a stretch for judge(), which may run in
  // another thread while samples are collected on.
  bool collect(double time, const double* channels, bool good);
  std::unique_ptr<Recording> take() { return std::move(collecting_); }
  void judge(const Recording& stretch);

  const std::vector<FaultHypothesis>& hypotheses() const { return hypotheses_; }
  // While a fault is there: best first, refined ones only. Empty: nothing is wrong.
  const std::vector<RankedFault>& first() const { return first_; }
  // The same for what is wrong beside the first.
  const std::vector<RankedFault>& second() const { return second_; }
  double since() const { return since_; }        // s, start of the first stretch that shows it
  double evidence() const { return evidence_; }  // of the best, refined or not
  // Per hypothesis, over all stretches so far (forgetting as set): standard error of the amplitude of a fault that comes after as much
  // healthy motion. Large where the motion does not show it.
  std::vector<double> amplitude_errors() const;
  // Cosines between the responses to hypotheses after parameters and start states are projected out, over the same.
  Eigen::MatrixXd cosines() const;

 private:
  struct Stretch;
  struct Sums;
  struct Prior;
  std::unique_ptr<Stretch> respond(const Recording& recording) const;
  bool relinearise();  // whether anything moved; so does the next
  bool search_parameters();
  void set_base();  // from shift_
  void move(const Eigen::VectorXd& step);
  Prior prior() const;
  Eigen::MatrixXd information() const;
  std::vector<RankedFault> screen(const Prior& prior) const;
  void best_window();  // sets change_ and window_, and screened_
  double loss(const Prior& prior, const std::vector<EffectSpec>& effects) const;
  RankedFault refine(const Prior& prior, double base_loss, RankedFault start) const;
  std::vector<RankedFault> best_of(const Prior& prior, double base_loss, std::vector<RankedFault> screened,
                                   std::map<std::size_t, double>* candidates = nullptr) const;
  void look_beside(const Prior& before);
  bool over();  // the latest stretch no longer shows the fault

  Datasheet sheet_;
  ResponseSettings settings_;
  SegmentModel model_;
  std::vector<FaultHypothesis> hypotheses_;
  std::vector<std::size_t> free_;  // parameters with a tolerance
  std::vector<EffectSpec> nuisance_;
  std::vector<double> base_;  // parameters around which the model is made linear
  Eigen::VectorXd shift_;     // how far they are from the datasheet: tolerances, then zeros for nuisance effects
  std::unique_ptr<Recording> collecting_;
  double next_ = 0;
  std::size_t rows_ = 0;  // of a stretch
  bool started_ = false;
  std::vector<std::unique_ptr<Stretch>> recent_;
  std::unique_ptr<Sums> reference_;
  bool event_ = false;
  bool change_ = false;  // the fault is in the last window_ of the recent stretches only; else it was always there
  std::size_t window_ = 0;
  std::vector<RankedFault> screened_;
  std::vector<EffectSpec> there_;  // what is known to be wrong while a second fault is looked for
  std::vector<RankedFault> first_, second_;
  std::map<std::size_t, double> candidates_;  // amplitudes of the hypotheses that explained the fault best
  double since_ = 0, evidence_ = 0, refined_at_ = 0;
  unsigned age_ = 0;        // of the event, in stretches
  unsigned stretches_ = 0;  // since the beginning
};

}  // namespace faultline
