#include "cli/load_recording.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

#include "cli/bag_file.h"
#include "cli/output_file.h"
#include "cli/share_folder.h"
#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "nodes/rig_packages.h"

namespace faultline {
namespace {

void take_bag(const std::string& file, const std::string& rig, const std::string& config, LoadedRecording& loaded) {
  BagContent content = read_bag(file, rig);
  loaded.sheet = load_datasheet(content.described && rig.empty() ? content.description.rig : content.rig, config);
  loaded.recording.rig = loaded.sheet.rig;
  loaded.recording.channels = loaded.sheet.channels;
  loaded.recording.time = std::move(content.time);
  loaded.stamp = std::move(content.stamp);
  loaded.recording.sequence = std::move(content.sequence);
  const std::size_t width = loaded.sheet.channels.size();
  if (!content.described) {
    if (content.width != width)
      throw InputError(
          fmt::format("{}: samples have {} values, {} has {} channels, and the bag holds no /{}/description that would "
                      "tell which is which",
                      file, content.width, loaded.sheet.rig, width, loaded.sheet.rig));
    loaded.remarks.push_back(fmt::format(
        "{}: no /{}/description in the bag; channels are taken in the datasheet's order", file, loaded.sheet.rig));
    loaded.recording.values = std::move(content.values);
    return;
  }
  loaded.made_by = content.description.made_by;
  std::vector<std::size_t> places;
  try {
    places = match_channels(loaded.sheet, content.description);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: {}", file, error.what()));
  }
  if (content.width != content.description.names.size())
    throw InputError(fmt::format("{}: samples have {} values, the description names {} channels", file, content.width,
                                 content.description.names.size()));
  bool same = places.size() == content.width;
  for (std::size_t i = 0; same && i < places.size(); ++i) same = places[i] == i;
  if (same) {
    loaded.recording.values = std::move(content.values);
    return;
  }
  loaded.recording.values.reserve(loaded.recording.time.size() * width);
  for (std::size_t row = 0; row < loaded.recording.time.size(); ++row)
    for (const std::size_t place : places)
      loaded.recording.values.push_back(content.values[row * content.width + place]);
}

void take_csv(const std::string& file, const std::string& rig, const std::string& config, LoadedRecording& loaded) {
  if (rig.empty() && config.empty())
    throw InputError(fmt::format("{}: a CSV file does not say its rig; name it with --rig", file));
  loaded.sheet = load_datasheet(rig, config);
  CsvContent content = read_csv(read_text(file), file, loaded.sheet.rig, loaded.sheet.channels);
  loaded.recording = std::move(content.recording);
  loaded.stamp.reserve(loaded.recording.rows());
  for (double& time : loaded.recording.time) {
    loaded.stamp.push_back(stamp_in_bag(time));
    time = time_in_bag(time);
  }
  for (const std::string& name : content.filled)
    loaded.remarks.push_back(fmt::format("{}: no column '{}'; it is taken as 0", file, name));
}

// Numbers in another unit than the datasheet's lie outside its ranges.
void remark_ranges(const std::string& file, LoadedRecording& loaded) {
  const Recording& recording = loaded.recording;
  for (std::size_t c = 0; c < recording.columns(); ++c) {
    const Channel& channel = recording.channels[c];
    std::size_t outside = 0;
    for (std::size_t row = 0; row < recording.rows(); ++row) {
      const double value = recording.row(row)[c];
      outside += value < channel.minimum || value > channel.maximum;
    }
    if (2 * outside > recording.rows())
      loaded.remarks.push_back(
          fmt::format("{}: {} of {} numbers of '{}' are outside {:g} to {:g} {}: is that its unit?", file, outside,
                      recording.rows(), channel.name, channel.minimum, channel.maximum, channel.unit));
  }
}

}  // namespace

Datasheet load_datasheet(const std::string& rig, const std::string& config) {
  if (config.empty()) {
    note_left_out(rig);
    return find_datasheet(share_folder() + "/config", outside_rigs(), rig);
  }
  Datasheet sheet = read_datasheet(config, outside_rigs());
  if (!rig.empty() && sheet.rig != rig)
    throw InputError(fmt::format("{}: the datasheet is of the rig '{}', the recording of '{}'; give the right one",
                                 config, sheet.rig, rig));
  return sheet;
}

LoadedRecording load_recording(const std::string& file, const std::string& rig, const std::string& config) {
  LoadedRecording loaded;
  if (ends_with(file, ".bag"))
    take_bag(file, rig, config, loaded);
  else if (ends_with(file, ".csv"))
    take_csv(file, rig, config, loaded);
  else
    throw InputError(fmt::format("{}: a recording is a .bag or a .csv file", file));

  const Recording& recording = loaded.recording;
  SampleCheck check(loaded.sheet.sample_period);
  Sample sample;
  sample.values.resize(recording.columns());
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    sample.time = recording.time[row];
    sample.sequence = recording.sequence[row];
    std::copy_n(recording.row(row), recording.columns(), sample.values.begin());
    check.add(sample);
  }
  loaded.findings = check.findings();
  loaded.start = recording.time.front();
  loaded.end = *std::max_element(recording.time.begin(), recording.time.end());
  if (!period_fits(loaded.findings, loaded.sheet.sample_period))
    throw InputError(
        fmt::format("{}: samples come every {:.4g} s, {} says {:.4g} s; resample the recording or give the right "
                    "datasheet with --config",
                    file, loaded.findings.period, loaded.sheet.file, loaded.sheet.sample_period));
  for (const std::string& line : describe(loaded.findings, loaded.sheet.sample_period, loaded.start))
    loaded.remarks.push_back(file + ": " + line);
  remark_ranges(file, loaded);
  return loaded;
}

void note_left_out(const std::string& asked_for) {
  static bool told = false;
  if (!std::exchange(told, true))
    for (const std::string& line : left_out(asked_for))
      std::fprintf(stderr, "faultline: note: %s\n", printable(line).c_str());
}

void print_remarks(const std::string& subcommand, const std::vector<std::string>& remarks) {
  for (const std::string& remark : remarks)
    std::fprintf(stderr, "faultline %s: note: %s\n", subcommand.c_str(), printable(remark).c_str());
}

}  // namespace faultline
