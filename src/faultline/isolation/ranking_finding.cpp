#include "faultline/isolation/ranking_finding.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kExplained = 0.6;  // of the threshold: ResponseSettings::weighed_fraction
constexpr double kAtBound = 0.005;  // of the way from no effect to the bound
// Judgements in a row, that no longer belong to a good one. Of three stretches that are looked at together one leaves
// its trace in six.
constexpr std::size_t kUnexplained = 7;
constexpr double kKeptShare = 0.5;  // of the least size that is told, down to which it stays told

RankingOptions read_options(const Settings& s) {
  RankingOptions o;
  o.second = s.number_or("place", 1, 1, 2) > 1.5;
  o.confirm_judgements = static_cast<std::size_t>(std::ceil(s.number_or("confirm", 1, 1, 1e6)));
  o.rival_fraction = s.number("rival", 0, 1);
  o.rival_evidence = s.number("rival_least", 0, 1e6);
  o.most_rivals = static_cast<std::size_t>(s.number("most_rivals", 0, 100));
  o.model_error_fraction = s.number("model_error", 0, 10);
  o.std_ratio = s.number_or("std_factor", 1, 0.01, 10);
  o.least_fraction = s.number_or("least_share", 0, 0, 1);
  return o;
}

std::string spaced(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

}  // namespace

RankingFinding::RankingFinding(const Datasheet& sheet, const Settings& settings) : options_(read_options(settings)) {
  for (const Port& port : sheet.ports) ports_[port.name] = port;
}

void RankingFinding::tell(const std::shared_ptr<const Ranking>& ranking, bool restarted, Finding& finding) {
  if (heard_ && !restarted && ranking->judged_until == judged_) return;  // nothing new
  if (!heard_ || restarted) {
    finding = Finding();
    told_ = named_ = -1;
    held_ = all_explained_ = false;
  }
  heard_ = ranking;
  judged_ = heard_->judged_until;
  weigh(finding);
  const bool no_cause = heard_->first.empty() && heard_->doubt.empty();
  const bool explained = too_small_ || (no_cause && heard_->evidence < kExplained * heard_->threshold);
  unexplained_ = explained ? 0 : unexplained_ + 1;
  all_explained_ = explained || (all_explained_ && no_cause && unexplained_ < kUnexplained);
}

