// How much the answers of each engine change when one of its options is multiplied: what
// scripts/studies/option_sensitivity.py asks.
//
//   option_sensitivity ENGINE        gap | live_gap | fit | responses | signatures
//
// Writes one line of JSON with the options, [[name, value], ...]; then reads lines `NAME FACTOR` and answers each
// with one line of JSON: by case, `words` (what the engine decided), `sizes` and `numbers` (by name), `details`. A
// count is rounded and at least 1. Recordings are simulated with fixed seeds, once; the parameters of their rigs are
// drawn within their tolerances.
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "faultline/estimators/estimator_stage.h"
#include "faultline/estimators/fault_responses.h"
#include "faultline/estimators/stretch_collector.h"
#include "faultline/fit/parameter_fit.h"
#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/live_gap.h"
#include "faultline/isolation/signature_isolator.h"
#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/recordings.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

// ---- options by name

void multiply(double& value, double factor) { value *= factor; }
void multiply(std::size_t& value, double factor) {
  value = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(static_cast<double>(value) * factor)));
}
template <class Values>
void multiply(Values& values, double factor) {
  for (auto& value : values) multiply(value, factor);
}

template <class Options>
void multiply_option(Options& options, const std::string& name, double factor) {
  bool found = false;
  for_each_option(options, [&](const char* option, auto& value) {
    if (option != name) return;
    multiply(value, factor);
    found = true;
  });
  if (!found) throw InputError("there is no option '" + name + "'");
}

template <class Options>
Json list_options(Options options) {
  Json list = Json::array();
  for_each_option(options, [&](const char* name, auto& value) { list.push_back({name, value}); });
  return list;
}

struct Engine {
  Json options;
  // Answers by case with one option multiplied; by all cases where the factor is 1.
  std::function<Json(const std::string& name, double factor)> answer;
};

Json empty_answer() {
  return {{"words", Json::array()}, {"sizes", Json::object()}, {"numbers", Json::object()}, {"details", Json::array()}};
}

// ---- gap: the servo actuator with few uncertain parameters, two runs of 1.25 s each, candidates at few ports:
// answers in seconds

const Datasheet& small_servo() {
  static const Datasheet sheet = [] {
    const std::vector<std::string> uncertain = {"moving_mass", "viscous_damping", "coulomb_friction", "compliance",
                                                "flow_coefficient"};
    Datasheet copy = servo();
    for (Parameter& p : copy.parameters)
      if (std::find(uncertain.begin(), uncertain.end(), p.name) == uncertain.end()) p.tolerance = 0;
    return copy;
  }();
  return sheet;
}

struct GapCase {
  const char* name;
  std::vector<std::string> effects;
  std::vector<std::string> ports;    // of the candidates
  std::vector<std::string> without;  // of those
  std::vector<const char*>
      options;  // beginnings of those that only this case reaches; empty: it is asked for all others
};

const std::vector<GapCase>& gap_cases() {
  static const std::vector<GapCase> cases = {
      {"nothing", {}, {"flow.chamber_a_chamber_b", "sensor.position"}, {}, {}},
      {"play", {"backlash@transmission.rod:gap=0.002"}, {"transmission.rod"}, {}, {}},
      {"two",
       {"orifice_leakage@flow.chamber_a_tank:coefficient=5e-9", "scale@sensor.velocity:factor=1.1"},
       {"flow.chamber_a_tank", "sensor.velocity"},
       {},
       {}},
      {"foreign", {"scale@sensor.velocity:factor=1.2"}, {"sensor.velocity"}, {"scale@sensor.velocity"}, {}},
      {"stuck",
       {"stuck@sensor.load_pressure:from=0.8"},
       {"sensor.load_pressure"},
       {},
       {"candidates.stuck", "trials.stuck"}},
      {"ripple",
       {"ripple@source.supply_pressure:amplitude=9e5,frequency=23.7"},
       {"source.supply_pressure"},
       {"droop", "offset@source.supply_pressure"},
       {"spectrum."}},
      {"rounding", {"quantisation@sensor.position:step=5e-4"}, {"sensor.position"}, {}, {"grid."}}};
  return cases;
}

