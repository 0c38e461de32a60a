#include "faultline/isolation/ranking_finding.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kExplained = 0.6;  // of the threshold: ResponseSettings::weighed_fraction
constexpr double kAtBound = 0.005;  // of the way from no effect to the bound
// Judgements in a row, that no longer belong to a good one. Of three stretches that are looked at together one leaves
// its trace in six.
constexpr std::size_t kUnexplained = 7;
// Of offsets that drift: sizes from which their course says it, without the first, for that comes of a stretch in which
// the drift began; the correlation with time; the part of the size that the ramp must make up.
constexpr std::size_t kDriftSizes = 3;
constexpr double kDriftStraight = 0.95, kDriftFraction = 0.5;
constexpr std::size_t kPlaces = 2;  // of a cause and what it cannot be told from, up to which another is told beside it
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
    held_ = all_explained_ = drifts_ = false;
    offset_port_.clear();
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
  finding.too_small.clear();
  // Beside a cause that cannot be large enough, what else is found makes up for the rest of it; beside one of several
  // places, it hangs on which of them it is.
  const bool of_first =
      options_.second && !ranked.empty() &&
      (!heard_->doubt.empty() || (!heard_->first.empty() && (at_bound(heard_->first.front()) || could_be_anywhere())));
  if (ranked.empty() || of_first) {
    offset_port_.clear();
    held_ = drifts_ = false;
    told_ = named_ = -1;
    finding.active = !options_.second && heard_->first.empty() && heard_->evidence > heard_->threshold;
    if (finding.active) tell_lost(finding);
    return;
  }
  if (!held_) {
    held_ = true;
    judgements_ = 0;
  }
  if (++judgements_ < options_.confirm_judgements) return;
  const RankedHypothesis& best = ranked.front();
  const double least = (finding.active ? kKeptShare : 1) * options_.least_fraction;
  too_small_ = heard_->doubt.empty() && too_small(best, least);
  finding.active = !too_small_;
  if (too_small_) {
    told_ = named_ = -1;
    // With as many digits as tell it from no effect.
    int digits = 3;
    while (digits < 6 && fmt::format("{:.{}g}", best.size(), digits) == fmt::format("{:.{}g}", best.none, digits))
      ++digits;
    finding.too_small = fmt::format("{}, {:.{}g}{}", best.name(), best.size(), digits,
                                    best.size_unit == "1" ? "" : " " + best.size_unit);
    return;
  }
  if (best.order == told_ && best.evidence == told_evidence_) return;
  if (drifts_ && heard_->doubt.empty() && best.port == finding.port && drifts_beyond(ranked)) return;
  told_ = best.order;
  told_evidence_ = best.evidence;
  follow_offset(ranked);
  finding.since = heard_->since;  // another cause may have begun at another time
  write(ranked, finding);
  tell_drift(finding);
}

bool RankingFinding::suspects(const Finding& finding) const {
  if (!heard_ || heard_->suspected.empty()) return false;
  const double evidence = heard_->suspected.front().evidence;
  return std::any_of(heard_->suspected.begin(), heard_->suspected.end(), [&](const RankedHypothesis& h) {
    return h.effect == finding.effect && h.port == finding.port && h.evidence >= evidence - margin(evidence);
  });
}

// The first cannot be told from others at two places or more.
bool RankingFinding::could_be_anywhere() const {
  const std::vector<RankedHypothesis>& first = heard_->first;
  std::set<std::string> places;
  for (const RankedHypothesis& h : first)
    if (h.evidence >= first.front().evidence - margin(first.front().evidence)) places.insert(h.port);
  return places.size() > kPlaces;
}

double RankingFinding::margin(double evidence) const {
  return std::max(options_.rival_fraction * evidence, options_.rival_evidence);
}

// There is as much to explain as a fault takes, and no cause.
void RankingFinding::tell_lost(Finding& finding) const {
  finding.kind = AlarmKind::unknown;
  finding.effect = finding.port = "";
  finding.equivalent.clear();
  finding.has_size = false;
  finding.confidence = 1;
  finding.since = heard_->since;
  finding.text = "Something changed, and none of the effects that are weighed explains it";
}

// Of the transducer whose offset explains most, be it named or not: which of several causes it is may show late.
void RankingFinding::follow_offset(const std::vector<RankedHypothesis>& ranked) {
  const auto offset = std::find_if(ranked.begin(), ranked.end(), [](const RankedHypothesis& h) {
    return h.effect == "offset" && port_kind(h.port) == PortKind::sensor;
  });
  const std::string port = offset == ranked.end() ? "" : offset->port;
  if (port != offset_port_) {
    offset_port_ = port;
    offsets_.clear();
    return;
  }
  // One that was not found anew says nothing.
  if (!port.empty() && (offsets_.count() == 0 || offset->size() != offsets_.latest()))
    offsets_.add(judged_, offset->size());
}

