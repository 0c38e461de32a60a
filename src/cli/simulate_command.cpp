// `faultline simulate`: a seeded run of a rig, with effects, into a bag or a CSV file. The same options and seed give
// the same bytes.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include <fmt/format.h>

#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/sample_writer.h"
#include "cli/subcommand.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/rig/simulator.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kLongest = 1e6;        // s
constexpr std::uint64_t kEvery = 1000;  // samples between looks at Ctrl-C and the progress line

struct Options {
  std::string rig, config, profile, fault, output, compression = "bz2";
  double duration = 0, substep = 0;
  std::uint64_t seed = 1, rig_seed = 1;
  bool rig_seed_given = false;
  std::vector<std::string> effects, commands;
  bool off_nominal = false, nuisance = false, quiet = false;
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
std::string made_by(const Options& options, const std::string& profile, double duration) {
  std::string text = fmt::format("faultline simulate {} --profile {} --duration {} --seed {}", options.rig, profile,
                                 duration, options.seed);
  if (!options.fault.empty()) text += " --fault " + options.fault;
  for (const std::string& effect : options.effects) text += " --effect " + effect;
  for (const std::string& command : options.commands) text += " --command " + command;
  if (options.off_nominal) text += " --off-nominal";
  if (options.rig_seed_given) text += fmt::format(" --rig-seed {}", options.rig_seed);
  if (options.nuisance) text += " --nuisance";
  if (options.substep > 0) text += fmt::format(" --substep {}", options.substep);
  return text;
}

void run(const Options& options) {
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  SimulationSetup setup;
  setup.seed = options.seed;
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
  if (setup.profile.empty() && sheet.profiles.empty())
    throw InputError(fmt::format("{}: the datasheet has no profiles", sheet.file));
  const Profile& profile = setup.profile.empty() ? sheet.profiles.front() : sheet.profile(setup.profile);
  const double duration = options.duration > 0 ? options.duration : profile.duration;
  if (!(duration > 0 && duration <= kLongest))
    throw InputError(fmt::format("--duration {}: give 0 to {:g} s", duration, kLongest));

  Simulator simulator(sheet, setup);
  const auto writer = make_sample_writer(options.output, sheet, made_by(options, profile.name, duration), 0,
                                         bag_compression(options.compression), false);
  const auto rows = static_cast<std::uint64_t>(std::llround(duration / sheet.sample_period)) + 1;
  const bool progress = !options.quiet && isatty(fileno(stderr)) != 0;
  for (std::uint64_t row = 0; row < rows; ++row) {
    if (row % kEvery == 0) {
      if (progress)
        std::fprintf(stderr, "\rsimulated %.0f of %.0f s", static_cast<double>(row) * sheet.sample_period, duration);
    }
    const Sample& sample = simulator.step();
    for (const double value : sample.values)
      if (!std::isfinite(value))
        throw InputError(fmt::format(
            "the simulation of {} became unbounded at {:.3f} s; make the effects smaller or --substep finer", sheet.rig,
            sample.time));
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
  app.add_option("--profile", options->profile,
                 "set points of the run, as in the datasheet; default: the fault's, else the first");
  app.add_option("--duration", options->duration, "s; default: the profile's")->check(number_between(1e-6, kLongest));
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
  app.add_option("--command", options->commands,
                 "CHANNEL:time=value,time=value,...: linear in between; may be given often")
      ->allow_extra_args(false);
  app.add_flag("--off-nominal", options->off_nominal, "draw the rig's parameters within their tolerances");
  app.add_flag("--nuisance", options->nuisance, "add the small effects that every recording of the rig carries");
  app.add_option("--substep", options->substep, "s, largest step of the integration; default: the rig's own")
      ->check(number_between(1e-7, 1.0));
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_option("--compression", options->compression, "of a bag: bz2 (default, smallest), lz4 or none");
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
