// Isolation by signatures: which single fault, and of which size, explains what the balances of a rig
// (its parity relations, balance_model.h) show.
// Sources: Basseville, Nikiforov, Detection of Abrupt Changes (1993), chapters 2 and 7; Gertler, Fault Detection and
// Diagnosis in Engineering Systems (1998), chapter 3.
//
// 1. Once armed, mean features of `learn` s give the reference. It is kept from one operating point to the next.
// 2. Whenever it arms, the noise sigma_i of each residual follows from that of the features at the operating point
//    there is; a residual of more than `noise_limit` is left out. A two-sided CUSUM (cusum.h) on each, its threshold
//    from sigma_i and false_alarms_per_hour over all of them (run_length.h), starts an event; the CUSUM says when it
//    began.
// 3. From then on, features are averaged over the n samples since (at most `window` s, the latest). For every
//    hypothesis h
//      a_h = argmin of  chi2_h = sum over i of  r_i(features; h, a)^2/(sigma_i^2/n + floor_i^2 + error_i^2)
//    a squared Mahalanobis distance, by steps of the one screening (attribution/screening.h). Hypotheses are those of
//    the datasheet (attribution/fault_hypothesis.h), as far as balances see them. floor_i stands for what the balances
//    themselves get wrong, error_i for what more of it a change of operating point brings. The least chi2_h names the
//    fault; all within `rival` of it are told as
//    equivalent; a least chi2_h above `fit` per residual is an unknown fault.
// 4. Rivals that only the speed of their step tells apart (a warmed wall acts through the water's heat capacity, a
//    thermocouple's offset at once): once the window is nearly full, the first moments of the residual concerned are
//    held against its plateau.
// 5. A sensor's offset that grows in proportion to the time since the beginning is a drift; one that makes up for
//    every change, so that the sensor itself shows none, means that it is stuck.
// The finding is given at `confirm` samples if few hypotheses are left, else at `patience` s, and then as unknown if
// there are still many, or where its size is the largest that is allowed; not at all while nothing fits better than "no
// change" by `significance`. It is sharpened as samples come, kept while the rig is not armed, and ends `release_time`
// s after the last CUSUM fell below its threshold. One fault at a time: two at once are named as the one that fits
// best, or as unknown. A fault that is there from the start is learnt as normal, unless a reference learnt before is
// restored. Settings (signature_options.h): stage, model, armed_by, armed_above, learn, false_alarms_per_hour,
// noise_limit, window, confirm, patience, rival, significance, fit, relative_error (of a size, from tolerances),
// release_time; change_KIND and floor_KIND for each kind of residual of the model.
#pragma once

#include <cstddef>
#include <functional>

#include <Eigen/Core>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/cusum.h"
#include "faultline/isolation/balance_model.h"
#include "faultline/isolation/isolator.h"
#include "faultline/isolation/signature_options.h"
#include "faultline/isolation/size_course.h"
#include "faultline/signal/own_level.h"

namespace faultline {

class SignatureIsolator : public Isolator {
 public:
  SignatureIsolator(const Datasheet& sheet, const StageSpec& spec);
  // With other options than the datasheet's, for studies: `adjust` changes what was read.
  SignatureIsolator(const Datasheet& sheet, const StageSpec& spec,
                    const std::function<void(SignatureOptions&)>& adjust);

  void reset() override;
  void process(const Estimate& estimate, const std::vector<bool>& doubted, Finding& finding) override;
  bool finds_all_explained() const override { return learnt_ && armed_ && !event_; }
  // Balances are judged in steady operation, of which there must have been some.
  bool could_see() const override { return watched_ > kWatchedShare * rows_; }
  std::optional<Reference> reference() const override;
  void restore(const Reference& reference) override;

 private:
  struct Match {
    double size = 0, variance = 0, chi2 = 0;
    bool tried = false;
  };
  void begin(const Estimate& estimate);
  void forget_window();
  void learn();
  void learn_noise();
  void set_reference(const std::vector<double>& features);
  void set_thresholds();  // at the operating point of features_
  bool watch(const std::vector<bool>& doubted);
  void remember();
  void evaluate(double time, const std::vector<bool>& doubted, Finding& finding);
  void match(std::size_t h);
  double weighed(std::size_t h, double size);  // residuals into tried_; returns chi2
  void judge_course();
  double window_residual(std::size_t row, std::size_t from, std::size_t to);  // samples before now
  void tell(double time, Finding& finding);
  void tell_sensor(double time, const Hypothesis& h, double variance, Finding& finding);

  std::unique_ptr<BalanceModel> model_;
  std::vector<std::string> feature_names_, residual_names_;
  std::vector<std::vector<int>> residual_channels_;
  std::vector<Hypothesis> hypotheses_;
  Arming arming_;
  double period_;
  SignatureOptions options_;
  double samples_between_alarms_;

  bool started_ = false, learnt_ = false, armed_ = false, event_ = false;
  std::vector<std::size_t> at_;
  std::vector<double> restored_;  // mean features of a run before; empty: they are learnt
  std::vector<double> features_, sum_, reference_, residual_, noise_, error_, feature_noise_;
  std::vector<OwnLevel> own_noise_;        // of each feature, by its second differences
  std::vector<double> previous_, before_;  // features of the two samples before
  int in_a_row_ = 0;                       // steady samples without a gap
  bool noise_known_ = false;
  double rows_ = 0, watched_ = 0;  // samples, and those that were judged
  static constexpr double kWatchedShare = 0.05;
  std::vector<TwoSidedCusum> tests_;
  std::vector<bool> useless_, masked_;  // too noisy here; or resting on a doubted channel
  std::vector<double> ring_;            // running sums of the features, capacity_ rows
  std::size_t capacity_, head_ = 0, filled_ = 0;
  double learn_count_ = 0, onset_ = 0, raised_from_ = 0, last_beyond_ = 0;
  std::size_t age_ = 0;  // samples since the event began
  std::vector<double> mean_, window_mean_, weight_, tried_, ahead_, unchanged_;
  std::vector<Match> matches_;
  Eigen::MatrixXd step_ = Eigen::MatrixXd::Zero(2, 2);  // of one hypothesis' size, as best_size() takes it
  int named_ = -1;
  double course_ = -1;  // early residual over its plateau; -1: not judged yet
  bool course_known_ = false;
  double unexplained_ = 0;               // chi2 of no change
  SizeCourse sizes_;                     // of what is named
  double shown_ = 0, shown_square_ = 0;  // what the sensor itself showed, less its first
  double shown_first_ = 0;
};

}  // namespace faultline
