// Isolation by responses: names the fault whose effect on the rig's model explains what is measured
// (estimators/fault_responses.h does the work in a stage of its own; this tells its answer).
//
// Finding: the hypothesis of most evidence, from the `confirm`-th judgement in a row that finds something. What
// explains within `rival` of that evidence (a fraction, and never less than `rival_least`) cannot be told from it and
// is listed as equivalent; if more than `most_rivals` are, the fault is unknown. Size with 90 % bounds from the
// curvature of the evidence and `model_error` (relative: what tolerances leave). The evidence's variances are
// inflated to decide with care; `std_factor` takes that back for the bounds. Where it has an answer, it stands
// against the detectors' (isolator.h). Settings: stage, place (1: the fault; 2: what is wrong beside it), confirm
// [1], rival, rival_least, most_rivals, model_error, std_factor [1].
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/detectors/detector.h"
#include "faultline/estimators/fault_hypothesis.h"
#include "faultline/estimators/response_core.h"
#include "faultline/isolation/isolator.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kNinetyPercent = 1.645;

// All constants, by the datasheet's keys; it says why they have their values.
struct ResponseIsolatorOptions {
  bool second = false;                 // place: 2 tells what is wrong beside the fault
  std::size_t confirm_judgements = 1;  // confirm: in a row that find something
  double rival_fraction = 0;           // rival: of the evidence, within which hypotheses cannot be told apart ...
  double rival_evidence = 0;           // rival_least: ... and at least this
  std::size_t most_rivals = 0;         // beyond which naming the best would say nothing
  double model_error_fraction = 0;     // model_error: of an amplitude, from the tolerances
  double std_ratio = 1;                // std_factor: of the bounds' standard deviation to the inflated one
};

ResponseIsolatorOptions read_options(const Settings& s) {
  ResponseIsolatorOptions o;
  o.second = s.number_or("place", 1, 1, 2) > 1.5;
  o.confirm_judgements = static_cast<std::size_t>(std::ceil(s.number_or("confirm", 1, 1, 1e6)));
  o.rival_fraction = s.number("rival", 0, 1);
  o.rival_evidence = s.number("rival_least", 0, 1e6);
  o.most_rivals = static_cast<std::size_t>(s.number("most_rivals", 0, 100));
  o.model_error_fraction = s.number("model_error", 0, 10);
  o.std_ratio = s.number_or("std_factor", 1, 0.01, 10);
  return o;
}