void RankingFinding::tell_drift(Finding& finding) {
  const auto port = ports_.find(finding.port);
  drifts_ = false;
  if (finding.effect != "offset" || port == ports_.end() || finding.port != offset_port_) return;
  const std::vector<FittingEffect>& may = port->second.effects;
  if (std::none_of(may.begin(), may.end(), [](const FittingEffect& e) { return e.effect == "drift"; })) return;
  if (offsets_.count() < kDriftSizes || !offsets_.straight(kDriftStraight)) return;
  const double rate = offsets_.rate();
  if (std::abs(rate) * (judged_ - finding.since) < kDriftFraction * std::abs(finding.size)) return;
  drifts_ = true;
  finding.effect = "drift";
  finding.size_name = "rate";
  finding.size_unit += "/s";
  finding.none = 0;
  finding.size = rate;
  const double std = std::hypot(offsets_.rate_std(), options_.model_error_fraction * rate);
  finding.low = rate - kNinetyPercentSigmas * std;
  finding.high = rate + kNinetyPercentSigmas * std;
  // What else is constant there does not drift, and of two transducers either one may.
  auto& others = finding.equivalent;
  const auto here = [&](const std::string& other) { return other.substr(other.find('@') + 1) == finding.port; };
  others.erase(std::remove_if(others.begin(), others.end(), here), others.end());
  for (std::string& other : others)
    if (other.rfind("offset@sensor.", 0) == 0) other = "drift" + other.substr(other.find('@'));
  finding.text = text(finding.port, "drift");
  if (!others.empty()) finding.text += fmt::format("; this motion cannot tell it from {}", fmt::join(others, ", "));
}

void RankingFinding::write(const std::vector<RankedHypothesis>& ranked, Finding& finding) {
  const double evidence = ranked.front().evidence;
  const double margin = this->margin(evidence);
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
  std::map<std::string, double> likelihoods;  // by port, of the best there
  std::set<std::string> ports = {chosen->port};
  for (const RankedHypothesis& other : ranked) {
    const double behind = evidence - other.evidence;
    double& likelihood = likelihoods[other.port];
    likelihood = std::max(likelihood, std::exp(-0.5 * behind));
    if (&other == chosen) continue;
    if (behind > margin || other.name() == chosen->name()) continue;
    ports.insert(other.port);
    if (std::find(finding.equivalent.begin(), finding.equivalent.end(), other.name()) == finding.equivalent.end())
      finding.equivalent.push_back(other.name());
  }
  double sum = 0;
  for (const auto& of_port : likelihoods) sum += of_port.second;
  finding.confidence = std::min(likelihoods[chosen->port] / sum, 1 / static_cast<double>(ports.size()));
  finding.text = text(chosen->port, chosen->effect);
  const std::string rivals = fmt::format("{}", fmt::join(finding.equivalent, ", "));
  if (!rivals.empty()) finding.text += "; this motion cannot tell it from " + rivals;
  if (finding.equivalent.size() > options_.most_rivals) {
    finding.kind = AlarmKind::unknown;
    finding.effect = finding.port = "";
    finding.text = "Something changed; candidates: " + chosen->name() + ", " + rivals;
    finding.equivalent.insert(finding.equivalent.begin(), chosen->name());
  }
  if (!heard_->doubt.empty()) {
    const bool stuck = !heard_->stuck.empty();
    const auto stuck_at = ports_.find(heard_->stuck);
    const bool command = stuck_at != ports_.end() && stuck_at->second.kind == PortKind::command;
    finding.kind = !stuck ? AlarmKind::data : command ? AlarmKind::fault : AlarmKind::sensor;
    finding.effect = stuck ? "stuck" : "";
    finding.port = heard_->stuck;
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
  finding.has_size = !finding.effect.empty() && heard_->stuck.empty();
  finding.size_name = chosen->size_name;
  finding.size_unit = chosen->size_unit;
  finding.none = chosen->none;
  finding.size = chosen->size();
  const SizeInterval sizes =
      chosen->sizes(std::hypot(options_.std_ratio * chosen->std, options_.model_error_fraction * chosen->amplitude));
  finding.low = sizes.low;
  finding.high = sizes.high;
}

// What drifts leaves the range of its offset behind, where others at its place follow it for a while.
bool RankingFinding::drifts_beyond(const std::vector<RankedHypothesis>& ranked) const {
  return std::all_of(ranked.begin(), ranked.end(), [&](const RankedHypothesis& h) {
    return h.port != offset_port_ || h.effect != "offset" || at_bound(h);
  });
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

std::string RankingFinding::text(const std::string& port, const std::string& effect) const {
  const auto found = ports_.find(port);
  std::string component = found == ports_.end() ? port : found->second.component;
  if (!component.empty()) component[0] = static_cast<char>(std::toupper(component[0]));
  return component + ": " + spaced(effect);
}

}  // namespace faultline
