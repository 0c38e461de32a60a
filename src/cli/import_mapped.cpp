#include "cli/import_mapped.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/interrupt.h"
#include "cli/output_file.h"
#include "faultline/rig/nearest_name.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/date_time.h"
#include "faultline/signal/error.h"
#include "faultline/signal/sample_check.h"
#include "faultline/signal/text.h"
#include "nodes/field_reader.h"

namespace faultline {
namespace {

constexpr double kUnixTime = 1e9;        // s; a column of times that begins later counts from 1970
constexpr double kUnixZero = 946684800;  // s, from there to 2000
constexpr double kLargestTime = 1e9;     // s; beyond, nanoseconds no longer fit
constexpr std::size_t kSteps = 1000;     // intervals that tell a signal's period, as in sample_check.h
constexpr std::size_t kNamed = 12;       // names in a remark

std::string some_of(const std::vector<std::string>& names) {
  const std::size_t count = std::min(names.size(), kNamed);
  const std::string more = names.size() > count ? fmt::format(" and {} more", names.size() - count) : "";
  return joined(std::vector<std::string>(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(count))) + more;
}

// What is known of one signal after its last value.
struct SignalCount {
  std::uint64_t values = 0, missing = 0;
  double last = 0;
  std::vector<double> steps;

  void add(double time) {
    if (values++ > 0 && steps.size() < kSteps) steps.push_back(time - last);
    last = time;
  }
  double period() const {
    if (steps.empty()) return 0;
    std::vector<double> sorted = steps;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    return *middle;
  }
};

class Importer {
 public:
  Importer(const Mapping& mapping, const Datasheet& sheet)
      : mapping_(mapping), sheet_(sheet), counts_(mapping.channels.size()), held_(counts_.size()) {
    result_.recording.rig = sheet.rig;
    result_.recording.channels = sheet.channels;
    sample_.values.resize(sheet.channels.size());
  }

  MappedImport bags(const std::vector<std::string>& files) {
    check_topics(mapping_);
    nlohmann::json request = {{"files", files}, {"time", mapping_.clock}, {"fields", nlohmann::json::array()}};
    for (const MappedChannel& mapped : mapping_.channels) {
      request["fields"].push_back(mapped.from);
      conversions_.push_back(mapped.conversion(sheet_.channels[mapped.channel], mapped.unit));
    }
    make_assembler();
    FieldReader reader("read_bag_fields.py", request.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace),
                       mapping_.channels.size());
    watch_child(reader.child());
    for (FieldRecord record; (record = reader.next(-1)).kind != FieldRecord::Kind::end;) {
      if (record.kind == FieldRecord::Kind::note) note(nlohmann::json::parse(record.text));
      if (record.kind != FieldRecord::Kind::value) continue;
      if (!first_stamp_) first_stamp_ = record.stamp;
      // Intervals from whole nanoseconds: seconds since 2000 are good to 0.1 us only.
      push(record.field, seconds_of_stamp(record.stamp), static_cast<double>(record.stamp - *first_stamp_) * 1e-9,
           record.value, files.front());
    }
    watch_child(0);
    return finish(files.front());
  }

  MappedImport tables(const std::vector<std::string>& files) {
    if (files.size() > 1 && mapping_.constant_period > 0)
      throw InputError(
          fmt::format("{}: files without a column of time cannot follow each other; import them one by one", files[1]));
    if (mapping_.clock != "auto")
      throw InputError(
          fmt::format("{}: 'time: {}' is for bags; name a column, or a period", mapping_.file, mapping_.clock));
    make_assembler();
    for (const std::string& file : files) read_table(file);
    return finish(files.front());
  }

 private:
  const Channel& channel(std::size_t signal) const { return sheet_.channels[mapping_.channels[signal].channel]; }

  void make_assembler() {
    const double never = std::numeric_limits<double>::infinity();
    assembler_ =
        std::make_unique<RowAssembler>(assembly_plan(mapping_, sheet_, never),
                                       [this](double time, std::uint64_t row, const std::vector<double>& values) {
                                         sample_.time = time;
                                         sample_.sequence = row;
                                         arrange_row(mapping_, values, sample_.values);
                                         result_.recording.append(sample_);
                                       });
  }

