// `faultline diagnose`: what is wrong with a recording. Runs the rig's estimators and alarm stage over it as fast as
// they go; the same code in the same order as the nodes. The JSON form is a contract: docs/diagnose.schema.json.
#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/series.h"
#include "cli/subcommand.h"
#include "faultline/alarms/diagnosis.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kWorthSaying = 1;  // s

struct Options {
  std::string input, rig, config, json, series, reference, keep_reference;
  std::size_t series_rows = 4000;
};

// One judgement of a stage that ranks causes.
struct Judgement {
  double time = 0;  // s, when it was told
  std::string stage;
  std::shared_ptr<const Ranking> ranking;
};

// Every judgement of the run, in the order in which they were told.
class Judgements {
 public:
  explicit Judgements(const Diagnosis& diagnosis) : diagnosis_(diagnosis), last_(diagnosis.estimators()) {}
  void add() {
    for (std::size_t i = 0; i < last_.size(); ++i) {
      const Estimate& estimate = diagnosis_.estimate(i);
      if (estimate.ranking == last_[i]) continue;
      last_[i] = estimate.ranking;
      if (last_[i] && !estimate.restarted) all_.push_back({estimate.time, diagnosis_.estimator(i).name(), last_[i]});
    }
  }
  const std::vector<Judgement>& all() const { return all_; }

 private:
  const Diagnosis& diagnosis_;
  std::vector<std::shared_ptr<const Ranking>> last_;
  std::vector<Judgement> all_;
};

// s from the recording's start; a double at today's epoch is good to a quarter of a microsecond.
double rounded(double time) { return std::round(time * 1e6) / 1e6; }

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

const char* level_name(AlarmLevel level) {
  switch (level) {
    case AlarmLevel::ok:
      return "ok";
    case AlarmLevel::warning:
      return "warning";
    case AlarmLevel::error:
      return "error";
    case AlarmLevel::stale:
      break;
  }
  return "stale";
}

Json alarm_json(const Alarm& alarm, double start) {
  Json json = {{"kind", to_string(alarm.kind)},
               {"effect", alarm.effect},
               {"port", alarm.port},
               {"level", level_name(alarm.level)},
               {"since", rounded(alarm.since - start)},
               {"until", rounded(alarm.until - start)},
               {"raised", rounded(alarm.raised - start)},
               {"active", alarm.active},
               {"size", Json()},
               {"confidence", finite(alarm.confidence)},
               {"equivalent", alarm.equivalent},
               {"candidates", alarm.kind == AlarmKind::unknown ? Json(alarm.equivalent) : Json::array()},
               {"text", alarm.text}};
  if (alarm.has_size)
    json["size"] = {{"name", alarm.size_name},
                    {"value", finite(alarm.size)},
                    {"unit", alarm.size_unit},
                    {"low", finite(alarm.low)},
                    {"high", finite(alarm.high)}};
  return json;
}

Json hypotheses_json(const std::vector<RankedHypothesis>& ranked) {
  Json json = Json::array();
  for (const RankedHypothesis& h : ranked) {
    const SizeInterval sizes = h.sizes(h.std);
    json.push_back({{"effect", h.effect},
                    {"port", h.port},
                    {"kind", to_string(h.kind)},
                    {"size",
                     {{"name", h.size_name},
                      {"value", finite(h.size())},
                      {"unit", h.size_unit},
                      {"low", finite(sizes.low)},
                      {"high", finite(sizes.high)}}},
                    {"evidence", finite(h.evidence)}});
  }
  return json;
}

Json judgement_json(const Judgement& judgement, double start) {
  const Ranking& ranking = *judgement.ranking;
  return {{"stage", judgement.stage},
          {"time", rounded(judgement.time - start)},
          {"judged_until", rounded(ranking.judged_until - start)},
          {"since", ranking.first.empty() ? Json() : Json(rounded(ranking.since - start))},
          {"threshold", ranking.threshold},
          {"evidence", finite(ranking.evidence)},
          {"first", hypotheses_json(ranking.first)},
          {"second", hypotheses_json(ranking.second)},
          {"doubt", ranking.first.empty() || ranking.doubt.empty() ? Json() : Json(ranking.doubt)}};
}

Json report_json(const RecordingFacts& facts, const Diagnosis& diagnosis, const Verdict& verdict,
                 const std::vector<Judgement>& judgements) {
  const SampleFindings& found = facts.findings;
  const EstimatorCounts& used = diagnosis.estimator().counts();
  Json json = {{"rig", facts.sheet.rig},
               {"duration", rounded(facts.end - facts.start)},
               {"verdict", to_string(verdict.kind)},
               {"sentence", verdict.sentence},
               {"alarms", Json::array()},
               {"undecided_since", Json()},
               {"not_observable", Json::array()},
               {"rankings", Json::array()},
               {"counts",
                {{"samples", found.samples},
                 {"used", used.used},
                 {"not_newer", used.stale},
                 {"restarts", used.restarts},
                 {"missing", used.missing},
                 {"out_of_range", used.out_of_range},
                 {"gaps", found.gaps},
                 {"lost", found.lost},
                 {"missed_at_start", facts.missed_at_start},
                 {"duplicates", found.duplicates},
                 {"backward", found.backward}}},
               {"made_by", facts.made_by}};
  if (const double since = diagnosis.report().undecided_since; !std::isnan(since))
    json["undecided_since"] = rounded(since - facts.start);
  for (const Alarm& alarm : diagnosis.report().alarms) json["alarms"].push_back(alarm_json(alarm, facts.start));
  for (const Unobserved& u : diagnosis.report().unobserved)
    json["not_observable"].push_back({{"detector", u.detector},
                                      {"effect", u.effect},
                                      {"port", u.port},
                                      {"seconds", rounded(u.seconds)},
                                      {"at_the_end", u.now}});
  for (const Judgement& judgement : judgements) json["rankings"].push_back(judgement_json(judgement, facts.start));
  return json;
}

