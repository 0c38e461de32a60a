#include "faultline/rig/default_sheet.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/rig/rig.h"
#include "faultline/rig/time_scales.h"

namespace faultline {
namespace {

// Of profiles, in slowest time scales: some hundred levels' worth of motion, ...
constexpr double kProfile = 60;
constexpr double kJudgements = 12;  // of the responses, at least: a fault that comes half way is seen in some
constexpr double kFewestSamples = 500, kMostSamples = 1e5;  // ... within what filters need and a bag of some MB holds
constexpr double kShortestLevel = 0.3, kLongestLevel = 3;   // some levels end before the rig has settled, some after
constexpr double kClock = 0.3;                              // a third of the time constant, as is usual
constexpr double kLongestClocks = 7;
constexpr double kLowestTone = 0.05;  // over the slowest scale: three cycles of it in a run
constexpr double kHighestTone = 0.1;  // over the sample period: ten samples a cycle
constexpr double kTones = 24;
constexpr double kLeastSpan = 0.1;  // of a command's range: what moves it at all
constexpr double kTwoPi = 6.283185307179586;

// Of stages.
constexpr double kSegments = 3, kLeastSegment = 20, kMostSegment = 2000;  // samples
constexpr std::size_t kFilterStates = 16;  // that a filter takes (estimators/process_model.h)
constexpr double kLongestEvery = 1e6;      // s
// Slowest time scales of a segment: start states that no channel shows are estimated in each, and a fault must still
// show when these have taken their part.
constexpr double kSegment = 2;
// At least of the settling time: a rig may settle later than its slowest mode says.
constexpr double kSegmentSettling = 0.4;
constexpr double kModeSettles = 3;  // scales, after which one mode has settled
// Of variances: a model is always a little wrong, and what is left of it is not independent. But the values of a
// stretch over their inflation are the most evidence that it can give, which must do for a fault (threshold: 30).
constexpr double kMostInflation = 30, kLeastInflation = 5, kEvidence = 45;
constexpr double kEffort = 2e4;        // samples of the model per second of recording that the responses may cost
constexpr double kLongestLatency = 1;  // s: what a judgement takes
// Times the mean square that a filter expects: of a rig that is one tolerance off it is up to twice that
// (estimators/rig_model.cpp), of one that is two off, as far as rigs are drawn, five times.
constexpr double kFit = 5;
constexpr double kFitSamples = 20;  // at least, over which that is averaged
constexpr double kFrozenPerHour = 1e-3, kFewestEqual = 5, kMostEqual = 1000;
constexpr double kRounded = 2;  // resolutions over noise, from which equal readings are nothing unusual
// Of how long the model's own motion bends, and windows more: a recording moves otherwise than the step test.
constexpr double kBendReserve = 1.5, kBendWindows = 2;
constexpr double kHold = 100;  // sample periods after which an alarm of a transducer is over
constexpr double kGap = 100;   // sample periods without a sample, after which estimators begin anew

double rounded(double value) { return std::stod(fmt::format("{:.3g}", value)); }
// Of a command, whose range may be narrow against its values.
double level(double value) { return std::stod(fmt::format("{:.6g}", value)); }

class Completer {
 public:
  Completer(Datasheet& sheet, const std::set<std::string>& given)
      : sheet_(sheet),
        given_(given),
        test_(step_test(sheet)),
        period_(sheet.sample_period),
        memory_(std::max(test_.scales.slowest_s, test_.scales.settling_s / kModeSettles)) {}

  void run() {
    if (lacks("profiles") && lacks("controllers")) add_profiles();
    const bool own_estimators = !lacks("estimators");
    if (!own_estimators) add_estimators();
    if (!own_estimators && lacks("detectors")) add_detectors();
    if (lacks("isolators")) add_isolators();
  }

 private:
  bool lacks(const char* key) const { return given_.count(key) == 0; }

  Settings settings(const std::string& name, std::map<std::string, double> numbers,
                    std::map<std::string, std::string> words = {}) const {
    return {fmt::format("{}: '{}', which is filled in", sheet_.file, name), std::move(numbers), {}, std::move(words)};
  }