  void push(std::size_t signal, double time, double since_first, double raw, const std::string& file) {
    const double value = std::isfinite(raw) ? conversions_[signal](raw) : std::numeric_limits<double>::quiet_NaN();
    SignalCount& count = counts_[signal];
    if (std::isnan(value)) ++count.missing;
    const double before = assembler_->newest(signal);
    if (assembler_->push(signal, time, value) == RowAssembler::Taken::backward)
      throw InputError(
          fmt::format("{}: time of {} runs backwards or stands still: {:.6f} s after {:.6f} s since 1970; sort the "
                      "messages, or say time: receipt in the mapping",
                      file, mapping_.channels[signal].from, time + kUnixZero, before + kUnixZero));
    if (!std::isnan(value)) count.add(since_first);
  }

  void note(const nlohmann::json& told) {
    std::vector<std::string> by_receipt;
    for (const auto& [topic, clock] : told.at("clock").items())
      if (clock == "receipt") by_receipt.push_back(topic);
    if (!by_receipt.empty() && mapping_.clock == "auto")
      result_.remarks.push_back(
          fmt::format("no header stamp in {}: taken at the time of receipt", some_of(by_receipt)));
    const auto unused = told.at("unused").get<std::vector<std::string>>();
    if (!unused.empty()) result_.remarks.push_back("topics not used: " + some_of(unused));
  }

  // The column that `name` means: as it is written, or without a unit in brackets behind it.
  std::size_t column(const CsvTable& table, const std::string& name, const std::string& who) const {
    const std::vector<std::string>& names = table.names();
    std::vector<std::string> shown, near;
    std::vector<std::size_t> exact, without_unit;
    for (std::size_t c = 0; c < names.size(); ++c) {
      shown.push_back(printable(names[c]));
      if (names[c] == name) exact.push_back(c);
      const std::string bare = names[c].substr(0, names[c].find_last_of('['));
      if (bare.size() == names[c].size()) continue;
      near.push_back(printable(bare.substr(0, bare.find_last_not_of(' ') + 1)));
      if (near.back() == name) without_unit.push_back(c);
    }
    const std::vector<std::size_t>& found = exact.empty() ? without_unit : exact;
    if (found.size() > 1) table.fail(fmt::format("{}: there are {} columns '{}'; rename one", who, found.size(), name));
    if (found.size() == 1) return found.front();
    near.insert(near.end(), shown.begin(), shown.end());
    table.fail(fmt::format("{}: there is no column '{}'; there are {}{}", who, name, some_of(shown),
                           did_you_mean(name, near)));
  }

  // Of `load[bar]`; empty: none.
  static std::string bracket(const std::string& name) {
    const std::size_t open = name.find_last_of('[');
    if (open == std::string::npos || name.back() != ']') return "";
    return name.substr(open + 1, name.size() - open - 2);
  }

  void read_table(const std::string& file) {
    const std::string text = read_text(file);
    CsvTable table(text, file, mapping_.table);
    std::set<std::size_t> used;
    std::vector<std::size_t> columns;
    conversions_.clear();
    for (const MappedChannel& mapped : mapping_.channels) {
      const Channel& to = sheet_.channels[mapped.channel];
      columns.push_back(column(table, mapped.from, mapped.place));
      used.insert(columns.back());
      const std::string& name = table.names()[columns.back()];
      const std::string unit = mapped.unit.empty() ? bracket(name) : mapped.unit;
      try {
        conversions_.push_back(mapped.conversion(to, unit));
      } catch (const InputError& error) {
        table.fail(fmt::format("column '{}': {}; say its unit in the mapping", printable(name), error.what()));
      }
      if (mapped.unit.empty() && !unit.empty() && unit != to.unit)
        result_.remarks.push_back(fmt::format("column '{}' is converted to {}", printable(name), to.unit));
    }
    std::size_t time_column = 0;
    double time_scale = 1;
    if (mapping_.constant_period == 0) {
      const std::string name = mapping_.time_column.empty() ? "t" : mapping_.time_column;
      time_column = column(table, name,
                           mapping_.time_column.empty()
                               ? "the mapping names no column of time (time: NAME, or time: {period: SECONDS})"
                               : "time");
      used.insert(time_column);
      std::string unit = mapping_.time_unit;
      if (unit.empty()) unit = bracket(table.names()[time_column]);
      try {
        time_scale = unit.empty() ? 1 : conversion(unit, "s").scale;
      } catch (const InputError& error) {
        table.fail(fmt::format("column '{}': {}; say its unit in the mapping", printable(table.names()[time_column]),
                               error.what()));
      }
    }
    for (std::uint64_t row = 0; table.next(); ++row) {
      const double time = mapping_.constant_period > 0 ? mapping_.constant_period * static_cast<double>(row)
                                                       : time_of(table, time_column, time_scale);
      if (last_time_ && !(time > *last_time_))
        table.fail(fmt::format(
            "time runs backwards or stands still: {:.9g} s after {:.9g} s; sort the rows and remove doubled ones", time,
            *last_time_));
      if (!(std::abs(time) <= kLargestTime))
        table.fail(fmt::format("{:g} s is no time; is the unit of the times right?", time));
      last_time_ = time;
      take_row(table, columns, time, file);
    }
    std::vector<std::string> unused;
    for (std::size_t c = 0; c < table.names().size(); ++c)
      if (used.count(c) == 0 && !table.names()[c].empty()) unused.push_back(printable(table.names()[c]));
    if (!unused.empty()) result_.remarks.push_back("columns not used: " + some_of(unused));
    if (table.dialect().decimal == ',' && mapping_.table.decimal == '\0')
      result_.remarks.push_back("numbers have decimal commas");
  }

