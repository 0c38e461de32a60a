// `faultline import`: a CSV file of a DAQ becomes a bag.
#include <memory>

#include <fmt/format.h>

#include "cli/load_recording.h"
#include "cli/options.h"
#include "cli/output_file.h"
#include "cli/sample_writer.h"
#include "cli/subcommand.h"
#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"
#include "faultline/signal/sample_check.h"

namespace faultline {
namespace {

struct Options {
  std::string input, output, rig, config, compression = "bz2";
};

void run(const Options& options) {
  if (!ends_with(options.output, ".bag"))
    throw InputError(fmt::format("{}: import writes a bag; give a name ending in .bag", options.output));
  const Datasheet sheet = load_datasheet(options.rig, options.config);
  const CsvContent content = read_csv(read_text(options.input), options.input, sheet.rig, sheet.channels);
  const Recording& recording = content.recording;
  SampleCheck check(sheet.sample_period);
  for (std::size_t row = 0; row < recording.rows(); ++row) check.add(recording.sample(row));
  const SampleFindings findings = check.findings();
  if (!period_fits(findings, sheet.sample_period))
    throw InputError(fmt::format(
        "{}: samples come every {:.4g} s, {} says {:.4g} s; resample the file, or give the unit of t as in t[ms]",
        options.input, findings.period, sheet.file, sheet.sample_period));

  const auto writer = make_sample_writer(options.output, sheet, "faultline import", recording.time.front(),
                                         bag_compression(options.compression), true);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    writer->write(recording.sample(row));
  }
  writer->commit();

  std::vector<std::string> remarks;
  for (const std::string& name : content.filled)
    remarks.push_back(fmt::format("no column '{}'; it is written as 0", name));
  for (const std::string& name : content.converted)
    remarks.push_back(fmt::format("column '{}' is converted to SI", name));
  for (const std::string& line : describe(findings, sheet.sample_period, recording.time.front()))
    remarks.push_back(line);
  print_remarks("import", remarks);
  fmt::print("{}: {} samples, {:.6g} s of {}\n", options.output, recording.rows(),
             recording.time.back() - recording.time.front(), sheet.rig);
}

std::function<void()> add(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  add_input(app, "CSV", options->input, "header t,channel,... in SI units, or channel[unit]")->required();
  app.add_option("--rig", options->rig, "the rig it was recorded on")->required();
  add_output(app, "-o,--output", options->output, "NAME.bag")->required();
  add_input(app, "--config", options->config, "a datasheet to read instead of the rig's own");
  app.add_option("--compression", options->compression, "of the bag: bz2 (default, smallest), lz4 or none");
  return [options] { run(*options); };
}

FAULTLINE_SUBCOMMAND(import_csv,
                     {"import", "make a bag of a CSV file", "faultline import run7.csv --rig RIG -o run7.bag", add});

}  // namespace
}  // namespace faultline
