// `faultline simulate`: a seeded run of a rig, with effects, into a bag or a CSV file; or, with --drive, the rig's
// model under the commands and inputs of a recording, row by row at its times, from the states that its first row
// shows. The same options and seed give the same bytes.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include <fmt/format.h>

#include "cli/bag_file.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/sample_writer.h"
#include "cli/subcommand.h"
#include "faultline/rig/driven_model.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/rig/simulator.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kLongest = 1e8;        // s: a rig that is sampled every 100 s moves over months
constexpr double kAnyInternal = 1e12;   // range of an internal variable, which no sensor bounds
constexpr std::uint64_t kEvery = 1000;  // samples between looks at Ctrl-C and the progress line

struct Options {
  std::string rig, config, profile, fault, drive, output, compression = "lz4";
  double duration = 0, substep = 0;
  std::uint64_t seed = 1, rig_seed = 1;
  bool rig_seed_given = false;
  std::vector<std::string> effects, commands;
  bool off_nominal = false, nuisance = false, no_noise = false, internals = false, quiet = false;
};

double read_number(const std::string& text, const std::string& whole) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value))
    throw InputError(
        fmt::format("--command '{}': '{}' is not a number; write CHANNEL:time=value,time=value", whole, text));
  return value;
}

// CHANNEL:time=value,time=value,...
CommandTable read_table(const Datasheet& sheet, const std::string& text) {
  const auto colon = text.find(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == text.size())
    throw InputError(fmt::format("--command '{}': write CHANNEL:time=value,time=value", text));
  CommandTable table;
  table.channel = text.substr(0, colon);
  const Channel& channel = sheet.channels[static_cast<std::size_t>(sheet.channel(table.channel))];
  if (channel.role != Role::command)
    throw InputError(fmt::format("--command '{}': {} is no command of {}", text, table.channel, sheet.rig));
  for (std::size_t begin = colon + 1; begin < text.size();) {
    const auto comma = std::min(text.find(',', begin), text.size());
    const std::string item = text.substr(begin, comma - begin);
    const auto equals = item.find('=');
    if (equals == std::string::npos)
      throw InputError(fmt::format("--command '{}': '{}' has no '='; write time=value", text, item));
    const double time = read_number(item.substr(0, equals), text), value = read_number(item.substr(equals + 1), text);
    if (!table.time.empty() && time <= table.time.back())
      throw InputError(fmt::format("--command '{}': times must rise, {} does not", text, time));
    if (value < channel.minimum || value > channel.maximum)
      throw InputError(fmt::format("--command '{}': {} is outside {}..{} {}", text, value, channel.minimum,
                                   channel.maximum, channel.unit));
    table.time.push_back(time);
    table.value.push_back(value);
    begin = comma + 1;
  }
  return table;
}

void add_effect(const Datasheet& sheet, const std::string& text, SimulationSetup& setup) {
  const EffectSpec spec = parse_effect(text);
  check_effect(sheet, spec);
  setup.effects.push_back(spec);
}

// How the run could be made again, for the bag's description.
std::string made_by(const Options& options, const std::string& run) {
  std::string text = fmt::format("faultline simulate {} {} --seed {}", options.rig, run, options.seed);
  if (!options.fault.empty()) text += " --fault " + options.fault;
  for (const std::string& effect : options.effects) text += " --effect " + effect;
  for (const std::string& command : options.commands) text += " --command " + command;
  if (options.off_nominal) text += " --off-nominal";
  if (options.rig_seed_given) text += fmt::format(" --rig-seed {}", options.rig_seed);
  if (options.nuisance) text += " --nuisance";
  if (options.no_noise) text += " --no-noise";
  if (options.internals) text += " --internals";
  if (options.substep > 0) text += fmt::format(" --substep {}", options.substep);
  return text;
}