  double time_of(const CsvTable& table, std::size_t column, double scale) {
    const auto no_time = [&](const char* remedy) {
      table.fail(
          fmt::format("column '{}': '{}' is no time{}", printable(table.names()[column]), table.shown(column), remedy));
    };
    const std::string text = table.text(column);
    if (!mapping_.time_format.empty() || text.find(':') != std::string::npos) {
      const std::optional<double> time = parse_date_time(text, mapping_.time_format);
      if (!time)
        no_time(mapping_.time_format.empty() ? "; say how it is written, as in format: \"%d.%m.%Y %H:%M:%S\""
                                             : " of the mapping's format");
      return *time;
    }
    const double time = scale * table.number(column);
    if (std::isnan(time)) no_time("");
    if (!last_time_ && time >= kUnixTime) {
      from_unix_ = true;
      result_.remarks.push_back("times are taken as seconds since 1970");
    }
    return from_unix_ ? time - kUnixZero : time;
  }

  // On the common grid an empty cell is a signal that was not sampled then. Rows that stay as they are keep it as a
  // value that is missing, unless the mapping lets the last one hold.
  void take_row(const CsvTable& table, const std::vector<std::size_t>& columns, double time, const std::string& file) {
    std::fill(sample_.values.begin(), sample_.values.end(), 0.0);
    for (std::size_t signal = 0; signal < columns.size(); ++signal) {
      const double raw = table.number(columns[signal]);
      SignalCount& count = counts_[signal];
      if (mapping_.resample) {
        if (std::isnan(raw))
          ++count.missing;
        else
          push(signal, time, time, raw, file);
        continue;
      }
      double value = conversions_[signal](raw);
      if (!std::isnan(value)) {
        count.add(time);
        held_[signal] = value;
      } else {
        ++count.missing;
        if (count.values > 0 && time - count.last <= mapping_.channels[signal].hold) value = held_[signal];
      }
      sample_.values[mapping_.channels[signal].channel] = value;
    }
    if (mapping_.resample) return;
    sample_.time = time;
    sample_.sequence = result_.recording.rows();
    result_.recording.append(sample_);
  }

  MappedImport finish(const std::string& file) {
    for (std::size_t signal = 0; signal < counts_.size(); ++signal) {
      const bool measured = !is_held(channel(signal));
      if (counts_[signal].values < (measured ? 2u : 1u))
        throw InputError(fmt::format("{}: {} has {}; '{}' needs more", file, mapping_.channels[signal].from,
                                     counts_[signal].values == 0 ? "no value" : "one value only",
                                     channel(signal).name));
    }
    check_periods(file);
    assembler_->finish();
    const Recording& recording = result_.recording;
    if (recording.rows() == 0)
      throw InputError(
          fmt::format("{}: no row can be made: the signals have no time in common, or it is shorter than "
                      "the filter reaches",
                      file));
    tell_missing(file);
    tell_range();
    tell_filter();
    if (mapping_.period != sheet_.sample_period)
      result_.remarks.push_back(
          fmt::format("rows come every {:.6g} s, {} says {:.6g} s: not every subcommand takes that", mapping_.period,
                      sheet_.file, sheet_.sample_period));
    const std::vector<std::string> filled = unmapped(mapping_, sheet_);
    if (!filled.empty()) result_.remarks.push_back("not mapped, written as 0: " + some_of(filled));
    std::vector<std::string> once;  // files of one kind say the same
    for (const std::string& remark : result_.remarks)
      if (std::find(once.begin(), once.end(), remark) == once.end()) once.push_back(remark);
    result_.remarks = once;
    return std::move(result_);
  }

