#include "faultline/signal/csv.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "faultline/signal/units.h"

namespace faultline {
namespace {

constexpr double kLargestTime = 1e9;  // s; beyond, nanoseconds no longer fit
constexpr std::size_t kShownText = 40;

struct Span {
  const char* begin;
  const char* end;
  std::string text() const { return std::string(begin, end); }
  bool empty() const { return begin == end; }
};

Span trimmed(const char* begin, const char* end) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (begin < end && blank(*begin)) ++begin;
  while (end > begin && blank(end[-1])) --end;
  if (end - begin >= 2 && *begin == '"' && end[-1] == '"') return {begin + 1, end - 1};
  return {begin, end};
}

void split(const char* begin, const char* end, std::vector<Span>& cells) {
  cells.clear();
  for (;;) {
    const char* comma = static_cast<const char*>(std::memchr(begin, ',', static_cast<std::size_t>(end - begin)));
    cells.push_back(trimmed(begin, comma ? comma : end));
    if (!comma) return;
    begin = comma + 1;
  }
}

// What a message can show of a cell: one line, not too long, nothing that a terminal would act on.
std::string shown(const Span& cell) { return printable(cell.text().substr(0, kShownText)); }

// False where the cell is not a number. An empty cell is NaN. Text behind the cell ends strtod: a comma or a line's
// end.
bool read_number(const Span& cell, double& value) {
  value = std::numeric_limits<double>::quiet_NaN();
  if (cell.empty()) return true;
  for (const char* c = cell.begin; c < cell.end; ++c)
    if (*c == 'x' || *c == 'X' || *c == '(') return false;  // hexadecimal and nan(...) are not numbers here
  char* end = nullptr;
  const double number = std::strtod(cell.begin, &end);
  if (end != cell.end) return false;
  if (std::isfinite(number)) value = number;
  return true;
}

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
    const char* at = text.c_str();
    const char* const end = at + text.size();
    if (end - at >= 3 && std::memcmp(at, "\xEF\xBB\xBF", 3) == 0) at += 3;
    bool header_seen = false;
    while (at < end) {
      ++line_;
      const void* found = std::memchr(at, '\n', static_cast<std::size_t>(end - at));
      const char* stop = found ? static_cast<const char*>(found) : end;
      const Span line = trimmed(at, stop);
      if (!line.empty() && *line.begin != '#') {
        split(at, stop, cells_);
        header_seen ? read_row() : read_header();
        header_seen = true;
      }
      at = stop + 1;
    }
    if (!header_seen)
      throw InputError(fmt::format("{}: the file is empty; the first line must be t,channel,...", file_));
    if (content_.recording.rows() == 0)
      throw InputError(fmt::format("{}: there is a header but no sample below it", file_));
    return std::move(content_);
  }

 private:
  [[noreturn]] void fail(const std::string& message) const {
    throw InputError(fmt::format("{}:{}: {}", file_, line_, message));
  }

  void read_header() {
    bool time_seen = false, sequence_seen = false;
    std::vector<bool> seen(channels_.size(), false);
    if (cells_.size() == 1 && cells_[0].text().find_first_of(";\t") != std::string::npos)
      fail("columns must be separated by commas");
    for (const Span& cell : cells_) {
      Column column;
      column.name = shown(cell);
      std::string name = cell.text(), unit;
      const auto bracket = name.find('[');
      if (bracket != std::string::npos) {
        if (name.back() != ']')
          fail(fmt::format("column '{}': write the unit in brackets behind the name, as in position[mm]", column.name));
        unit = name.substr(bracket + 1, name.size() - bracket - 2);
        name = trimmed(name.data(), name.data() + bracket).text();
      }
      std::string own_unit;
      if (name == "t") {
        if (time_seen) fail("there are two columns 't'");
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
          fail(fmt::format("column '{}' is not a channel of {}; rename or remove it; the channels are {}", column.name,
                           rig_, channel_names()));
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
    if (!time_seen) fail("there is no column 't' (time in s)");
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
    if (cells_.size() != columns_.size())
      fail(fmt::format("the line has {} cells, the header has {}", cells_.size(), columns_.size()));
    Recording& recording = content_.recording;
    sample_.sequence = recording.rows();
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      const Column& column = columns_[i];
      double value = 0;
      if (!read_number(cells_[i], value))
        fail(fmt::format("column '{}': '{}' is not a number", column.name, shown(cells_[i])));
      if (column.converted) value = column.conversion(value);
      if (column.kind == Kind::channel) {
        if (std::isnan(value)) ++content_.missing;
        sample_.values[column.channel] = value;
      } else if (column.kind == Kind::time) {
        if (!(std::abs(value) <= kLargestTime))
          fail(fmt::format("column '{}': '{}' is not a time; it must be a number within +-1e9 s", column.name,
                           shown(cells_[i])));
        if (recording.rows() > 0 && !(value > recording.time.back()))
          fail(fmt::format(
              "time runs backwards or stands still: {:.9g} s after {:.9g} s; sort the samples and remove duplicates",
              value, recording.time.back()));
        sample_.time = value;
      } else {
        if (!(value >= 0 && value < 9007199254740992.0) || value != std::floor(value))
          fail(fmt::format("column 'sequence': '{}' is not a whole number", shown(cells_[i])));
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
  std::vector<Span> cells_;
  Sample sample_;
  std::size_t line_ = 0;
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