// The equations show an internal variable where a channel bears its name.
void record_internals(Datasheet& sheet) {
  if (sheet.not_recorded.empty())
    throw InputError(fmt::format("--internals: {} has no internal variables; {} lists none under 'not_recorded'",
                                 sheet.rig, sheet.file));
  for (Channel channel : sheet.not_recorded) {
    channel.role = Role::output;
    channel.minimum = -kAnyInternal;
    channel.maximum = kAnyInternal;
    sheet.channels.push_back(channel);
  }
}

SimulationSetup setup_of(const Datasheet& sheet, const Options& options) {
  SimulationSetup setup;
  setup.seed = options.seed;
  setup.noise = !options.no_noise;
  setup.substep = options.substep;
  setup.profile = options.profile;
  if (options.nuisance)
    for (const std::string& effect : sheet.nuisance) add_effect(sheet, effect, setup);
  if (!options.fault.empty()) {
    const Fault& fault = sheet.fault(options.fault);
    for (const std::string& effect : fault.effects) add_effect(sheet, effect, setup);
    setup.commands = fault.commands;
    if (setup.profile.empty()) setup.profile = fault.profile;
  }
  for (const std::string& effect : options.effects) add_effect(sheet, effect, setup);
  for (const std::string& command : options.commands) {
    const CommandTable table = read_table(sheet, command);
    for (const CommandTable& other : setup.commands)
      if (other.channel == table.channel)
        throw InputError(fmt::format("--command '{}': {} already has a table, from another --command or from --fault",
                                     command, table.channel));
    setup.commands.push_back(table);
  }
  if (options.rig_seed_given && !options.off_nominal)
    throw InputError("--rig-seed draws the parameters of a rig that is off its datasheet; give --off-nominal too");
  if (options.off_nominal)
    setup.parameters = draw_parameters(sheet, options.rig_seed_given ? options.rig_seed : options.seed);
  return setup;
}

void refuse_unbounded(const Sample& sample, const std::string& rig, double start) {
  for (const double value : sample.values)
    if (!std::isfinite(value))
      throw InputError(
          fmt::format("the simulation of {} became unbounded at {:.3f} s; make the effects smaller or --substep finer",
                      rig, sample.time - start));
}

// What drives the model: commands and inputs of each row, at the last good value where one is missing, and a copy of a
// row for every sample that was lost after it. `rows`: where each row of the recording stands.
Recording driving(const LoadedRecording& loaded, double period, std::vector<std::size_t>& rows) {
  const Recording& recording = loaded.recording;
  Recording result;
  result.rig = recording.rig;
  result.channels = recording.channels;
  Sample held = recording.sample(0);
  for (std::size_t c = 0; c < held.values.size(); ++c)
    if (!std::isfinite(held.values[c]))
      for (std::size_t row = 1; row < recording.rows() && !std::isfinite(held.values[c]); ++row)
        held.values[c] = recording.at(row, c);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const double step = row > 0 ? recording.time[row] - recording.time[row - 1] : period;
    if (step <= 0)
      throw InputError(fmt::format("--drive: time does not rise after {:.6g} s; cut the recording there",
                                   recording.time[row] - loaded.start));
    for (auto lost = std::llround(step / period) - 1; lost > 0; --lost) {
      held.time += period;
      result.append(held);
    }
    for (std::size_t c = 0; c < held.values.size(); ++c) {
      if (std::isfinite(recording.at(row, c))) held.values[c] = recording.at(row, c);
      if (!std::isfinite(held.values[c]) && result.channels[c].role != Role::output &&
          result.channels[c].role != Role::setpoint)
        throw InputError(fmt::format("--drive: the recording has no number for '{}', which drives the model",
                                     result.channels[c].name));
    }
    held.time = recording.time[row];
    rows.push_back(result.rows());
    result.append(held);
  }
  return result;
}

