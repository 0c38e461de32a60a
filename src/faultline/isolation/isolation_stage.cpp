#include "faultline/isolation/isolation_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

// s, after which a detector that does not say when it can judge has judged.
constexpr double kLongEnough = 5;
// Of the run, that an isolator must have judged: one that suspects something from the start on has judged nothing.
constexpr double kJudgedShare = 0.1;

std::size_t stage_of(const Datasheet& sheet, const StageSpec& spec) {
  return spec.settings.has("stage") ? sheet.estimator(spec.settings.word("stage")) : 0;
}

bool yes_or_no(const StageSpec& spec, const std::string& key, bool fallback) {
  const std::string word = spec.settings.word_or(key, fallback ? "yes" : "no");
  if (word != "yes" && word != "no")
    throw InputError(fmt::format("{}: '{}' is '{}'; it must be yes or no", spec.settings.where(), key, word));
  return word == "yes";
}

// s, within which a detector may see a cause before the time that an isolator finds for it.
constexpr double kSameOnset = 1;

std::string named(const std::string& effect, const std::string& port) { return effect + "@" + port; }

// Intervals between judgements of an isolator that weighs all effects, for which one that knows a few causes waits at
// most: some judge a stretch only after a pause.
constexpr double kPatience = 3;

bool among(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

Finding meaning_of(const StageSpec& detector) {
  Finding meaning;
  meaning.kind = parse_alarm_kind(detector.settings.word("kind"), detector.settings.where());
  meaning.effect = detector.settings.word_or("effect", "");
  meaning.port = detector.settings.word_or("port", "");
  meaning.text = detector.settings.word("text");
  return meaning;
}

IsolationStage::IsolationStage(const Datasheet& sheet)
    : sheet_(sheet), channels_(sheet), doubted_(sheet.channels.size(), false) {
  for (const StageSpec& spec : sheet_.detectors) {
    Watched w;
    w.meaning = meaning_of(spec);
    w.named = named(w.meaning.effect, w.meaning.port);
    w.stage = stage_of(sheet_, spec);
    w.of_transducer = w.meaning.kind == AlarmKind::sensor || w.meaning.kind == AlarmKind::data;
    w.withholds = w.meaning.kind == AlarmKind::unknown && yes_or_no(spec, "withholds_faults", true);
    for (const Port& port : sheet_.ports)
      w.of_output =
          w.of_output || (port.name == w.meaning.port && port.kind == PortKind::sensor &&
                          sheet_.channels[static_cast<std::size_t>(sheet_.channel(port.channel))].role == Role::output);
    if (w.meaning.kind == AlarmKind::sensor)
      for (const Port& port : sheet_.ports)
        if (port.name == w.meaning.port && port.kind == PortKind::sensor)
          w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(port.channel)));
    for (const std::string& channel : split_words(spec.settings.word_or("doubts", "")))
      w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(channel)));
    w.detector = make_detector(sheet_, spec);
    spec.settings.word_or("stands_under", "");
    spec.settings.check_used();
    watched_.push_back(std::move(w));
    assessment_.detectors.emplace_back();
    assessment_.detectors.back().name = spec.name;
  }
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    const Settings& settings = sheet_.detectors[k].settings;
    const std::string under = settings.word_or("stands_under", "");
    if (under.empty()) continue;
    const auto at = std::find_if(sheet_.detectors.begin(), sheet_.detectors.end(),
                                 [&](const StageSpec& spec) { return spec.name == under; });
    if (at == sheet_.detectors.end())
      throw InputError(fmt::format("{}: stands_under: there is no detector '{}'", settings.where(), under));
    watched_[k].under = static_cast<int>(at - sheet_.detectors.begin());
  }
  for (const StageSpec& spec : sheet_.isolators) {
    Isolated isolated;
    isolated.stage = stage_of(sheet_, spec);
    isolated.isolator = make_isolator(sheet_, spec);
    weighs_all_ = weighs_all_ || isolated.isolator->overrules();
    spec.settings.check_used();
    isolated_.push_back(std::move(isolated));
    assessment_.isolators.emplace_back();
    assessment_.isolators.back().name = spec.name;
  }
}