  void add_profiles() {
    const double slowest = memory_, fastest = test_.scales.fastest_s;
    const double samples = std::clamp(std::ceil(std::max(kProfile * slowest, kJudgements * every()) / period_),
                                      kFewestSamples, kMostSamples);
    Profile steps, prbs, multisine;
    for (const Channel& channel : sheet_.channels) {
      if (channel.role != Role::command || channel.ground_truth) continue;
      const double range = channel.maximum - channel.minimum;
      const double middle = 0.5 * (test_.low_fraction + test_.high_fraction);
      const double half = 0.5 * std::max(test_.high_fraction - test_.low_fraction, kLeastSpan);
      const double low = channel.minimum + std::max(middle - half, 0.0) * range;
      const double high = channel.minimum + std::min(middle + half, 1.0) * range;
      const double shortest = std::max(kShortestLevel * slowest, 2 * period_);
      steps.commands.push_back(
          {channel.name, "steps",
           settings("steps", {{"low", level(low)},
                              {"high", level(high)},
                              {"shortest", rounded(shortest)},
                              {"longest", rounded(std::max(kLongestLevel * slowest, shortest))}})});
      prbs.commands.push_back({channel.name, "prbs",
                               settings("prbs", {{"low", level(0.5 * (high - low))},
                                                 {"high", level(0.5 * (high - low))},
                                                 {"mean", level(0.5 * (high + low))},
                                                 {"clock", rounded(std::max(kClock * slowest, 2 * period_))},
                                                 {"longest", kLongestClocks}})});
      const double lowest = kLowestTone / slowest;
      const double highest = std::max(std::min(kHighestTone / period_, 1 / (kTwoPi * fastest)), 2 * lowest);
      multisine.commands.push_back({channel.name, "multisine",
                                    settings("multisine", {{"count", kTones},
                                                           {"lowest", rounded(lowest)},
                                                           {"highest", rounded(highest)},
                                                           {"amplitude", level(0.5 * (high - low))},
                                                           {"mean", level(0.5 * (high + low))},
                                                           {"corner", rounded(1 / (kTwoPi * slowest))},
                                                           {"fade", rounded(slowest)}})});
    }
    if (steps.commands.empty()) return;  // nothing can be moved
    steps.meaning = "random levels of every command";
    prbs.meaning = "every command between two levels";
    multisine.meaning = "sines from slow to fast on every command";
    const std::pair<const char*, Profile*> named[] = {{"steps", &steps}, {"prbs", &prbs}, {"multisine", &multisine}};
    for (const auto& [name, profile] : named) {
      profile->name = name;
      profile->duration = samples * period_;
      sheet_.profiles.push_back(std::move(*profile));
    }
    sheet_.defaulted.insert("profiles");
  }

  bool filtered() const { return sheet_.states.size() <= kFilterStates; }

  std::map<std::string, double> pause() const {
    return {{"gap", rounded(kGap * period_)}, {"jump", rounded(kGap * period_)}};
  }

  // Samples. No longer than a run of the datasheet's own allows, but for states that no channel shows.
  double segment() const {
    const double wanted = std::max(kSegment * test_.scales.slowest_s, kSegmentSettling * test_.scales.settling_s);
    const double allowed = std::max(own_run() / (kJudgements * (kSegments + 1)), kSegment * test_.scales.hidden_s);
    return std::clamp(std::ceil(std::min(wanted, allowed) / period_), kLeastSegment, kMostSegment);
  }
  // s; infinite where the datasheet has no profile.
  double own_run() const {
    double shortest = kInfinity;
    if (!lacks("profiles"))
      for (const Profile& profile : sheet_.profiles)
        if (profile.duration > 0) shortest = std::min(shortest, profile.duration);
    return shortest;
  }
  double inflation() const {
    double outputs = 0;
    for (const Channel& channel : sheet_.channels) outputs += channel.role == Role::output && !channel.ground_truth;
    // The first segment only fills memories.
    return std::clamp((kSegments - 1) * segment() * outputs / kEvidence, kLeastInflation, kMostInflation);
  }
  // s, between the stretches that the responses look at.
  double every() const {
    double variants = 1;  // of the model, that run beside each other
    for (const Parameter& p : sheet_.parameters) variants += p.tolerance > 0;
    for (const Port& port : sheet_.ports) variants += static_cast<double>(port.effects.size());
    const double stretch = (kSegments + 1) * segment() * period_;
    return std::min(stretch * std::max(1.0, variants / (kEffort * period_)), kLongestEvery);
  }

