#include "faultline/signal/csv.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "faultline/signal/csv_table.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "faultline/signal/units.h"

namespace faultline {
namespace {

constexpr double kLargestTime = 1e9;  // s; beyond, nanoseconds no longer fit
constexpr std::size_t kShownText = 40;

enum class Kind { time, sequence, channel };

struct Column {
  Kind kind = Kind::channel;
  std::size_t channel = 0;
  bool converted = false;  // a unit of its own: `conversion` applies
  Conversion conversion;
  std::string name;
};

class Reader {
 public:
  Reader(const std::string& file, const std::string& rig, const std::vector<Channel>& channels)
      : file_(file), rig_(rig), channels_(channels) {
    content_.recording.rig = rig;
    content_.recording.channels = channels;
  }

  CsvContent read(const std::string& text) {
    CsvTable table(text, file_, {});
    table_ = &table;
    read_header();
    while (table.next()) read_row();
    if (content_.recording.rows() == 0)
      throw InputError(fmt::format("{}: there is a header but no sample below it", file_));
    return std::move(content_);
  }

 private:
  void read_header() {
    bool time_seen = false, sequence_seen = false;
    std::vector<bool> seen(channels_.size(), false);
    const auto fail = [this](const std::string& message) { table_->fail(message); };
    for (const std::string& written : table_->names()) {
      Column column;
      column.name = printable(written.substr(0, kShownText));
      std::string name = written, unit;
      const auto bracket = name.find('[');
      if (bracket != std::string::npos) {
        if (name.back() != ']')
          fail(fmt::format("column '{}': write the unit in brackets behind the name, as in position[mm]", column.name));
        unit = name.substr(bracket + 1, name.size() - bracket - 2);
        name.resize(bracket);
        name.erase(name.find_last_not_of(" \t") + 1);
      }
      std::string own_unit;
      if (name == "t" || (name == "time" && find_channel(channels_, name) < 0)) {
        if (time_seen) fail("there are two columns of the time, 't' or 'time'");
        time_seen = true;
        column.kind = Kind::time;
        own_unit = "s";
      } else if (name == "sequence") {
        if (sequence_seen) fail("there are two columns 'sequence'");
        sequence_seen = true;
        column.kind = Kind::sequence;
        own_unit = "1";
      } else {
        const int channel = find_channel(channels_, name);
        if (channel < 0)
          fail(fmt::format(
              "column '{}' is not a channel of {}; rename or remove it, or import with --mapping; the channels are {}; "
              "time is the column t or time",
              column.name, rig_, channel_names()));
        column.channel = static_cast<std::size_t>(channel);
        if (seen[column.channel]) fail(fmt::format("there are two columns '{}'", name));
        seen[column.channel] = true;
        own_unit = channels_[column.channel].unit;
      }
      if (!unit.empty() && unit != own_unit) {
        try {
          column.conversion = conversion(unit, own_unit);
        } catch (const InputError& error) {
          fail(fmt::format("column '{}': {}", column.name, error.what()));
        }
        column.converted = true;
        content_.converted.push_back(column.name);
      }
      columns_.push_back(column);
    }
    if (!time_seen) fail("there is no column 't' or 'time' (in s); import with --mapping if it has another name");
    std::string absent;
    for (std::size_t c = 0; c < channels_.size(); ++c) {
      if (seen[c]) continue;
      if (channels_[c].ground_truth || channels_[c].role == Role::setpoint)
        content_.filled.push_back(channels_[c].name);
      else
        absent += (absent.empty() ? "" : ", ") + channels_[c].name;
    }
    if (!absent.empty()) fail(fmt::format("{} needs columns that are not here: {}", rig_, absent));
    sample_.values.assign(channels_.size(), 0.0);
  }

  void read_row() {
    const auto fail = [this](const std::string& message) { table_->fail(message); };
    Recording& recording = content_.recording;
    sample_.sequence = recording.rows();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const Column& column = columns_[i];
      double value = table_->number(i);
      if (column.converted) value = column.conversion(value);
      if (column.kind == Kind::channel) {
        if (std::isnan(value)) ++content_.missing;
        sample_.values[column.channel] = value;
      } else if (column.kind == Kind::time) {
        if (!(std::abs(value) <= kLargestTime))
          fail(fmt::format("column '{}': '{}' is not a time; it must be a number within +-1e9 s", column.name,
                           table_->shown(i)));
        if (recording.rows() > 0 && !(value > recording.time.back()))
          fail(fmt::format(
              "time runs backwards or stands still: {:.9g} s after {:.9g} s; sort the samples and remove duplicates",
              value, recording.time.back()));
        sample_.time = value;
      } else {
        if (!(value >= 0 && value < 9007199254740992.0) || value != std::floor(value))
          fail(fmt::format("column 'sequence': '{}' is not a whole number", table_->shown(i)));
        sample_.sequence = static_cast<std::uint64_t>(value);
      }
    }
    recording.append(sample_);
  }

  std::string channel_names() const {
    std::string names;
    for (const Channel& channel : channels_) names += (names.empty() ? "" : ", ") + channel.name;
    return names;
  }

  const std::string& file_;
  const std::string& rig_;
  const std::vector<Channel>& channels_;
  std::vector<Column> columns_;
  CsvTable* table_ = nullptr;
  Sample sample_;
  CsvContent content_;
};

void append_time(std::string& text, double time) {
  fmt::format_to(std::back_inserter(text), "{}", static_cast<double>(std::llround(time * 1e9)) / 1e9);
}

void append_values(std::string& text, const std::vector<double>& values) {
  for (const double value : values) {
    if (std::isnan(value))
      text += ",nan";  // never -nan
    else
      fmt::format_to(std::back_inserter(text), ",{}", value);
  }
  text += '\n';
}

}  // namespace

CsvContent read_csv(const std::string& text, const std::string& file, const std::string& rig,
                    const std::vector<Channel>& channels) {
  return Reader(file, rig, channels).read(text);
}

std::string csv_header(const std::vector<Channel>& channels, bool with_sequence) {
  std::string text = with_sequence ? "t,sequence" : "t";
  for (const Channel& channel : channels) text += "," + channel.name;
  return text + "\n";
}

void append_csv_row(std::string& text, double time, const std::vector<double>& values) {
  append_time(text, time);
  append_values(text, values);
}

void append_csv_row(std::string& text, double time, std::uint64_t sequence, const std::vector<double>& values) {
  append_time(text, time);
  fmt::format_to(std::back_inserter(text), ",{}", sequence);
  append_values(text, values);
}

}  // namespace faultline