void IsolationStage::reset() {
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    Watched& w = watched_[k];
    w.detector->reset();
    w.stands = w.raised = false;
    DetectorResult fresh;
    fresh.name = std::move(assessment_.detectors[k].name);
    assessment_.detectors[k] = std::move(fresh);
  }
  for (std::size_t k = 0; k < isolated_.size(); ++k) {
    Isolated& i = isolated_[k];
    i.isolator->reset();
    i.raised = false;
    i.told_for = -1;
    i.judged_until = std::nan("");
    i.interval = 0;
    IsolatorResult fresh;
    fresh.name = std::move(assessment_.isolators[k].name);
    assessment_.isolators[k] = std::move(fresh);
  }
  channels_.reset();
  assessment_.judged = false;
  assessment_.undecided_since = std::nan("");
  model_fits_ = true;
  running_ = quiet_ = false;
}

References IsolationStage::references() const {
  References references;
  references.rig = sheet_.rig;
  const auto add = [&](const std::string& stage, std::optional<Reference> reference) {
    if (reference) references.stages.push_back({stage, std::move(*reference)});
  };
  for (std::size_t k = 0; k < watched_.size(); ++k) add(sheet_.detectors[k].name, watched_[k].detector->reference());
  for (std::size_t k = 0; k < isolated_.size(); ++k) add(sheet_.isolators[k].name, isolated_[k].isolator->reference());
  return references;
}

void IsolationStage::restore(const References& references) {
  const auto place = [](const std::vector<StageSpec>& specs, const std::string& name) {
    return static_cast<std::size_t>(
        std::find_if(specs.begin(), specs.end(), [&](const StageSpec& spec) { return spec.name == name; }) -
        specs.begin());
  };
  for (const auto& [stage, reference] : references.stages) {
    if (place(sheet_.estimators, stage) < sheet_.estimators.size()) continue;
    const std::size_t w = place(sheet_.detectors, stage), i = place(sheet_.isolators, stage);
    try {
      if (w < watched_.size())
        watched_[w].detector->restore(reference);
      else if (i < isolated_.size())
        isolated_[i].isolator->restore(reference);
      else
        throw InputError(fmt::format("the rig {} has no such detector or isolator; learn it anew", sheet_.rig));
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}{}{}: {}", references.file, references.file.empty() ? "" : ": ", stage, error.what()));
    }
  }
}

const Assessment& IsolationStage::process(const std::vector<Estimate>& estimates) {
  if (estimates.size() != std::max<std::size_t>(sheet_.estimators.size(), 1))
    throw InputError(fmt::format("{}: alarms need the estimates of all {} estimators, there are {}", sheet_.rig,
                                 sheet_.estimators.size(), estimates.size()));
  return process(estimates.data());
}

const Assessment& IsolationStage::process(const Estimate& estimate) {
  if (sheet_.estimators.size() > 1)
    throw InputError(fmt::format("{}: alarms need the estimates of all {} estimators, there is one", sheet_.rig,
                                 sheet_.estimators.size()));
  return process(&estimate);
}

const Assessment& IsolationStage::process(const Estimate* estimates) {
  const Estimate& estimate = estimates[0];
  if (running_ && estimate.time < assessment_.time) reset();
  if (!running_) begin_ = estimate.time;
  running_ = true;
  assessment_.time = estimate.time;
  assessment_.sequence = estimate.sequence;
  assessment_.channel_status = estimate.channel_status;
  channels_.process(estimate.time, estimate.channel_status);
  // What every detector said of nothing stays said, so that the usual sample costs no more than the detectors.
  const bool was_quiet = quiet_;
  assessment_.quiet = !detect(estimates) && was_quiet;
  isolate(estimates);
  if (!(quiet_ && was_quiet)) {
    hand_over();
    decide_detections();
  }
  decide_findings();
  return assessment_;
}