  void add_estimators() {
    std::map<std::string, double> numbers = pause();
    if (filtered())
      sheet_.estimators.push_back(
          {"model_filter", "unscented_kalman", settings("model_filter", numbers, {{"model", "rig_model"}})});
    else
      sheet_.estimators.push_back({"channels", "channels", settings("channels", numbers)});
    numbers.erase("gap");  // what the responses learnt of the rig outlasts a longer one
    numbers["segment"] = segment() * period_;
    numbers["segments"] = kSegments;
    numbers["inflation"] = rounded(inflation());
    numbers["every"] = rounded(1.005 * every());  // never below what a stretch takes
    numbers["confirmed"] =
        0;  // few stretches see a fault here, and of states without a channel those of its onset alone
    numbers["latency"] = std::min(kLongestLatency, rounded(0.5 * numbers["every"]));
    sheet_.estimators.push_back({"responses", "fault_response", settings("responses", numbers)});
    sheet_.defaulted.insert("estimators");
  }

  void add_detectors() {
    if (filtered()) add_model_fit();
    for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
      const Channel& channel = sheet_.channels[c];
      const bool measured = channel.role == Role::output || channel.role == Role::input;
      if (!measured || channel.ground_truth || channel.noise_std <= 0) continue;
      if (channel.resolution <= kRounded * channel.noise_std) add_frozen(channel);
      // An input may be moved as fast as it is sampled, and nothing foresees it; its channel watch knows white noise.
      if (channel.role == Role::output) add_noisy(channel, test_.bends[c]);
    }
    sheet_.defaulted.insert("detectors");
  }

  void add_model_fit() {
    const double average = std::max(memory_, kFitSamples * period_);
    sheet_.detectors.push_back(
        {"model_fit", "consistency",
         settings("model_fit",
                  {{"limit", kFit},
                   {"average", rounded(average)},
                   {"settle", rounded(kModeSettles * memory_)},
                   {"minimum_time", rounded(0.5 * average)},
                   {"release_time", rounded(average)}},
                  {{"kind", "unknown"}, {"text", "The model does not explain the measurements"}})});
  }

  // Words of a detector of a transducer: its port and effect where the datasheet has them.
  std::map<std::string, std::string> words(const Channel& channel, const char* effect, const char* text) const {
    std::map<std::string, std::string> result = {
        {"kind", "sensor"}, {"quantity", channel.name}, {"text", channel.name + ": this transducer is " + text}};
    for (const Port& port : sheet_.ports)
      if (port.kind == PortKind::sensor && port.channel == channel.name) {
        result["port"] = port.name;
        result["effect"] = effect;
      }
    return result;
  }

  // Two readings are equal with the probability p = resolution/(2 sqrt(pi) noise).
  void add_frozen(const Channel& channel) {
    const double p = std::max(channel.resolution / (2 * std::sqrt(kTwoPi / 2) * channel.noise_std), 1e-6);
    const double rarely = kFrozenPerHour * period_ / 3600;
    const double count = p < 1 ? std::ceil(1 + std::log(rarely) / std::log(p)) : kMostEqual;
    sheet_.detectors.push_back({"frozen_" + channel.name, "frozen",
                                settings("frozen_" + channel.name,
                                         {{"count", std::clamp(count, kFewestEqual, kMostEqual)},
                                          {"low", channel.minimum},
                                          {"high", channel.maximum},
                                          {"release_time", rounded(kHold * period_)}},
                                         words(channel, "stuck", "stuck"))});
  }

  void add_noisy(const Channel& channel, const Bends& bends) {
    const double noise =
        std::sqrt(channel.noise_std * channel.noise_std + channel.resolution * channel.resolution / 12);
    std::map<std::string, std::string> said = words(channel, "noise", "noisy");
    if (filtered()) said["innovation"] = channel.name + "_innovation";
    const double lasts = kBendReserve * bends.samples + kBendWindows * kNoisyWindow;  // samples
    sheet_.detectors.push_back({"noisy_" + channel.name, "noisy",
                                settings("noisy_" + channel.name,
                                         {{"noise", rounded(bends.noise * noise)},
                                          {"limit", kNoisyLimit},
                                          {"window", kNoisyWindow},
                                          {"minimum_time", rounded(lasts * period_)},
                                          {"release_time", rounded(kHold * period_)}},
                                         said)});
  }