std::string spaced(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

class ResponseIsolator : public Isolator {
 public:
  ResponseIsolator(const Datasheet& sheet, const StageSpec& spec)
      : hypotheses_(fault_hypotheses(sheet)),
        options_(read_options(spec.settings)),
        new_judgement_s_(0.5 * sheet.sample_period) {
    spec.settings.word_or("stage", "");
    for (const FaultHypothesis& h : hypotheses_) {
      std::string component = sheet.port(h.port).component;
      if (!component.empty()) component[0] = static_cast<char>(std::toupper(component[0]));
      texts_.push_back(component + ": " + spaced(h.effect));
    }
  }

  void reset() override { at_.clear(); }
  bool overrules() const override { return !options_.second; }
  double judged_until() const override { return judged_; }

  void process(const Estimate& estimate, const std::vector<bool>&, Finding& finding) override {
    // The stage speaks only when there is something new.
    if (estimate.quantities.empty() || (!at_.empty() && estimate.sequence == sequence_ && estimate.time == time_))
      return;
    sequence_ = estimate.sequence;
    time_ = estimate.time;
    if (at_.empty() || estimate.restarted) {
      look_up(estimate);
      finding = Finding();
      told_ = named_ = -1;
      held_ = false;
      judged_ = -kInfinity;
    }
    // A stage that speaks at every sample repeats its last judgement.
    const double judged = estimate.time - estimate.quantities[judged_at_].value;
    const bool judged_anew = judged > judged_ + new_judgement_s_;
    judged_ = judged;
    const double best = estimate.quantities[at_[0]].value;
    if (best < 0) {
      finding.active = held_ = false;
      told_ = named_ = -1;
      return;
    }
    const double evidence = estimate.quantities[at_[2]].value;
    if (!held_) {
      held_ = true;
      judgements_ = 0;
      finding.since = estimate.time - estimate.quantities[since_at_].value;
    }
    judgements_ += judged_anew;
    if (judgements_ < options_.confirm_judgements) return;
    finding.active = true;
    if (best == told_ && evidence == told_evidence_) return;  // nothing new
    told_ = best;
    told_evidence_ = evidence;
    tell(estimate, evidence, finding);
  }

 private:
  void look_up(const Estimate& estimate) {
    at_.clear();
    for (int k = 0; k < (options_.second ? kRankedSecond : kRankedFirst); ++k)
      for (const char* what : {"hypothesis", "amplitude", "evidence"})
        at_.push_back(find_quantity(estimate, ranked_name(options_.second, k, what)));
    since_at_ = find_quantity(estimate, "since");
    judged_at_ = find_quantity(estimate, "judged");
  }

  void tell(const Estimate& estimate, double evidence, Finding& finding) {
    const auto value = [&](std::size_t place, std::size_t what) -> const Quantity& {
      return estimate.quantities[at_[3 * place + what]];
    };
    // A name that explains as well as the best stays.
    std::size_t chosen = 0;
    const double tied = evidence - std::max(options_.rival_fraction * evidence, options_.rival_evidence);
    for (std::size_t k = 1; 3 * k < at_.size(); ++k)
      if (value(k, 0).value >= 0 && value(k, 0).value == named_ && value(k, 2).value >= tied) chosen = k;
    // Twins at one place go by the name that the datasheet lists first.
    const auto port_of = [&](std::size_t k) {
      return hypotheses_.at(static_cast<std::size_t>(value(k, 0).value)).port;
    };
    const std::string port = port_of(chosen);
    for (std::size_t k = 0; 3 * k < at_.size() && value(k, 0).value >= 0; ++k)
      if (value(k, 2).value >= tied && value(k, 0).value < value(chosen, 0).value && port_of(k) == port) chosen = k;
    named_ = value(chosen, 0).value;
    const FaultHypothesis& h = hypotheses_.at(static_cast<std::size_t>(named_));
    finding.effect = h.effect;
    finding.port = h.port;
    finding.kind = h.kind;
    finding.equivalent.clear();
    double sum = 1;
    for (std::size_t k = 0; 3 * k < at_.size() && value(k, 0).value >= 0; ++k) {
      if (k == chosen) continue;
      const double behind = evidence - value(k, 2).value;
      sum += std::exp(-0.5 * behind);
      const FaultHypothesis& other = hypotheses_.at(static_cast<std::size_t>(value(k, 0).value));
      if (behind > std::max(options_.rival_fraction * evidence, options_.rival_evidence) || other.name() == h.name())
        continue;
      if (std::find(finding.equivalent.begin(), finding.equivalent.end(), other.name()) == finding.equivalent.end())
        finding.equivalent.push_back(other.name());
    }
    finding.confidence = 1 / std::max(sum, static_cast<double>(finding.equivalent.size()) + 1);
    finding.text = texts_[static_cast<std::size_t>(named_)];
    std::string rivals;
    for (const std::string& name : finding.equivalent) rivals += (rivals.empty() ? "" : ", ") + name;
    if (!rivals.empty()) finding.text += "; this motion cannot tell it from " + rivals;
    if (finding.equivalent.size() > options_.most_rivals) {
      finding.kind = "unknown";
      finding.effect = finding.port = "";
      finding.text = "Something changed that this motion cannot tell apart: " + h.name() + ", " + rivals;
    }
    const double amplitude = value(chosen, 1).value;
    const double std = std::hypot(options_.std_ratio * value(chosen, 1).std, options_.model_error_fraction * amplitude);
    finding.has_size = finding.kind != "unknown";
    finding.size_name = h.size_name;
    finding.size_unit = h.size_unit;
    finding.size = h.size(amplitude);
    const double one = h.size(
                     std::max(amplitude - kNinetyPercent * std, std::isinf(h.none) ? 1e-3 * amplitude : h.lowest)),
                 other = h.size(amplitude + kNinetyPercent * std);
    finding.low = std::min(one, other);
    finding.high = std::max(one, other);
  }

  std::vector<FaultHypothesis> hypotheses_;
  std::vector<std::string> texts_;
  ResponseIsolatorOptions options_;
  double new_judgement_s_;  // by which the end of a judged stretch must be later than the last
  std::vector<std::size_t> at_;
  std::uint64_t sequence_ = 0;
  double time_ = 0;  // s, of the last estimate
  std::size_t since_at_ = 0, judged_at_ = 0;
  double judged_ = -kInfinity;
  bool held_ = false;
  std::size_t judgements_ = 0;
  double told_ = -1, told_evidence_ = 0, named_ = -1;
};

FAULTLINE_ISOLATOR(response,
                   {"response", [](const Datasheet& sheet, const StageSpec& spec) -> std::unique_ptr<Isolator> {
                      return std::make_unique<ResponseIsolator>(sheet, spec);
                    }});

}  // namespace
}  // namespace faultline
