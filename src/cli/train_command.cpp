// `faultline train`: the weights of a stage's network, from recordings. The file is whole after every epoch (it takes
// the place of the one before at once) and holds the best weights so far; until the training has ended also all that
// --resume needs to go on as if it had never stopped.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <memory>

#include <unistd.h>

#include <fmt/format.h>
#include <boost/crc.hpp>

#include "cli/interrupt.h"
#include "cli/json_text.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/subcommand.h"
#include "faultline/estimators/estimator.h"
#include "faultline/networks/model.h"
#include "faultline/networks/training.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kProgressType = "training";
constexpr int kProgressVersion = 1;

struct Options {
  std::string rig, config, stage, output, from, feedback, json;
  std::vector<std::string> runs, validation;
  int epochs = 100, patience = 10;
  double horizon = 0, cold = 0;  // s
  std::uint64_t seed = 1;
  bool resume = false;
};

StageSpec stage_of(const Datasheet& sheet, const std::string& name) {
  std::string known;
  for (const StageSpec& spec : sheet.estimators) {
    if (estimator_type(spec).family != "neural") continue;
    if (name.empty() || spec.name == name) return spec;
    known += (known.empty() ? "" : ", ") + spec.name;
  }
  throw InputError(fmt::format("{}: there is no network {}to train; there are {}", sheet.file,
                               name.empty() ? "" : fmt::format("'{}' ", name), known.empty() ? "none" : known));
}

// Of all that the weights follow from, so that --resume goes on with the same.
std::uint32_t fingerprint(const Options& options, const NetworkShape& shape, const std::vector<NetworkRun>& training,
                          const std::vector<NetworkRun>& validation, const Eigen::VectorXd& initial) {
  boost::crc_32_type crc;
  const auto add = [&](const double* numbers, Eigen::Index count) {
    crc.process_bytes(numbers, static_cast<std::size_t>(count) * sizeof(double));
  };
  const double settings[] = {static_cast<double>(options.seed), static_cast<double>(shape.feedback), options.horizon,
                             options.cold};
  add(settings, 4);
  add(initial.data(), initial.size());
  for (const auto* runs : {&training, &validation})
    for (const NetworkRun& run : *runs) {
      add(run.inputs.data(), run.inputs.size());
      add(run.outputs.data(), run.outputs.size());
    }
  return crc.checksum();
}

Reference to_reference(const TrainingState& state, std::uint32_t fingerprint) {
  Reference r;
  r.type = kProgressType;
  r.version = kProgressVersion;
  r.names = {"fingerprint", "error", "damping", "epoch", "best_error", "best_epoch"};
  r.numbers = {static_cast<double>(fingerprint), state.error,      state.damping,
               static_cast<double>(state.epoch), state.best_error, static_cast<double>(state.best_epoch)};
  r.names.insert(r.names.end(), static_cast<std::size_t>(state.weights.size()), "weight");
  r.numbers.insert(r.numbers.end(), state.weights.begin(), state.weights.end());
  return r;
}

TrainingState to_state(const Reference& given, std::uint32_t fingerprint, const Eigen::VectorXd& best) {
  TrainingState state;
  state.weights = state.best = best;
  const Reference own = to_reference(state, 0);
  check_reference(given, own.type, own.version, own.names);
  const double* next = given.numbers.data();
  if (*next++ != fingerprint)
    throw InputError(
        "the training was of other recordings, seed or settings; give the same, or train anew without --resume");
  state.error = *next++;
  state.damping = *next++;
  state.epoch = static_cast<int>(*next++);
  state.best_error = *next++;
  state.best_epoch = static_cast<int>(*next++);
  state.weights = Eigen::Map<const Eigen::VectorXd>(next, best.size());
  return state;
}

std::string progress_name(const std::string& stage) { return stage + ".unfinished"; }

bool unfinished(const References& kept, const std::string& stage) {
  return std::any_of(kept.stages.begin(), kept.stages.end(),
                     [&](const StageReference& s) { return s.stage == progress_name(stage); });
}

struct Epoch {
  int epoch;
  double error, judged, damping, seconds;  // mean squares of scaled outputs; s of this processor
};

struct Answer {
  NetworkModel model;
  TrainingState state;
  std::vector<Epoch> epochs;
  std::vector<double> training_rms;
  double samples = 0, seconds = 0;  // s of this processor
  std::string ended;
};

std::vector<double> rms_of(const NetworkModel& model, const std::vector<NetworkRun>& runs, std::size_t cold) {
  const Eigen::VectorXd squares = mean_squares(model.shape, model.weights, runs, {0, cold});
  std::vector<double> rms;
  for (std::size_t o = 0; o < model.outputs.scale.size(); ++o)
    rms.push_back(model.outputs.scale[o] * std::sqrt(squares[static_cast<Eigen::Index>(o)]));
  return rms;
}

