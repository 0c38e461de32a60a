// `faultline import`: what a stand recorded in its own way becomes a recording of a rig.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <limits>
#include <memory>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "cli/import_mapped.h"
#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/sample_writer.h"
#include "cli/subcommand.h"
#include "faultline/signal/csv.h"
#include "faultline/signal/csv_table.h"
#include "faultline/signal/error.h"
#include "faultline/signal/sample_check.h"

namespace faultline {
namespace {

constexpr double kEpochSpan = 3e7;  // s after 2000-01-01, as of export

struct Options {
  std::vector<std::string> inputs;
  std::string output, rig, config, mapping, resample, compression = "lz4";
};

SampleFindings check(const Recording& recording, double period) {
  SampleCheck check(period);
  for (std::size_t row = 0; row < recording.rows(); ++row) check.add(recording.sample(row));
  return check.findings();
}

// A table tells time as `export` does: from 2000 where that is near, else from its first row; then says when that was.
void write(const Options& options, const Datasheet& sheet, const Recording& recording, const std::string& made_by,
           std::vector<std::string>& remarks) {
  const double first = recording.time.front();
  const bool is_table = ends_with(options.output, ".csv");
  const double zero = is_table && !(first >= 0 && first < kEpochSpan) ? first : 0;
  if (zero != 0) {
    const double whole = std::floor(first);
    remarks.push_back(fmt::format("t counts from {:%Y-%m-%dT%H:%M:%S}.{:06.0f}Z",
                                  fmt::gmtime(static_cast<std::time_t>(whole + kBagEpoch)), 1e6 * (first - whole)));
  }
  bool counted = true;
  for (std::size_t row = 0; counted && row < recording.rows(); ++row) counted = recording.sequence[row] == row;
  const auto writer =
      make_sample_writer(options.output, sheet, made_by, first, bag_compression(options.compression), !counted);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    Sample sample = recording.sample(row);
    sample.time -= zero;
    writer->write(sample);
  }
  writer->commit();
}

void finish(const Options& options, const Recording& recording, std::vector<std::string> remarks,
            const SampleFindings& findings, double period, const std::string& resampled) {
  for (const std::string& line : describe(findings, period, recording.time.front())) remarks.push_back(line);
  print_remarks("import", remarks);
  fmt::print("{}: {} samples, {:.6g} s of {}{}\n", options.output, recording.rows(),
             recording.time.back() - recording.time.front(), recording.rig, resampled);
}

void refuse_bag(const std::string& input) {
  if (ends_with(input, ".bag"))
    throw InputError(fmt::format("{}: bags are imported with --mapping, which says where each channel is", input));
}

// A table whose header names the rig's channels, with the rig's sample period.
void run_plain(const Options& options, const Datasheet& sheet) {
  const std::string& input = options.inputs.front();
  refuse_bag(input);
  if (options.inputs.size() > 1)
    throw InputError(
        fmt::format("{}: several files are imported with --mapping or --resample only", options.inputs[1]));
  const CsvContent content = read_csv(read_text(input), input, sheet.rig, sheet.channels);
  const SampleFindings findings = check(content.recording, sheet.sample_period);
  if (!period_fits(findings, sheet.sample_period))
    throw InputError(
        fmt::format("{}: samples come every {:.4g} s, {} says {:.4g} s; import with --resample rig, or give "
                    "the unit of t as in t[ms]",
                    input, findings.period, sheet.file, sheet.sample_period));
  std::vector<std::string> remarks;
  write(options, sheet, content.recording, "faultline import", remarks);
  for (const std::string& name : content.filled)
    remarks.push_back(fmt::format("no column '{}'; it is written as 0", name));
  for (const std::string& name : content.converted)
    remarks.push_back(fmt::format("column '{}' is converted to SI", name));
  finish(options, content.recording, remarks, findings, sheet.sample_period, "");
}

// Without a mapping the columns of the first table are called as the channels are.
Mapping mapping_of(const Options& options, const Datasheet& sheet) {
  double resample = std::numeric_limits<double>::quiet_NaN();
  if (!options.resample.empty()) resample = options.resample == "rig" ? 0 : std::stod(options.resample);
  if (!options.mapping.empty()) return read_mapping(options.mapping, sheet, resample);
  const std::string& input = options.inputs.front();
  refuse_bag(input);
  const std::string text = read_text(input);
  return mapping_by_names(input, CsvTable(text, input, {}).names(), sheet, resample);
}

void run_mapped(const Options& options, Datasheet sheet) {
  const Mapping mapping = mapping_of(options, sheet);
  MappedImport imported = import_mapped(options.inputs, mapping, sheet);

  std::string resampled;
  if (mapping.resample) {
    resampled = fmt::format(", resampled to {:.6g} s, anti-alias filter: {}", mapping.period,
                            imported.filter.empty() ? "none needed" : imported.filter);
    sheet.sample_period = mapping.period;  // what the bag's description says
  }
  const std::string by =
      options.mapping.empty() ? "" : " --mapping " + std::filesystem::path(options.mapping).filename().string();
  write(options, sheet, imported.recording, fmt::format("faultline import{}{}", by, resampled), imported.remarks);
  const SampleFindings findings = check(imported.recording, sheet.sample_period);
  finish(options, imported.recording, std::move(imported.remarks), findings, sheet.sample_period, resampled);
}

void run(const Options& options) {
  if (!ends_with(options.output, ".bag") && !ends_with(options.output, ".csv"))
    throw InputError(
        fmt::format("{}: import writes a bag or a table; give a name ending in .bag or .csv", options.output));
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  if (options.mapping.empty() && options.resample.empty())
    run_plain(options, sheet);
  else
    run_mapped(options, sheet);
}

// SECONDS, or nothing for the rig's own sample period.
CLI::Validator period_or_none() {
  const CLI::Validator number = number_between(1e-6, 1e6);
  return CLI::Validator([number](std::string& text) mutable { return text == "rig" ? std::string() : number(text); },
                        "");
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "FILE", options->inputs, "a table, its header t,channel,...; with --mapping any tables, or bags")
      ->required();
  app.add_option("--rig", options->rig, "the rig it was recorded on")->required();
  add_output(app, "-o,--output", options->output, "NAME.bag or NAME.csv")->required();
  add_input(app, "--mapping", options->mapping, "which topic or column is which channel (docs/import.md)");
  app.add_option("--resample", options->resample,
                 "put all signals on a common grid: SECONDS, or `rig` for the rig's sample period")
      ->check(period_or_none());
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_option("--compression", options->compression,
                 "of the bag: lz4 (default), bz2 (half as large, read five times as slowly) or none");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(import_recordings, {"import", "make a recording of a rig from somebody's own bags or tables",
                                         "faultline import run7.csv --rig RIG --mapping stand.yaml -o run7.bag", add});

}  // namespace
}  // namespace faultline