const IsolatorResult& IsolationStage::isolator_result(const Isolated& i) const {
  return assessment_.isolators[static_cast<std::size_t>(&i - isolated_.data())];
}

const Detection& IsolationStage::detection(const Watched& w) const {
  return assessment_.detectors[static_cast<std::size_t>(&w - watched_.data())].detection;
}

bool IsolationStage::detect(const Estimate* estimates) {
  bool blind = false;
  model_fits_ = quiet_ = true;
  for (std::size_t c = 0; c < doubted_.size(); ++c) doubted_[c] = channels_.is_bad(c);
  const auto doubt = [this](const Watched& w) {
    for (const std::size_t channel : w.doubts) doubted_[channel] = true;
  };
  const double age = assessment_.time - begin_;
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    Watched& w = watched_[k];
    DetectorResult& result = assessment_.detectors[k];
    w.detector->process(estimates[w.stage], result.detection);
    const Criterion criterion = w.detector->criterion();
    result.evidence = criterion.value / criterion.threshold;
    if (!assessment_.judged && !weighs_all_ && !w.of_transducer && age > 0 &&
        (std::isfinite(criterion.value) || age >= kLongEnough))
      assessment_.judged = true;
    w.stands = false;
    blind = blind || result.detection.blind;
    w.claim.holds = result.detection.active;
    if (!w.claim.holds) continue;  // most of them, at every sample
    quiet_ = false;
    if (result.size_name.empty()) {  // some know the unit from the first estimate on
      result.size_name = w.detector->size_name();
      result.size_unit = w.detector->size_unit();
    }
    if (w.withholds) model_fits_ = false;
    if (w.meaning.kind == AlarmKind::sensor) doubt(w);
  }
  if (quiet_) return blind;
  for (Watched& w : watched_) {
    if (!w.claim.holds) continue;
    w.claim = Claim();
    w.claim.kind = w.meaning.kind;
    w.claim.holds = true;
    w.claim.raised = w.raised;
    w.claim.in_doubt = std::any_of(w.doubts.begin(), w.doubts.end(), [this](std::size_t c) { return doubted_[c]; });
    const bool of_one_channel = w.of_transducer && !w.meaning.effect.empty();
    w.claim.on_bad_data = !of_one_channel && channels_.held() && raised_on_bad_data(w);
    w.stands = reason_of(w.claim) == Reason::told;
  }
  for (const Watched& w : watched_)
    if (w.stands && w.meaning.kind == AlarmKind::fault) doubt(w);
  return true;
}

void IsolationStage::isolate(const Estimate* estimates) {
  bool judged = false, blind = false;
  assessment_.undecided_since = std::nan("");
  for (std::size_t k = 0; k < isolated_.size(); ++k) {
    Isolated& i = isolated_[k];
    i.isolator->process(estimates[i.stage], doubted_, assessment_.isolators[k].finding);
    const double until = i.isolator->judged_until();
    if (until > i.judged_until) i.interval = std::max(i.interval, until - i.judged_until);
    i.judged_until = until;
    if (std::isfinite(until) && until > begin_ + kJudgedShare * (assessment_.time - begin_) && i.isolator->could_see())
      judged = true;
    blind = blind || (!i.isolator->overrules() && !i.isolator->could_see());
    assessment_.undecided_since = std::fmin(assessment_.undecided_since, i.isolator->undecided_since());
    const bool bad = channels_.held() || (i.isolator->rests_on_all_channels() && channels_.any_bad());
    i.on_bad_data = bad && raised_on_bad_data(i);
  }
  if (weighs_all_ || judged) assessment_.judged = judged;
  if (blind) assessment_.judged = false;
  // The model is then known well enough: the cause explains what it did not.
  if (std::any_of(isolated_.begin(), isolated_.end(), [this](const Isolated& i) { return names_the_cause(i); }))
    model_fits_ = true;
}