std::vector<Recording> gap_runs(const std::vector<std::string>& effects) {
  std::vector<Recording> runs;
  std::uint64_t seed = 11;
  for (const char* profile : {"multisine", "square"}) {
    SimulationSetup setup = servo_setup(profile, seed++);
    setup.parameters = draw_parameters(small_servo(), 11);
    for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
    runs.push_back(simulate(small_servo(), setup, 1.25));
  }
  return runs;
}

std::vector<std::string> elsewhere(const std::vector<std::string>& ports) {
  std::vector<std::string> without;
  for (const Port& port : small_servo().ports)
    if (std::find(ports.begin(), ports.end(), port.name) == ports.end())
      for (const FittingEffect& fitting : port.effects) without.push_back(fitting.effect + "@" + port.name);
  return without;
}

std::string place_of(const NamedEffect& effect) { return effect.effect + "@" + effect.port; }

Json gap_answer(const GapCase& asked, const std::vector<Recording>& recordings, const GapOptions& options) {
  GapSettings settings;
  settings.options = options;
  settings.without = elsewhere(asked.ports);
  settings.without.insert(settings.without.end(), asked.without.begin(), asked.without.end());
  std::vector<SegmentedRun> runs;
  for (const Recording& recording : recordings)
    runs.push_back(cut_run(small_servo(), "run", recording, small_servo().segment, options.segments));
  const GapResult result = diagnose_gap(small_servo(), std::move(runs), {}, settings, {});
  Json answer = empty_answer();
  answer["words"].push_back(result.verdict);
  for (const NamedEffect& effect : result.effects) {
    answer["words"].push_back(place_of(effect));
    for (const auto& [name, value] : effect.parameters) answer["sizes"][place_of(effect) + ":" + name] = value;
    for (const auto& [name, interval] : effect.intervals)
      answer["numbers"]["interval of " + place_of(effect) + ":" + name] = interval.high - interval.low;
  }
  answer["numbers"]["shrink"] = result.shrink_refit;
  answer["numbers"]["shrink interval"] = result.shrink_interval.high - result.shrink_interval.low;
  answer["numbers"]["unknown"] = result.unknown_probability;
  for (const NamedEffect& effect : result.equivalent) answer["details"].push_back(place_of(effect));
  if (!result.places.empty())
    for (const std::string& port : result.places.front().inseparable) answer["details"].push_back(port);
  for (const Region& region : result.regions) answer["details"].push_back(region.name);
  for (const NextRun& next : result.next) answer["details"].push_back(next.excitation);
  return answer;
}

Engine gap_engine() {
  const auto recordings = std::make_shared<std::vector<std::vector<Recording>>>();
  for (const GapCase& c : gap_cases()) recordings->push_back(gap_runs(c.effects));
  return {list_options(GapOptions()), [recordings](const std::string& name, double factor) {
            GapOptions options;
            multiply_option(options, name, factor);
            Json answers;
            const auto reached_by = [&](const GapCase& c) {
              return std::any_of(c.options.begin(), c.options.end(),
                                 [&](const char* beginning) { return name.rfind(beginning, 0) == 0; });
            };
            const bool special = std::any_of(gap_cases().begin(), gap_cases().end(), reached_by);
            for (std::size_t i = 0; i < gap_cases().size(); ++i)
              if (factor == 1 || (special ? reached_by(gap_cases()[i]) : gap_cases()[i].options.empty()))
                answers[gap_cases()[i].name] = gap_answer(gap_cases()[i], (*recordings)[i], options);
            return answers;
          }};
}

// ---- live gap: the servo actuator, 8 s each