// Returns how many rows were written. `zero`: ns since 1970, from which the writer counts time.
std::uint64_t drive(const Options& options, const LoadedRecording& loaded, const SimulationSetup& setup,
                    std::int64_t zero, SampleWriter& writer) {
  const Datasheet& sheet = loaded.sheet;
  std::vector<std::size_t> rows;
  const Recording recording = driving(loaded, setup.sample_period, rows);
  std::vector<double> start;
  for (const State& state : sheet.states)
    start.push_back(state.channel < 0 ? std::nan("") : loaded.recording.at(0, static_cast<std::size_t>(state.channel)));
  Random noise = sensor_noise(options.seed);
  DrivenModel model(sheet, setup);
  Sample sample;
  std::size_t next = 0;
  model.run(recording, 0, recording.rows(), {0}, start.data(), [&](std::size_t row, const double* predicted) {
    if (next >= rows.size() || rows[next] != row) return;
    const std::int64_t stamp = loaded.stamp[next];
    sample = loaded.recording.sample(next++);
    for (std::size_t c = 0; c < sample.values.size(); ++c) {
      const Channel& channel = sheet.channels[c];
      if (channel.role != Role::output) continue;
      sample.values[c] = setup.noise ? measured_value(channel, predicted[c], noise) : predicted[c];
      if (!std::isfinite(sample.values[c])) refuse_unbounded(sample, sheet.rig, loaded.start);
    }
    sample.time = static_cast<double>(stamp - zero) / 1e9;
    writer.write(sample);
  });
  return next;
}

void run_driven(const Options& options) {
  const LoadedRecording loaded = load_recording(options.drive, options.rig, options.config, Period::of_run);
  print_remarks("simulate", loaded.remarks);
  SimulationSetup setup = setup_of(loaded.sheet, options);
  setup.sample_period =
      period_fits(loaded.findings, loaded.sheet.sample_period) ? loaded.sheet.sample_period : loaded.findings.period;
  if (!setup.commands.empty())
    throw InputError(
        fmt::format("--fault {}: it moves commands, which the recording gives; leave --drive out", options.fault));
  // A bag keeps its stamps; a CSV file of one that was recorded elsewhere counts from its first sample.
  const auto epoch = static_cast<std::int64_t>(kBagEpoch) * 1000000000;
  const bool far = loaded.start < kBagEpoch || loaded.start > kBagEpoch + kLongest;
  const std::int64_t zero = far && !ends_with(options.output, ".bag") ? loaded.stamp.front() : epoch;
  bool counted = true;
  for (std::size_t row = 0; counted && row < loaded.recording.rows(); ++row)
    counted = loaded.recording.sequence[row] == row;
  const auto writer = make_sample_writer(options.output, loaded.sheet, made_by(options, "--drive " + options.drive),
                                         static_cast<double>(loaded.stamp.front() - zero) / 1e9,
                                         bag_compression(options.compression), !counted);
  const std::uint64_t rows = drive(options, loaded, setup, zero, *writer);
  writer->commit();
  if (!options.quiet)
    fmt::print("{}: {} samples, {:g} s of {}, driven by {}\n", options.output, rows, loaded.end - loaded.start,
               loaded.sheet.rig, options.drive);
}