void IsolationStage::hand_over() {
  for (DetectorResult& result : assessment_.detectors) result.takes_over = -1;
  for (std::size_t k = 0; k < isolated_.size(); ++k) {
    Isolated& i = isolated_[k];
    if (!i.raised || finding(i).active || i.told_for < 0) continue;
    const auto place = static_cast<std::size_t>(i.told_for);
    if (!watched_[place].stands || watched_[place].raised) continue;
    assessment_.detectors[place].takes_over = static_cast<int>(k);
    watched_[place].raised = true;
    watched_[place].raised_at = i.raised_at;
    i.raised = false;
    i.told_for = -1;
  }
}

void IsolationStage::decide_detections() {
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    Watched& w = watched_[k];
    DetectorResult& result = assessment_.detectors[k];
    if (!w.claim.holds) {
      result.reason = Reason::absent;
      w.raised = false;
      continue;
    }
    w.claim.raised = w.raised;
    w.claim.model_fits = model_fits_;
    if (w.stands) {
      w.claim.explained = explained(w);
      w.claim.judgement_awaited = judgement_awaited(w);
      w.claim.told_by_another = told_by_isolator(k) || follows(w);
    }
    result.reason = reason_of(w.claim);
    const bool told = result.reason == Reason::told;
    if (told && !w.raised) w.raised_at = assessment_.time;
    w.raised = told;
  }
}

void IsolationStage::decide_findings() {
  for (std::size_t k = 0; k < isolated_.size(); ++k) {
    Isolated& i = isolated_[k];
    IsolatorResult& result = assessment_.isolators[k];
    result.detector = names_the_cause(i) ? detected(result.finding) : -1;
    Claim claim;
    claim.kind = result.finding.kind;
    claim.holds = result.finding.active;
    const bool watched = told_by_watch(i);
    claim.raised = i.raised && !watched;
    claim.on_bad_data = i.on_bad_data;
    claim.told_by_another = watched ||
                            (result.detector >= 0 && watched_[static_cast<std::size_t>(result.detector)].raised) ||
                            told_by_another(i);
    claim.explained = explained(i);
    claim.judgement_awaited = judgement_awaited(i);
    claim.model_fits = model_fits_ || !i.isolator->rests_on_model();
    result.reason = reason_of(claim);
    const bool told = result.reason == Reason::told;
    if (told && !i.raised) i.raised_at = assessment_.time;
    i.raised = told || (watched && i.raised);  // what it explains is explained, whoever tells it
    if (result.reason != Reason::told_by_another) i.told_for = result.detector;
  }
}

bool IsolationStage::explained(const Watched& w) const {
  // Numbers that are not the transducers' own fit no model.
  if (w.meaning.kind == AlarmKind::unknown && channels_.unusable() && raised_on_bad_data(w)) return true;
  // A filter with a model of its own, simpler than the rig's, is not asked where that explains everything.
  const bool of_the_rig = w.meaning.kind == AlarmKind::unknown && !w.of_output;
  if ((w.withholds || of_the_rig) && std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
        return i.isolator->overrules() && i.isolator->finds_all_explained() &&
               i.isolator->judged_until() >= detection(w).since;
      }))
    return true;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    const Finding& f = finding(i);
    if (!names_the_cause(i)) return false;
    // No cause, which is what the detector says too.
    if (f.kind == AlarmKind::unknown && f.equivalent.empty() && w.meaning.kind == AlarmKind::unknown) return true;
    // No single cause, yet all were weighed: what is not among the nearest is none.
    if (f.kind == AlarmKind::unknown)
      return w.meaning.kind == AlarmKind::fault && !f.equivalent.empty() && !among(f.equivalent, w.named);
    switch (w.meaning.kind) {
      case AlarmKind::unknown:
        return true;
      case AlarmKind::sensor:  // a channel that is not what it is called has not that channel's noise either
        return f.kind == AlarmKind::data || (w.meaning.effect.empty() && f.kind == AlarmKind::sensor);
      case AlarmKind::fault:
        return !is_named(w.named, f.effect, f.port) && !among(f.equivalent, w.named);
      case AlarmKind::model:
      case AlarmKind::data:
        break;
    }
    return false;
  });
}