  void add_isolators() {
    std::string stage;
    for (const StageSpec& spec : sheet_.estimators)
      if (stage.empty() && spec.type == "fault_response") stage = spec.name;
    if (stage.empty()) return;
    const std::map<std::string, double> numbers = {
        {"rival", 0.02}, {"rival_least", 3}, {"most_rivals", 6}, {"model_error", 0.1}, {"least_share", 0.02}};
    sheet_.isolators.push_back({"fault", "response", settings("fault", numbers, {{"stage", stage}})});
    std::map<std::string, double> second = numbers;
    second["place"] = 2;
    second["confirm"] = 2;
    sheet_.isolators.push_back({"second_fault", "response", settings("second_fault", second, {{"stage", stage}})});
    sheet_.defaulted.insert("isolators");
  }

  Datasheet& sheet_;
  const std::set<std::string>& given_;
  StepTest test_;
  double period_;
  double memory_;  // s: the slowest mode's scale, or as if one mode settled as late as the rig
};

void mark_parameters(Datasheet& sheet) {
  if (std::any_of(sheet.parameters.begin(), sheet.parameters.end(), [](const Parameter& p) { return p.identify; }))
    return;
  for (Parameter& p : sheet.parameters)
    if (p.tolerance > 0 && p.nominal != 0) {
      p.identify = true;
      sheet.defaulted.insert("identify");
    }
}

void give_inputs(Datasheet& sheet) {
  for (const Channel& channel : sheet.channels) {
    if (channel.role != Role::input || !channel.predicted_by.empty()) continue;
    if (std::any_of(sheet.inputs.begin(), sheet.inputs.end(),
                    [&](const InputSignal& input) { return input.channel == channel.name; }))
      continue;
    InputSignal input;
    input.channel = channel.name;
    input.level.value = input_value(sheet, channel);
    sheet.inputs.push_back(input);
    sheet.defaulted.insert("inputs");
  }
}

std::string stages_text(const std::string& key, const std::vector<StageSpec>& stages) {
  std::string text = key + ":\n";
  for (const StageSpec& stage : stages) {
    text += fmt::format("  - name: {}\n    type: {}\n", stage.name, stage.type);
    for (const std::string& line : stage.settings.texts()) text += "    " + line + "\n";
  }
  return text;
}

}  // namespace

void complete_datasheet(Datasheet& sheet, const std::set<std::string>& given) {
  if (!find_rig_type(sheet.rig)) return;
  mark_parameters(sheet);
  const bool runs = given.count("profiles") == 0 && given.count("controllers") == 0;
  if (runs) give_inputs(sheet);
  const bool whole = given.count("estimators") > 0 && given.count("isolators") > 0;
  if (runs || !whole) Completer(sheet, given).run();
}

std::string defaulted_stages(const Datasheet& sheet) {
  std::string text;
  if (sheet.defaulted.count("estimators") > 0) text += stages_text("estimators", sheet.estimators);
  if (sheet.defaulted.count("detectors") > 0) text += stages_text("detectors", sheet.detectors);
  if (sheet.defaulted.count("isolators") > 0) text += stages_text("isolators", sheet.isolators);
  return text;
}

std::string defaulted_text(const Datasheet& sheet) {
  std::string text;
  if (sheet.defaulted.count("inputs") > 0) {
    text += "inputs:\n";
    for (const InputSignal& input : sheet.inputs)
      text += fmt::format("  {}: {{value: {:g}, wander_std: {:g}, wander_low: {:g}, wander_high: {:g}}}\n",
                          input.channel, input.level.value, input.wander_std, input.wander_low, input.wander_high);
  }
  if (sheet.defaulted.count("profiles") > 0) {
    text += "profiles:\n";
    for (const Profile& profile : sheet.profiles) {
      text += fmt::format("  - name: {}\n    duration: {:g}\n    meaning: {}\n    commands:\n", profile.name,
                          profile.duration, profile.meaning);
      for (const DrivenCommand& command : profile.commands) {
        text += fmt::format("      {}:\n        shape: {}\n", command.channel, command.shape);
        for (const std::string& line : command.settings.texts()) text += "        " + line + "\n";
      }
    }
  }
  return text + defaulted_stages(sheet);
}

}  // namespace faultline