class Training {
 public:
  Training(const Options& options, const Datasheet& sheet, const StageSpec& spec)
      : options_(options), sheet_(sheet), spec_(spec), shape_(shape_of()) {
    training_ = runs_of(options.runs);
    if (!options.validation.empty()) validation_ = runs_of(options.validation);
    answer_.model.shape = shape_;
    answer_.model.trained = shape_.feedback;
    if (options.from.empty()) {
      answer_.model.inputs = scaling_of(training_, &NetworkRun::inputs);
      answer_.model.outputs = scaling_of(training_, &NetworkRun::outputs);
      answer_.model.weights = initial_weights(shape_, options.seed);
    } else {
      const NetworkModel from = read_network(options.from, sheet.rig, spec.name, shape_);
      answer_.model.inputs = from.inputs;
      answer_.model.outputs = from.outputs;
      answer_.model.weights = from.weights;
    }
    scale(answer_.model.inputs, answer_.model.outputs, training_);
    scale(answer_.model.inputs, answer_.model.outputs, validation_);
    if (std::filesystem::exists(options.output))
      for (StageReference& other : read_references(options.output, sheet.rig).stages)
        if (other.stage != spec.name && other.stage != progress_name(spec.name)) others_.push_back(std::move(other));
    fingerprint_ = fingerprint(options, shape_, training_, validation_, answer_.model.weights);
  }

  Answer run() {
    const Trainer trainer(shape_, training_, validation_, beginnings());
    answer_.samples = trainer.samples();
    const double begin = processor_time();
    TrainingState& state = answer_.state;
    state = options_.resume ? resumed() : trainer.begin(answer_.model.weights);
    if (!options_.resume) keep(false);
    watch_interrupts("train", options_.output + " holds the best weights so far; --resume goes on");
    answer_.ended = "all epochs are done";
    const bool tell = ::isatty(::fileno(stderr)) != 0;
    while (state.epoch < options_.epochs) {
      if (!validation_.empty() && state.epoch - state.best_epoch >= options_.patience) {
        answer_.ended = fmt::format("no better on the validation runs for {} epochs", options_.patience);
        break;
      }
      const double before = processor_time();
      if (!trainer.epoch(state)) {
        answer_.ended = "no step lowers the error any more";
        break;
      }
      answer_.epochs.push_back({state.epoch, state.error, state.best_error, state.damping, processor_time() - before});
      keep(false);
      if (tell)
        std::fputs(fmt::format("\r\033[Ktrain: epoch {} of {}, rms {:.5f}, best {:.5f} (of the outputs' standard "
                               "deviation), damping {:.0e}",
                               state.epoch, options_.epochs, std::sqrt(state.error), std::sqrt(state.best_error),
                               state.damping)
                       .c_str(),
                   stderr);
    }
    if (tell) std::fputs("\n", stderr);
    answer_.seconds = processor_time() - begin;
    keep(true);
    answer_.training_rms = rms_of(answer_.model, training_, beginnings().cold);
    return std::move(answer_);
  }

 private:
  static double processor_time() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

  Beginnings beginnings() const {
    const auto samples = [&](double time) { return static_cast<std::size_t>(std::ceil(time / shape_.period)); };
    const Beginnings b = {samples(options_.horizon), samples(options_.cold)};
    if (b.horizon > 0 && b.cold >= b.horizon)
      throw InputError("--cold must be shorter than --horizon, else nothing is left to learn from");
    return b;
  }

  NetworkShape shape_of() const {
    NetworkShape shape = network_shape(sheet_, spec_.settings);
    if (!options_.feedback.empty()) shape.feedback = feedback_of(options_.feedback, "--feedback");
    return shape;
  }

  std::vector<NetworkRun> runs_of(const std::vector<std::string>& files) const {
    std::vector<NetworkRun> runs;
    for (const std::string& file : files) {
      const LoadedRecording loaded = load_recording(file, options_.rig, options_.config);
      print_remarks("train", loaded.remarks);
      for (NetworkRun& run : network_runs(shape_, loaded.recording, file)) runs.push_back(std::move(run));
    }
    return runs;
  }

  TrainingState resumed() const {
    const References kept = read_references(options_.output, sheet_.rig);
    const NetworkModel model = read_network(options_.output, sheet_.rig, spec_.name, shape_);
    for (const auto& [name, reference] : kept.stages) {
      if (name != progress_name(spec_.name)) continue;
      try {
        return to_state(reference, fingerprint_, model.weights);
      } catch (const InputError& error) {
        throw InputError(fmt::format("{}: {}", options_.output, error.what()));
      }
    }
    throw InputError(fmt::format("{}: this training has ended; there is nothing to resume", options_.output));
  }

  // The best so far, beside other stages' networks in the file; until the end with what --resume needs.
  void keep(bool ended) {
    NetworkModel& model = answer_.model;
    model.weights = answer_.state.best;
    model.rms = rms_of(model, validation_.empty() ? training_ : validation_, beginnings().cold);
    References kept;
    kept.rig = sheet_.rig;
    kept.stages.push_back({spec_.name, faultline::to_reference(model)});
    kept.stages.insert(kept.stages.end(), others_.begin(), others_.end());
    if (!ended) kept.stages.push_back({progress_name(spec_.name), to_reference(answer_.state, fingerprint_)});
    write_references(kept, options_.output);
  }