bool IsolationStage::judgement_awaited(const Watched& w) const {
  if (w.meaning.kind == AlarmKind::sensor && !w.meaning.effect.empty()) return false;
  if (w.meaning.kind == AlarmKind::data) return false;  // what is done with a reading, whatever the cause is
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.isolator->overrules() && i.isolator->judged_until() < detection(w).since;
  });
}

bool IsolationStage::judgement_awaited(const Isolated& i) const {
  if (i.isolator->weighs_every_effect()) return false;
  const double since = finding(i).since;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& other) {
    if (!other.isolator->weighs_every_effect()) return false;
    const bool undecided = !std::isnan(other.isolator->undecided_since());
    const bool waits = undecided ? !other.isolator->suspects(finding(i)) : other.judged_until < since;
    return waits && assessment_.time - since < kPatience * other.interval;
  });
}

bool IsolationStage::told_by_isolator(std::size_t detector) const {
  const Watched& w = watched_[detector];
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    const Finding& f = finding(i);
    if (!i.raised || f.effect.empty() || !names_the_cause(i)) return false;
    return w.of_transducer ? is_named(w.named, f.effect, f.port) : detected(f) == static_cast<int>(detector);
  });
}

bool IsolationStage::follows(const Watched& w) const {
  if (w.under >= 0 && watched_[static_cast<std::size_t>(w.under)].claim.holds) return true;
  const bool plain = w.meaning.kind == AlarmKind::unknown && !w.withholds;
  if (!plain && w.meaning.kind != AlarmKind::model) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    // The rig is as it was where its inputs have changed: what moved with them is nothing of its own.
    if (plain && w.of_output && i.isolator->finds_all_explained()) return true;
    const Finding& f = finding(i);
    const bool cause = f.kind == AlarmKind::fault || (f.kind == AlarmKind::sensor && !plain);
    return i.raised && f.active && cause && !f.effect.empty() && detection(w).since > f.since - kSameOnset;
  });
}

// What watches a transducer has told the same.
bool IsolationStage::told_by_watch(const Isolated& i) const {
  const Finding& f = finding(i);
  return f.active && !f.effect.empty() && std::any_of(watched_.begin(), watched_.end(), [&](const Watched& w) {
           return w.of_transducer && w.raised && is_named(w.named, f.effect, f.port);
         });
}

bool IsolationStage::told_by_another(const Isolated& i) const {
  const Finding& f = finding(i);
  if (!f.active || f.effect.empty()) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& other) {
    const Finding& g = finding(other);
    return &other != &i && other.raised && g.active && !g.effect.empty() && is_one_cause(f, g);
  });
}

bool IsolationStage::explained(const Isolated& i) const {
  const Finding& f = finding(i);
  if (i.isolator->weighs_every_effect() || !f.active) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& other) {
    const Finding& g = finding(other);
    if (!other.isolator->weighs_every_effect() || !names_the_cause(other)) return false;
    // The likeliest of a list that the table names, or cannot tell from what it names, is what both say.
    const bool both = g.effect.empty() ? !g.equivalent.empty() && (g.equivalent.front() == named(f.effect, f.port) ||
                                                                   among(f.equivalent, g.equivalent.front()))
                                       : is_one_cause(f, g);
    return !both;
  });
}

int IsolationStage::detected(const Finding& f) const {
  if (f.effect.empty()) return -1;
  for (std::size_t k = 0; k < watched_.size(); ++k) {
    const Watched& w = watched_[k];
    if (w.stands && w.meaning.kind == AlarmKind::fault && !w.meaning.effect.empty() &&
        (is_named(w.named, f.effect, f.port) || among(f.equivalent, w.named)))
      return static_cast<int>(k);
  }
  return -1;
}

}  // namespace faultline
