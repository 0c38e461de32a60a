// From a ranking of causes (estimators/estimate.h) to a finding: what is named, what cannot be told from it, of which
// size. Of every isolator that ranks.
//
// Finding: the hypothesis of most evidence, from the `confirm`-th judgement in a row that finds something. What
// explains within `rival` of that evidence (a fraction, and never less than `rival_least`) cannot be told from it
// and is listed as equivalent; if more than `most_rivals` are, the fault is unknown and all of them are candidates. So
// it is where the size lies at the largest that the datasheet allows: what goes beyond is something else, or more than
// one thing. Where the ranking doubts a channel, that is told instead, as trouble of the data. A size below
// `least_share` of its range is not told, for rigs in good order have as much; what is told stays down to half of that.
// Confidence: that the trouble is at that port, by the evidence of all; never more than one over the ports among what
// cannot be told apart. Size with 90 % bounds from the ranking's standard deviation and `model_error` (relative: what
// tolerances leave). The evidence's variances are inflated to decide with care; `std_factor` takes that back for the
// bounds.
// An offset of a transducer that grows in proportion to time from judgement to judgement is told as a drift, with its
// rate, where the datasheet has one there, and stays one beyond the largest offset.
// Settings: place (1: the fault; 2: what is wrong beside it), confirm [1], rival, rival_least, most_rivals,
// model_error, std_factor [1], least_share [0].
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/isolation/isolator.h"
#include "faultline/isolation/size_course.h"

namespace faultline {

// All constants, by the datasheet's keys; it says why they have their values.
struct RankingOptions {
  bool second = false;                 // place: 2 tells what is wrong beside the fault
  std::size_t confirm_judgements = 1;  // confirm: in a row that find something
  double rival_fraction = 0;           // rival: of the evidence, within which hypotheses cannot be told apart ...
  double rival_evidence = 0;           // rival_least: ... and at least this
  std::size_t most_rivals = 0;         // beyond which naming the best would say nothing
  double model_error_fraction = 0;     // model_error: of an amplitude, from the tolerances
  double std_ratio = 1;                // std_factor: of the bounds' standard deviation to the inflated one
  double least_fraction = 0;           // least_share: of the way from no effect to the datasheet's bound
};

class RankingFinding {
 public:
  RankingFinding(const Datasheet& sheet, const Settings& settings);

  void reset() {
    heard_.reset();
    all_explained_ = false;
  }
  // `restarted`: what was heard before belongs to another course.
  void tell(const std::shared_ptr<const Ranking>& ranking, bool restarted, Finding& finding);
  bool second() const { return options_.second; }
  double judged_until() const { return judged_; }
  bool could_see() const { return heard_ && heard_->shows; }
  // Evidence enough for a fault, but none that was confirmed; NaN: no such.
  double undecided_since() const {
    const bool undecided = heard_ && heard_->first.empty() && heard_->evidence >= heard_->threshold;
    return undecided ? judged_ : std::numeric_limits<double>::quiet_NaN();
  }
  // What it finds is among what would be found now, if it is confirmed.
  bool suspects(const Finding& finding) const;
  // Nothing is wrong, or less than is told, and no cause could win as much evidence as makes them worth weighing. While
  // none is named, one stretch that leaves more does not end it: three judgements in a row do.
  bool all_explained() const { return all_explained_; }

 private:
  void weigh(Finding& finding);
  void write(const std::vector<RankedHypothesis>& ranked, Finding& finding);
  void follow_offset(const std::vector<RankedHypothesis>& ranked);
  void tell_drift(Finding& finding);
  void tell_lost(Finding& finding) const;
  bool could_be_anywhere() const;
  double margin(double evidence) const;  // within which others explain as well
  bool drifts_beyond(const std::vector<RankedHypothesis>& ranked) const;
  std::string text(const std::string& port, const std::string& effect) const;
  const Bounds* bounds_of(const RankedHypothesis& h) const;  // of its size, in the datasheet; nullptr: none
  bool at_bound(const RankedHypothesis& h) const;
  bool too_small(const RankedHypothesis& h, double least_fraction) const;

  std::map<std::string, Port> ports_;
  RankingOptions options_;
  std::shared_ptr<const Ranking> heard_;  // the last
  double judged_ = -std::numeric_limits<double>::infinity();
  bool held_ = false, too_small_ = false, all_explained_ = false;
  std::size_t judgements_ = 0, unexplained_ = 0;
  double told_evidence_ = 0;
  std::string offset_port_;
  SizeCourse offsets_;  // there
  bool drifts_ = false;
  std::int64_t told_ = -1, named_ = -1;  // RankedHypothesis::order; -1: none
};

}  // namespace faultline