void run(const Options& options) {
  if (options.internals && ends_with(options.output, ".bag"))
    throw InputError("--internals: a bag holds what the rig measures; write a CSV file");
  if (!options.drive.empty()) return run_driven(options);
  Datasheet sheet = load_datasheet(options.rig, options.config);
  if (options.internals) record_internals(sheet);
  const SimulationSetup setup = setup_of(sheet, options);
  if (setup.profile.empty() && sheet.profiles.empty())
    throw InputError(
        fmt::format("{}: the datasheet has no profiles; drive the model by a recording (--drive)", sheet.file));
  const Profile& profile = setup.profile.empty() ? sheet.profiles.front() : sheet.profile(setup.profile);
  const double duration = options.duration > 0 ? options.duration : profile.duration;
  if (!(duration > 0 && duration <= kLongest))
    throw InputError(fmt::format("--duration {}: give 0 to {:g} s", duration, kLongest));

  Simulator simulator(sheet, setup);
  const auto writer = make_sample_writer(
      options.output, sheet, made_by(options, fmt::format("--profile {} --duration {}", profile.name, duration)), 0,
      bag_compression(options.compression), false);
  const auto rows = static_cast<std::uint64_t>(std::llround(duration / sheet.sample_period)) + 1;
  const bool progress = !options.quiet && isatty(fileno(stderr)) != 0;
  for (std::uint64_t row = 0; row < rows; ++row) {
    if (row % kEvery == 0) {
      if (progress)
        std::fprintf(stderr, "\rsimulated %.0f of %.0f s", static_cast<double>(row) * sheet.sample_period, duration);
    }
    const Sample& sample = simulator.step();
    refuse_unbounded(sample, sheet.rig, 0);
    writer->write(sample);
  }
  writer->commit();
  if (progress) std::fprintf(stderr, "\r\033[K");
  if (!options.quiet)
    fmt::print("{}: {} samples, {:g} s of {}, profile {}\n", options.output, rows, duration, sheet.rig, profile.name);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  app.add_option("RIG", options->rig, "the rig, as `faultline rigs` lists it")->required();
  add_output(app, "-o,--output", options->output, "NAME.bag or NAME.csv")->required();
  CLI::Option* profile =
      app.add_option("--profile", options->profile,
                     "set points of the run, as in the datasheet; default: the fault's, else the first");
  CLI::Option* duration = app.add_option("--duration", options->duration, "s; default: the profile's")
                              ->check(number_between(1e-6, kLongest));
  app.add_option("--seed", options->seed, "of noise, random set points and --off-nominal; default 1")
      ->check(whole_number(0, UINT64_MAX));
  const CLI::Option* rig_seed =
      app.add_option("--rig-seed", options->rig_seed,
                     "of --off-nominal alone: the same rig in runs of several --seed; default: --seed")
          ->check(whole_number(0, UINT64_MAX));
  app.add_option("--effect", options->effects,
                 "EFFECT@PORT:name=value,...[,from=S][,to=S][,swells=N]; may be given often")
      ->allow_extra_args(false);
  app.add_option("--fault", options->fault, "a named fault of the datasheet");
  CLI::Option* command = app.add_option("--command", options->commands,
                                        "CHANNEL:time=value,time=value,...: linear in between; may be given often")
                             ->allow_extra_args(false);
  app.add_flag("--off-nominal", options->off_nominal, "draw the rig's parameters within their tolerances");
  app.add_flag("--nuisance", options->nuisance, "add the small effects that every recording of the rig carries");
  app.add_flag("--no-noise", options->no_noise, "outputs as they are, without sensor noise and rounding");
  CLI::Option* drive = add_input(app, "--drive", options->drive,
                                 "a recording whose commands and inputs drive the model, from its first row")
                           ->excludes(profile)
                           ->excludes(duration)
                           ->excludes(command);
  app.add_flag("--internals", options->internals,
               "add the variables that the rig does not measure (a CSV file holds them)")
      ->excludes(drive);
  app.add_option("--substep", options->substep, "s, largest step of the integration; default: the rig's own")
      ->check(number_between(1e-7, 1.0));
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_option("--compression", options->compression,
                 "of a bag: lz4 (default), bz2 (half as large, read five times as slowly) or none");
  app.add_flag("--quiet", options->quiet, "say nothing but errors");
  return [options, rig_seed] {
    options->rig_seed_given = rig_seed->count() > 0;
    run(*options);
  };
}

FAULTLINE_SUBCOMMAND(simulate, {"simulate", "run a rig's model with effects and write a recording",
                                "faultline simulate RIG --duration 60 --seed 3 --effect "
                                "orifice_leakage@flow.FROM_TO:coefficient=1e-8,from=20,to=40 -o leak.bag",
                                add});

}  // namespace
}  // namespace faultline