void print_report(const RecordingFacts& facts, const Diagnosis& diagnosis, const Verdict& verdict) {
  fmt::print("{}, {:.1f} s: {}\n{}\n", facts.sheet.rig, facts.end - facts.start, to_string(verdict.kind),
             verdict.sentence);
  for (const Unobserved& u : diagnosis.report().unobserved)
    if (u.seconds > kWorthSaying)
      fmt::print("{} was not observable for {:.1f} s{}: the motion did not show it.\n",
                 u.effect.empty() ? u.detector : u.effect + "@" + u.port, u.seconds,
                 u.now ? ", nor is it at the end" : "");
  if (diagnosis.report().alarms.empty()) return;
  fmt::print("\n{:>9} {:>9} {:>9}  {:<8} {}\n", "since", "until", "raised", "kind", "what");
  for (const Alarm& alarm : diagnosis.report().alarms) {
    const std::string place = alarm.effect.empty() ? alarm.port : alarm.effect + "@" + alarm.port;
    std::string line = fmt::format("{:>9.2f} {:>9} {:>9.2f}  {:<8} {}", alarm.since - facts.start,
                                   alarm.active ? "end" : fmt::format("{:.2f}", alarm.until - facts.start),
                                   alarm.raised - facts.start, to_string(alarm.kind), place);
    if (alarm.has_size) line += fmt::format("{}{}={}", place.empty() ? "" : " ", alarm.size_name, told_size(alarm));
    fmt::print("{}{}{}\n", line, place.empty() && !alarm.has_size ? "" : ": ", alarm.text);
  }
}

void keep_reference(const Diagnosis& diagnosis, const std::string& file, std::vector<std::string>& remarks) {
  const References learnt = diagnosis.references();
  if (learnt.stages.empty())
    throw InputError(
        fmt::format("{}: nothing is written, for nothing was learnt: no stage of the rig {} learns what is "
                    "normal, or the recording is too short for it",
                    file, learnt.rig));
  write_references(learnt, file);
  if (!diagnosis.report().alarms.empty())
    remarks.push_back(file + ": learnt from a recording with alarms; take a healthy run to learn what is normal");
}

// The stages, as samples come.
class Course : public SampleTaker {
 public:
  explicit Course(const Options& options) : options_(options) {}

  void begin(const Datasheet& sheet, double start) override {
    if (!options_.keep_reference.empty()) check_replaceable(options_.keep_reference, sheet.rig);
    start_ = start;
    sheet_ = sheet;
    diagnosis = std::make_unique<Diagnosis>(sheet_);
    if (!options_.reference.empty()) diagnosis->restore(read_references(options_.reference, sheet.rig));
    judgements = options_.json.empty() ? nullptr : std::make_unique<Judgements>(*diagnosis);
    series = options_.series.empty() ? nullptr : std::make_unique<Series>(sheet, *diagnosis, options_.series_rows);
  }

  void take(const Sample& sample) override {
    if (!diagnosis->process(sample)) return;
    if (judgements) judgements->add();
    if (series) series->add(sample.time - start_, sample);
  }

  std::unique_ptr<Diagnosis> diagnosis;
  std::unique_ptr<Judgements> judgements;  // where they are asked for
  std::unique_ptr<Series> series;

 private:
  const Options& options_;
  Datasheet sheet_;
  double start_ = 0;
};

void run(const Options& options) {
  Course course(options);
  const RecordingFacts facts = stream_recording(options.input, options.rig, options.config, course);
  const Diagnosis& diagnosis = *course.diagnosis;
  const Verdict verdict = verdict_of(diagnosis.report(), facts.start, facts.end);
  if (course.series) write_text(options.series, course.series->csv());
  if (course.judgements)
    write_text(options.json, json_text(report_json(facts, diagnosis, verdict, course.judgements->all())));
  std::vector<std::string> remarks = facts.remarks;
  if (facts.missed_at_start > 0)
    remarks.push_back(fmt::format("{}: {} samples missed at the start of the run; what is told is of what follows",
                                  options.input, facts.missed_at_start));
  if (facts.findings.backward > 0)
    remarks.push_back(options.input +
                      ": after a jump back in time the diagnosis starts over; only what follows the last jump is told");
  if (!options.keep_reference.empty()) keep_reference(diagnosis, options.keep_reference, remarks);
  print_remarks("diagnose", remarks);
  if (options.json != "-" && options.series != "-") print_report(facts, diagnosis, verdict);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "RECORDING", options->input, "a .bag, or a .csv with --rig")->required();
  app.add_option("--rig", options->rig, "the rig; needed for a .csv, and where a bag holds several");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json, "write the report as JSON to this file; - is standard output");
  add_text_output(app, "--series", options->series,
                  "write signals, estimates and innovations as CSV, at most --series-rows rows; - is standard output");
  app.add_option("--series-rows", options->series_rows,
                 "default 4000; a recording of no more samples is written sample by sample")
      ->check(whole_number(8, 100000000));
  add_output(app, "--keep-reference", options->keep_reference,
             "write what the stages learnt of this healthy run to this file");
  add_input(app, "--reference", options->reference,
            "judge by what was learnt before instead of learning from this run");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(diagnose, {"diagnose", "say what is wrong in a recording, where, since when and how much",
                                "faultline diagnose leak.bag --json leak.json", add});

}  // namespace
}  // namespace faultline
