// Isolation by responses: names the fault whose effect on the rig's model explains what is measured
// (estimators/fault_responses.h does the work in a stage of its own; this tells its answer).
//
// Finding: the hypothesis of most evidence in the stage's ranking (estimate.h), from the `confirm`-th judgement in a
// row that finds something. What explains within `rival` of that evidence (a fraction, and never less than
// `rival_least`) cannot be told from it and is listed as equivalent; if more than `most_rivals` are, the fault is
// unknown. Size with 90 % bounds from the ranking's standard deviation and `model_error` (relative: what tolerances
// leave). The evidence's variances are inflated to decide with care; `std_factor` takes that back for the bounds. Where
// it has an answer, it stands against the detectors' (isolator.h).
// Settings: stage, place (1: the fault; 2: what is wrong beside it), confirm [1], rival, rival_least, most_rivals,
// model_error, std_factor [1]. Throws InputError where the stage gives no ranking.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

#include "faultline/isolation/isolator.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

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
      : where_(spec.settings.where()), options_(read_options(spec.settings)) {
    spec.settings.word_or("stage", "");
    for (const Port& port : sheet.ports) components_[port.name] = port.component;
  }

  void reset() override { heard_.reset(); }
  bool overrules() const override { return !options_.second; }
  double judged_until() const override { return judged_; }

  void process(const Estimate& estimate, const std::vector<bool>&, Finding& finding) override {
    if (!estimate.ranking) {
      // An estimate without channels is that of a stage that has not spoken yet.
      if (estimate.channel_status.empty()) return;
      throw InputError(where_ +
                       ": this isolator reads a ranking, which its stage does not give; name one as 'stage' that does");
    }
    if (heard_ && !estimate.restarted && estimate.ranking->judged_until == judged_) return;  // nothing new
    if (!heard_ || estimate.restarted) {
      finding = Finding();
      told_ = named_ = -1;
      held_ = false;
    }
    heard_ = estimate.ranking;
    judged_ = heard_->judged_until;
    const std::vector<RankedHypothesis>& ranked = options_.second ? heard_->second : heard_->first;
    if (ranked.empty()) {
      finding.active = held_ = false;
      told_ = named_ = -1;
      return;
    }
    if (!held_) {
      held_ = true;
      judgements_ = 0;
      finding.since = heard_->since;
    }
    if (++judgements_ < options_.confirm_judgements) return;
    finding.active = true;
    const RankedHypothesis& best = ranked.front();
    if (best.order == told_ && best.evidence == told_evidence_) return;
    told_ = best.order;
    told_evidence_ = best.evidence;
    tell(ranked, finding);
  }

 private:
  void tell(const std::vector<RankedHypothesis>& ranked, Finding& finding) {
    const double evidence = ranked.front().evidence;
    const double margin = std::max(options_.rival_fraction * evidence, options_.rival_evidence);
    // A name that explains as well as the best stays.
    const RankedHypothesis* chosen = &ranked.front();
    for (const RankedHypothesis& h : ranked)
      if (h.order == named_ && h.evidence >= evidence - margin) chosen = &h;
    // Twins at one place go by the name that the datasheet lists first.
    const std::string port = chosen->port;
    for (const RankedHypothesis& h : ranked)
      if (h.evidence >= evidence - margin && h.order < chosen->order && h.port == port) chosen = &h;
    named_ = chosen->order;
    finding.effect = chosen->effect;
    finding.port = chosen->port;
    finding.kind = chosen->kind;
    finding.equivalent.clear();
    double sum = 1;
    for (const RankedHypothesis& other : ranked) {
      if (&other == chosen) continue;
      const double behind = evidence - other.evidence;
      sum += std::exp(-0.5 * behind);
      if (behind > margin || other.name() == chosen->name()) continue;
      if (std::find(finding.equivalent.begin(), finding.equivalent.end(), other.name()) == finding.equivalent.end())
        finding.equivalent.push_back(other.name());
    }
    finding.confidence = 1 / std::max(sum, static_cast<double>(finding.equivalent.size()) + 1);
    finding.text = text(*chosen);
    std::string rivals;
    for (const std::string& name : finding.equivalent) rivals += (rivals.empty() ? "" : ", ") + name;
    if (!rivals.empty()) finding.text += "; this motion cannot tell it from " + rivals;
    if (finding.equivalent.size() > options_.most_rivals) {
      finding.kind = AlarmKind::unknown;
      finding.effect = finding.port = "";
      finding.text = "Something changed that this motion cannot tell apart: " + chosen->name() + ", " + rivals;
    }
    finding.has_size = finding.kind != AlarmKind::unknown;
    finding.size_name = chosen->size_name;
    finding.size_unit = chosen->size_unit;
    finding.none = chosen->none;
    finding.size = chosen->size();
    const SizeInterval sizes =
        chosen->sizes(std::hypot(options_.std_ratio * chosen->std, options_.model_error_fraction * chosen->amplitude));
    finding.low = sizes.low;
    finding.high = sizes.high;
  }

  std::string text(const RankedHypothesis& h) const {
    const auto found = components_.find(h.port);
    std::string component = found == components_.end() ? h.port : found->second;
    if (!component.empty()) component[0] = static_cast<char>(std::toupper(component[0]));
    return component + ": " + spaced(h.effect);
  }

  std::string where_;
  std::map<std::string, std::string> components_;  // of the ports
  ResponseIsolatorOptions options_;
  std::shared_ptr<const Ranking> heard_;  // the last
  double judged_ = -std::numeric_limits<double>::infinity();
  bool held_ = false;
  std::size_t judgements_ = 0;
  double told_evidence_ = 0;
  std::int64_t told_ = -1, named_ = -1;  // RankedHypothesis::order; -1: none
};

FAULTLINE_ISOLATOR(response, {"response", make_isolator_of<ResponseIsolator>});

}  // namespace
}  // namespace faultline