void RankingFinding::weigh(Finding& finding) {
  const std::vector<RankedHypothesis>& ranked = options_.second ? heard_->second : heard_->first;
  too_small_ = false;
  if (ranked.empty() || (options_.second && !heard_->doubt.empty())) {
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
  const RankedHypothesis& best = ranked.front();
  const double least = (finding.active ? kKeptShare : 1) * options_.least_fraction;
  too_small_ = heard_->doubt.empty() && too_small(best, least);
  finding.active = !too_small_;
  if (too_small_) {
    told_ = named_ = -1;
    return;
  }
  if (best.order == told_ && best.evidence == told_evidence_) return;
  told_ = best.order;
  told_evidence_ = best.evidence;
  write(ranked, finding);
}

void RankingFinding::write(const std::vector<RankedHypothesis>& ranked, Finding& finding) {
  const double evidence = ranked.front().evidence;
  const double margin = std::max(options_.rival_fraction * evidence, options_.rival_evidence);
  // A name that explains as well as the best stays; one at its bound gives way to one that is not.
  const auto counts = [&](const RankedHypothesis& h) { return h.evidence >= evidence - margin && !at_bound(h); };
  const auto first = std::find_if(ranked.begin(), ranked.end(), counts);
  const RankedHypothesis* chosen = first == ranked.end() ? &ranked.front() : &*first;
  for (const RankedHypothesis& h : ranked)
    if (h.order == named_ && (counts(h) || (first == ranked.end() && h.evidence >= evidence - margin))) chosen = &h;
  // Twins at one place go by the name that the datasheet lists first.
  const std::string port = chosen->port;
  for (const RankedHypothesis& h : ranked)
    if (counts(h) && h.order < chosen->order && h.port == port) chosen = &h;
  named_ = chosen->order;
  finding.effect = chosen->effect;
  finding.port = chosen->port;
  finding.kind = chosen->kind;
  finding.equivalent.clear();
  double here = 0, sum = 0;  // likelihoods
  std::set<std::string> ports = {chosen->port};
  for (const RankedHypothesis& other : ranked) {
    const double behind = evidence - other.evidence;
    const double likelihood = std::exp(-0.5 * behind);
    sum += likelihood;
    if (other.port == chosen->port) here += likelihood;
    if (&other == chosen) continue;
    if (behind > margin || other.name() == chosen->name()) continue;
    ports.insert(other.port);
    if (std::find(finding.equivalent.begin(), finding.equivalent.end(), other.name()) == finding.equivalent.end())
      finding.equivalent.push_back(other.name());
  }
  finding.confidence = std::min(here / sum, 1 / static_cast<double>(ports.size()));
  finding.text = text(*chosen);
  std::string rivals;
  for (const std::string& name : finding.equivalent) rivals += (rivals.empty() ? "" : ", ") + name;
  if (!rivals.empty()) finding.text += "; this motion cannot tell it from " + rivals;
  if (finding.equivalent.size() > options_.most_rivals) {
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text = "Something changed; candidates: " + chosen->name() + ", " + rivals;
    finding.equivalent.insert(finding.equivalent.begin(), chosen->name());
  }
  if (!heard_->doubt.empty()) {
    finding.kind = AlarmKind::data;
    finding.effect = finding.port = "";
    finding.equivalent.clear();
    finding.text = heard_->doubt;
  } else if (finding.kind != AlarmKind::unknown && at_bound(*chosen)) {
    finding.equivalent.insert(finding.equivalent.begin(), chosen->name());
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text =
        fmt::format("No fault of the datasheet explains it; nearest is {} at its largest {}, {:.3g}{}", chosen->name(),
                    chosen->size_name, chosen->size(), chosen->size_unit == "1" ? "" : " " + chosen->size_unit);
  }
  finding.has_size = !finding.effect.empty();
  finding.size_name = chosen->size_name;
  finding.size_unit = chosen->size_unit;
  finding.none = chosen->none;
  finding.size = chosen->size();
  const SizeInterval sizes =
      chosen->sizes(std::hypot(options_.std_ratio * chosen->std, options_.model_error_fraction * chosen->amplitude));
  finding.low = sizes.low;
  finding.high = sizes.high;
}

const Bounds* RankingFinding::bounds_of(const RankedHypothesis& h) const {
  const auto port = ports_.find(h.port);
  if (port == ports_.end()) return nullptr;
  for (const FittingEffect& effect : port->second.effects) {
    const auto found = effect.effect == h.effect ? effect.bounds.find(h.size_name) : effect.bounds.end();
    if (found != effect.bounds.end()) return &found->second;
  }
  return nullptr;
}

bool RankingFinding::at_bound(const RankedHypothesis& h) const {
  const Bounds* b = bounds_of(h);
  if (b == nullptr) return false;
  if (std::isinf(h.none)) return h.size() <= (1 + kAtBound) * b->minimum;
  const auto reaches = [&](double bound) { return std::abs(h.size() - bound) <= kAtBound * std::abs(bound - h.none); };
  return (b->maximum > h.none && reaches(b->maximum)) || (b->minimum < h.none && reaches(b->minimum));
}

bool RankingFinding::too_small(const RankedHypothesis& h, double least_fraction) const {
  const Bounds* b = bounds_of(h);
  if (b == nullptr || std::isinf(h.none)) return false;
  const double way = h.size() - h.none, whole = (way > 0 ? b->maximum : b->minimum) - h.none;
  return std::abs(way) < least_fraction * std::abs(whole);
}

std::string RankingFinding::text(const RankedHypothesis& h) const {
  const auto found = ports_.find(h.port);
  std::string component = found == ports_.end() ? h.port : found->second.component;
  if (!component.empty()) component[0] = static_cast<char>(std::toupper(component[0]));
  return component + ": " + spaced(h.effect);
}

}  // namespace faultline
