// `faultline export`: a bag becomes a CSV file that brings back every number and, imported again, the same bag.
#include <memory>

#include <fmt/format.h>

#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/sample_writer.h"
#include "cli/subcommand.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kEpochSpan =
    3e7;  // s; bags that begin this soon after kBagEpoch count from it, all others from their first sample

struct Options {
  std::string input, output, rig, config;
};

void run(const Options& options) {
  if (!ends_with(options.output, ".csv"))
    throw InputError(fmt::format("{}: export writes CSV; give a name ending in .csv", options.output));
  const LoadedRecording loaded = load_recording(options.input, options.rig, options.config, Period::of_run);
  const Recording& recording = loaded.recording;
  const bool from_epoch = loaded.start >= kBagEpoch && loaded.start < kBagEpoch + kEpochSpan;
  const std::int64_t zero = from_epoch ? static_cast<std::int64_t>(kBagEpoch) * 1000000000 : loaded.stamp.front();
  bool counted = true;
  for (std::size_t row = 0; counted && row < recording.rows(); ++row) counted = recording.sequence[row] == row;

  const auto writer = make_sample_writer(options.output, loaded.sheet, "", 0, BagCompression::none, !counted);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    Sample sample = recording.sample(row);
    sample.time = static_cast<double>(loaded.stamp[row] - zero) / 1e9;
    writer->write(sample);
  }
  writer->commit();
  print_remarks("export", loaded.remarks);
  fmt::print("{}: {} samples, {:.6g} s of {}\n", options.output, recording.rows(), loaded.end - loaded.start,
             loaded.sheet.rig);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "BAG", options->input, "a recording")->required();
  add_output(app, "-o,--output", options->output, "NAME.csv")->required();
  app.add_option("--rig", options->rig, "whose samples, if the bag holds several rigs");
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(export_csv, {"export", "make a CSV file of a bag", "faultline export run7.bag -o run7.csv", add});

}  // namespace
}  // namespace faultline