Engine live_gap_engine() {
  const std::vector<std::pair<const char*, const char*>> cases = {
      {"nothing", ""},
      {"deadband", "deadband@restriction.valve:width=0.6,from=3"},
      {"leak", "orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=3"}};
  const auto recordings = std::make_shared<std::map<std::string, Recording>>();
  for (const auto& [name, effect] : cases) {
    SimulationSetup setup = off_nominal("random", 12);
    if (*effect) setup.effects.push_back(parse_effect(effect));
    (*recordings)[name] = simulate(servo(), setup, 8);
  }
  return {list_options(LiveGapSettings()), [recordings](const std::string& option, double factor) {
            LiveGapSettings settings;
            multiply_option(settings, option, factor);
            Json answers;
            for (const auto& [name, recording] : *recordings) {
              LiveGap gap(servo(), settings);
              Json answer = empty_answer();
              for (std::size_t k = 0; k < recording.rows(); ++k) gap.process(recording.sample(k));
              const LiveGapState& state = gap.state();
              answer["words"] = {state.left ? "left" : "normal", state.place.port};
              answer["numbers"]["explained"] = state.place.share;
              answer["numbers"]["worst"] = state.worst;
              answer["numbers"]["since"] = state.since;
              for (const LiveRegion& region : state.regions) answer["details"].push_back(region.name);
              for (const std::string& port : state.place.inseparable) answer["details"].push_back(port);
              answers[name] = answer;
            }
            return answers;
          }};
}

// ---- fit: the servo actuator, 4 s

Engine fit_engine() {
  const auto recordings = std::make_shared<std::map<std::string, Recording>>();
  for (const char* profile : {"prbs", "multisine"})
    (*recordings)[profile] = simulate(servo(), off_nominal(profile, 3), 4);
  return {list_options(FitOptions()), [recordings](const std::string& option, double factor) {
            FitOptions options;
            multiply_option(options, option, factor);
            Json answers;
            for (const auto& [name, recording] : *recordings) {
              const ParameterFit fit = fit_parameters(servo(), {{name, recording}}, 1, {}, options);
              Json answer = empty_answer();
              for (const FittedParameter& p : fit.parameters) {
                answer["words"].push_back(p.name + (p.determined ? " determined" : " not determined"));
                answer["sizes"][p.name] = p.estimate;
                answer["numbers"]["interval of " + p.name] = p.high - p.low;
                if (!p.reason.empty()) answer["details"].push_back(p.reason);
              }
              answers[name] = answer;
            }
            return answers;
          }};
}

// ---- fault responses: the servo actuator as its datasheet sets them, 10 s each, the fault from 4 s on

Engine responses_engine() {
  const std::vector<std::pair<const char*, std::vector<std::string>>> cases = {
      {"nothing", {}},
      {"friction", {"coulomb_friction@force.piston:force=150,from=4"}},
      {"two leaks",
       {"orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=4",
        "orifice_leakage@flow.chamber_a_tank:coefficient=5e-9,from=4"}}};
  const auto recordings = std::make_shared<std::map<std::string, Recording>>();
  for (const auto& [name, effects] : cases) {
    SimulationSetup setup = off_nominal("random", 36);
    for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
    (*recordings)[name] = simulate(servo(), setup, 10);
  }
  ResponseSettings shipped;
  for (const StageSpec& stage : servo().estimators)
    if (stage.type == "fault_response") shipped = read_response_settings(stage.settings, servo());
  return {list_options(shipped), [recordings, shipped](const std::string& option, double factor) {
            ResponseSettings settings = shipped;
            multiply_option(settings, option, factor);
            Json answers;
            for (const auto& [name, recording] : *recordings) {
              StretchCollector collector(servo(), settings);
              FaultResponses responses(servo(), settings);
              for (std::size_t k = 0; k < recording.rows(); ++k)
                if (const auto stretch = collector.add(recording.time[k], recording.row(k), true))
                  responses.judge(*stretch);
              Json answer = empty_answer();
              for (const auto* ranked : {&responses.first(), &responses.second()}) {
                if (ranked->empty()) continue;
                const FaultHypothesis& h = responses.hypotheses()[ranked->front().hypothesis];
                answer["words"].push_back(h.name());
                answer["sizes"][h.name()] = h.size(ranked->front().amplitude);
                for (const RankedFault& rival : *ranked)
                  answer["details"].push_back(responses.hypotheses()[rival.hypothesis].name());
              }
              answer["numbers"]["since"] = responses.first().empty() ? 0 : responses.since();
              answer["numbers"]["evidence"] = responses.evidence();
              answers[name] = answer;
            }
            return answers;
          }};
}

// ---- signature isolator: the cooling circuit, the fault from 6 s on, 3 s of it; what its stage says is kept