  // Rows as they come need signals that all come at the rig's sample period.
  void check_periods(const std::string& file) {
    std::vector<std::string> found;
    for (std::size_t signal = 0; signal < counts_.size(); ++signal) {
      const double period = counts_[signal].period();
      SampleFindings findings;
      findings.period = period;
      const bool same = period_fits(findings, mapping_.period);
      if (!mapping_.resample && !is_held(channel(signal)) && !same)
        throw InputError(
            fmt::format("{}: {} comes every {:.4g} s, {} says {:.4g} s; import with --resample, or say the "
                        "unit of the times in the mapping",
                        file, mapping_.channels[signal].from, period, sheet_.file, sheet_.sample_period));
      if (mapping_.resample && !same && !is_held(channel(signal)))
        found.push_back(fmt::format("{} every {:.4g} s", channel(signal).name, period));
    }
    const std::size_t leader = assembly_plan(mapping_, sheet_, 0).leader;
    result_.remarks.push_back(
        fmt::format("period found {:.6g} s, the rig's is {:.6g} s", counts_[leader].period(), sheet_.sample_period));
    if (!found.empty())
      result_.remarks.push_back(fmt::format("resampled to {:.6g} s: {}", mapping_.period, some_of(found)));
  }

  void tell_missing(const std::string& file) {
    const Recording& recording = result_.recording;
    std::vector<std::string> told;
    for (std::size_t signal = 0; signal < counts_.size(); ++signal) {
      std::size_t missing = 0;
      for (std::size_t row = 0; row < recording.rows(); ++row)
        missing += std::isnan(recording.at(row, mapping_.channels[signal].channel));
      if (missing == 0) continue;
      if (!mapping_.resample && 2 * missing > recording.rows() && 2 * counts_[signal].missing < recording.rows())
        throw InputError(
            fmt::format("{}: {} has a value within half a period of {} of {} rows only; import with "
                        "--resample",
                        file, mapping_.channels[signal].from, recording.rows() - missing, recording.rows()));
      told.push_back(fmt::format("{} {}", channel(signal).name, missing));
      if (is_held(channel(signal)) && std::isnan(mapping_.channels[signal].hold) && missing > counts_[signal].missing)
        result_.remarks.push_back(
            fmt::format("'{}' paused for longer than {:g} times its longest interval before; if it is sent on change "
                        "only, say hold: .inf in the mapping",
                        channel(signal).name, kGapPeriods));
    }
    if (!told.empty())
      result_.remarks.push_back(
          fmt::format("rows without a value: {} (gaps longer than {:g} periods stay)", some_of(told), kGapPeriods));
  }

  void tell_range() {
    const Recording& recording = result_.recording;
    std::vector<std::string> told;
    for (std::size_t signal = 0; signal < counts_.size(); ++signal) {
      const Channel& to = channel(signal);
      std::size_t outside = 0;
      for (std::size_t row = 0; row < recording.rows(); ++row) {
        const double value = recording.at(row, mapping_.channels[signal].channel);
        outside += value < to.minimum || value > to.maximum;
      }
      if (outside > 0)
        told.push_back(fmt::format("{} {} ({:g} to {:g} {})", to.name, outside, to.minimum, to.maximum, to.unit));
    }
    if (!told.empty()) result_.remarks.push_back("readings out of range, kept: " + some_of(told));
  }

  void tell_filter() {
    std::map<std::string, std::vector<std::string>> by_filter;
    for (std::size_t signal = 0; signal < counts_.size(); ++signal)
      if (assembler_->filtered(signal))
        by_filter[assembler_->filter().describe(assembler_->own_period(signal))].push_back(channel(signal).name);
    for (const auto& [filter, names] : by_filter)
      result_.filter += fmt::format("{}{} on {}", result_.filter.empty() ? "" : "; ", filter, joined(names));
  }

  const Mapping& mapping_;
  const Datasheet& sheet_;
  std::vector<SignalCount> counts_;
  std::vector<double> held_;  // last values
  std::vector<Conversion> conversions_;
  std::unique_ptr<RowAssembler> assembler_;
  std::optional<double> last_time_;  // of a table's rows
  bool from_unix_ = false;
  std::optional<std::int64_t> first_stamp_;  // ns
  Sample sample_;
  MappedImport result_;
};

}  // namespace

MappedImport import_mapped(const std::vector<std::string>& files, const Mapping& mapping, const Datasheet& sheet) {
  std::size_t bags = 0;
  for (const std::string& file : files) bags += ends_with(file, ".bag");
  if (bags != 0 && bags != files.size())
    throw InputError(fmt::format("{}: bags and tables cannot be imported together; import one kind", files.front()));
  Importer importer(mapping, sheet);
  return bags > 0 ? importer.bags(files) : importer.tables(files);
}

}  // namespace faultline