  const Options& options_;
  const Datasheet& sheet_;
  const StageSpec& spec_;
  NetworkShape shape_;
  std::vector<NetworkRun> training_, validation_;
  std::vector<StageReference> others_;
  std::uint32_t fingerprint_ = 0;
  Answer answer_;
};

Json answer_json(const Datasheet& sheet, const StageSpec& spec, const Options& options, const Answer& answer) {
  Json json = {{"rig", sheet.rig},
               {"stage", spec.name},
               {"runs", options.runs},
               {"samples", answer.samples},
               {"weights", answer.model.weights.size()},
               {"ended", answer.ended},
               {"best_epoch", answer.state.best_epoch},
               {"processor_seconds", answer.seconds}};
  json["outputs"] = Json::array();
  for (std::size_t o = 0; o < answer.model.rms.size(); ++o) {
    const NetworkOutput& output = answer.model.shape.outputs[o];
    json["outputs"].push_back({{"channel", output.name},
                               {"unit", sheet.channels[output.channel].unit},
                               {"training_rms", answer.training_rms[o]}});
    if (!options.validation.empty()) json["outputs"].back()["validation_rms"] = answer.model.rms[o];
  }
  json["epochs"] = Json::array();
  for (const Epoch& e : answer.epochs)
    json["epochs"].push_back({{"epoch", e.epoch},
                              {"rms", std::sqrt(e.error)},
                              {"best", std::sqrt(e.judged)},
                              {"damping", e.damping},
                              {"processor_seconds", e.seconds}});
  return json;
}

void print_answer(const Datasheet& sheet, const StageSpec& spec, const Options& options, const Answer& answer) {
  fmt::print("{}: {} weights, {:.0f} samples, best after epoch {} of {} ({}), {:.1f} s of one processor\n", spec.name,
             answer.model.weights.size(), answer.samples, answer.state.best_epoch, answer.state.epoch, answer.ended,
             answer.seconds);
  for (std::size_t o = 0; o < answer.model.rms.size(); ++o) {
    const NetworkOutput& output = answer.model.shape.outputs[o];
    fmt::print("{:<26} rms error {:.4g}{} {}\n", output.name, answer.training_rms[o],
               options.validation.empty() ? "" : fmt::format(", validation {:.4g}", answer.model.rms[o]),
               sheet.channels[output.channel].unit);
  }
}

void run(const Options& options) {
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  const StageSpec spec = stage_of(sheet, options.stage);
  check_replaceable(options.output, sheet.rig);
  if (std::filesystem::exists(options.output) && !options.resume &&
      unfinished(read_references(options.output, sheet.rig), spec.name))
    throw InputError(fmt::format("{}: the file holds an unfinished training; --resume goes on with it, else remove it",
                                 options.output));
  const Answer answer = Training(options, sheet, spec).run();
  if (!options.json.empty()) write_text(options.json, json_text(answer_json(sheet, spec, options, answer)));
  if (options.json != "-") print_answer(sheet, spec, options, answer);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("RIG", options->rig, "the rig")->required();
  add_input(app, "RUN", options->runs, "recordings, .bag or .csv, of the healthy rig")->required();
  app.add_option("--stage", options->stage, "the stage of family neural; the rig's first without it");
  add_output(app, "-o,--output", options->output, "the file of weights, for the stage's 'weights'")->required();
  add_input(app, "--validate", options->validation, "recordings that choose the best epoch and end the training");
  add_input(app, "--from", options->from, "weights and scaling to begin with, of the same stage; else random weights");
  app.add_option("--feedback", options->feedback,
                 "none, own or all: in place of the stage's, for an earlier step of the training");
  app.add_option(
         "--horizon", options->horizon,
         "s, after which outputs that are fed back begin anew from what is measured, for an earlier step of the "
         "training [whole runs]")
      ->check(number_between(0, 1e6));
  app.add_option("--cold", options->cold,
                 "s; outputs that are fed back begin from their mean, and so long nothing is counted, lest the network "
                 "remembers where it began")
      ->check(number_between(0, 1e6));
  app.add_option("--epochs", options->epochs, "at most [100]")->check(whole_number(0, 100000));
  app.add_option("--patience", options->patience, "epochs without a better error on --validate before the end [10]")
      ->check(whole_number(1, 100000));
  app.add_option("--seed", options->seed, "of random weights [1]");
  app.add_flag("--resume", options->resume, "go on with the training that OUTPUT holds, from where it was stopped");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  add_text_output(app, "--json", options->json, "write the answer as JSON to this file; - is standard output");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(train, {"train", "train a stage's neural network on recordings",
                             "faultline train RIG run1.bag --validate run2.bag -o weights.txt", add});

}  // namespace
}  // namespace faultline