Engine signatures_engine() {
  const std::vector<std::pair<const char*, const char*>> cases = {
      {"nothing", ""},
      {"leak", "orifice_leakage@flow.m_outlet_ambient:coefficient=2e-7,from=6"},
      {"small leak", "orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=6,to=7"},
      {"clogging", "clogging@restriction.v2_orifice:fraction=0.2,from=6"},
      {"offset", "offset@sensor.v1_inlet_pressure:value=5e4,from=6"},
      {"drift", "drift@sensor.m_outlet_pressure:rate=2e4,from=6"},
      {"thermocouple", "offset@sensor.v2_outlet_temperature:value=4,from=6"},
      {"wall", "scale@heat.v3_wall:factor=1.3,from=6"},
      {"supply", "droop@source.supply:resistance=6e7,from=6,to=7"},
      {"meter", "offset@sensor.t_mass_flow:value=0.1,from=6"}};
  const auto estimates = std::make_shared<std::map<std::string, std::vector<Estimate>>>();
  const StageSpec& spec = cooling().isolators.front();
  for (const auto& [name, effect] : cases) {
    Simulator simulator(cooling(), cooling_recording("steady", 301, effect));
    std::size_t balances = 0;
    for (std::size_t i = 0; i < cooling().estimators.size(); ++i)
      if (cooling().estimators[i].name == "balances") balances = i;
    EstimatorStage stage(cooling(), cooling().estimators[balances]);
    Estimate estimate;
    for (int k = 0; k < 9000; ++k)
      if (stage.process(simulator.step(), estimate)) (*estimates)[name].push_back(estimate);
  }
  Json options;
  SignatureIsolator(cooling(), spec, [&](SignatureOptions& o) { options = list_options(o); });
  return {options, [estimates](const std::string& option, double factor) {
            Json answers;
            for (const auto& [name, course] : *estimates) {
              SignatureIsolator isolator(cooling(), cooling().isolators.front(),
                                         [&](SignatureOptions& o) { multiply_option(o, option, factor); });
              const std::vector<bool> trusted(cooling().channels.size(), false);
              Finding finding;
              double named = 0;  // s, when the last name was first told
              std::string words;
              for (const Estimate& estimate : course) {
                isolator.process(estimate, trusted, finding);
                std::string now;
                if (finding.active)
                  now = std::string(to_string(finding.kind)) + " " + finding.effect + "@" + finding.port;
                if (now == words) continue;
                words = std::move(now);
                named = estimate.time;
              }
              Json answer = empty_answer();
              answer["words"].push_back(words);
              if (finding.active && finding.has_size) {
                answer["sizes"][finding.effect] = finding.size;
                answer["numbers"]["interval"] = finding.high - finding.low;
              }
              answer["numbers"]["named"] = named;
              for (const std::string& other : finding.equivalent) answer["details"].push_back(other);
              answers[name] = answer;
            }
            return answers;
          }};
}

int run(const std::string& name) {
  const std::map<std::string, Engine (*)()> engines = {{"gap", gap_engine},
                                                       {"live_gap", live_gap_engine},
                                                       {"fit", fit_engine},
                                                       {"responses", responses_engine},
                                                       {"signatures", signatures_engine}};
  const auto found = engines.find(name);
  if (found == engines.end()) throw InputError("there is no engine '" + name + "'");
  const Engine engine = found->second();
  std::cout << engine.options.dump() << std::endl;
  std::string option;
  double factor = 1;
  while (std::cin >> option >> factor) {
    Json answer;
    try {
      answer = engine.answer(option, factor);
    } catch (const std::exception& error) {  // a value that an engine refuses is an answer too
      answer = {{"error", error.what()}};
    }
    std::cout << answer.dump() << std::endl;
  }
  return 0;
}

}  // namespace
}  // namespace faultline

int main(int count, char** words) {
  try {
    if (count != 2) throw faultline::InputError("usage: option_sensitivity ENGINE");
    return faultline::run(words[1]);
  } catch (const faultline::InputError& error) {
    std::cerr << "option_sensitivity: " << error.what() << '\n';
    return 2;
  }
}
