#include "faultline/rig/mapping.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "faultline/rig/nearest_name.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kShortest = 1e-6, kLongest = 1e6;  // s, of a sample period

char one_character(const YamlValue& value) {
  const std::string text = value.text();
  if (text == "tab" || text == "\\t") return '\t';
  if (text.size() != 1) value.fail(fmt::format("is '{}', it must be one character, or tab", text));
  return text.front();
}

double in_seconds(const YamlValue& value, const std::string& unit) {
  try {
    return conversion(unit, "s").scale;
  } catch (const InputError& error) {
    value.fail(fmt::format("is no unit of time: {}", error.what()));
  }
}

void read_time(const YamlValue& value, Mapping& mapping) {
  if (!value.is_mapping()) {
    const std::string word = value.text();
    (word == "header" || word == "receipt" || word == "auto" ? mapping.clock : mapping.time_column) = word;
    return;
  }
  value.allow({}, {"column", "unit", "format", "period"});
  if (value.has("column") == value.has("period"))
    value.fail("needs one of the keys 'column' and 'period': a column of times, or s between rows");
  if (value.has("unit")) mapping.time_unit = value.at("unit").text();
  const double scale = value.has("unit") ? in_seconds(value.at("unit"), mapping.time_unit) : 1;
  if (value.has("period")) {
    if (value.has("format")) value.fail("has a format, which goes with a column of times; remove it");
    mapping.constant_period = scale * value.at("period").number(kShortest / scale, kLongest / scale);
    return;
  }
  mapping.time_column = value.at("column").text();
  if (!value.has("format")) return;
  if (value.has("unit")) value.fail("has a format and a unit; a date-time has no unit, remove one of them");
  mapping.time_format = value.at("format").text();
}

void read_table(const YamlValue& value, CsvDialect& table) {
  value.allow({}, {"separator", "decimal", "comment", "names_line", "data_line"});
  if (value.has("separator")) table.separator = one_character(value.at("separator"));
  if (value.has("decimal")) {
    table.decimal = one_character(value.at("decimal"));
    if (table.decimal != '.' && table.decimal != ',') value.at("decimal").fail("must be . or ,");
  }
  if (value.has("comment")) table.comment = one_character(value.at("comment"));
  const auto line = [&](const char* key, double least) {
    const YamlValue entry = value.at(key);
    const double number = entry.number(least, 1e9);
    if (number != std::floor(number)) entry.fail("must be the number of a line");
    return static_cast<int>(number);
  };
  if (value.has("names_line")) table.names_line = line("names_line", 0);
  if (value.has("data_line")) table.data_line = line("data_line", 1);
  if (table.data_line > 0 && table.data_line <= table.names_line)
    value.at("data_line").fail("must be a line below names_line");
}

void read_resample(const YamlValue& value, Mapping& mapping, const Datasheet& sheet) {
  if (value.is_number()) {
    mapping.resample = true;
    mapping.period = value.number(kShortest, kLongest);
    return;
  }
  mapping.resample = value.truth();
  mapping.period = sheet.sample_period;
}

MappedChannel read_channel(const YamlValue& value, const Datasheet& sheet) {
  std::vector<std::string> names;
  for (const Channel& channel : sheet.channels) names.push_back(channel.name);
  const int found = find_channel(sheet.channels, value.key());
  if (found < 0)
    value.fail(fmt::format("is no channel of {}; its channels are {}{}", sheet.rig, joined(names),
                           did_you_mean(value.key(), names)));
  MappedChannel mapped;
  mapped.channel = static_cast<std::size_t>(found);
  mapped.place = value.place();
  const Channel& channel = sheet.channels[mapped.channel];
  if (!value.is_mapping()) {
    mapped.from = value.text();
    return mapped;
  }
  value.allow({"from"}, {"unit", "scale", "offset", "sign", "hold"});
  mapped.from = value.at("from").text();
  if (value.has("unit")) mapped.unit = value.at("unit").text();
  if (value.has("scale")) mapped.scale = value.at("scale").number();
  if (mapped.scale == 0) value.at("scale").fail("is 0: that would leave nothing of the signal");
  if (value.has("offset")) mapped.offset = value.at("offset").number();
  if (value.has("sign")) {
    mapped.sign = value.at("sign").number();
    if (std::abs(mapped.sign) != 1) value.at("sign").fail("must be 1 or -1; for other factors there is scale");
  }
  if (value.has("hold")) {
    mapped.hold = value.at("hold").bound();
    if (!(mapped.hold > 0)) value.at("hold").fail("must be a time in s above 0, or .inf");
    if (!is_held(channel))
      value.at("hold").fail(fmt::format("is for commands and set points; '{}' is measured", channel.name));
  }
  try {
    mapped.conversion(channel, mapped.unit);
  } catch (const InputError& error) {
    value.at("unit").fail(fmt::format("does not fit: {}", error.what()));
  }
  return mapped;
}

// Of what the rig needs; empty: nothing.
std::string what_lacks(const Mapping& mapping, const Datasheet& sheet) {
  std::vector<std::string> absent;
  for (const std::string& name : unmapped(mapping, sheet)) {
    const Channel& channel = sheet.channels[static_cast<std::size_t>(find_channel(sheet.channels, name))];
    if (!channel.ground_truth && channel.role != Role::setpoint) absent.push_back(name);
  }
  if (!absent.empty()) return fmt::format("lacks channels that {} needs: {}", sheet.rig, joined(absent));
  const auto measured = [&](const MappedChannel& mapped) { return !is_held(sheet.channels[mapped.channel]); };
  if (std::any_of(mapping.channels.begin(), mapping.channels.end(), measured)) return "";
  return "names no measured channel; one at least must be there";
}

}  // namespace

bool is_held(const Channel& channel) { return channel.role == Role::command || channel.role == Role::setpoint; }

Conversion MappedChannel::conversion(const Channel& to, const std::string& from_unit) const {
  Conversion unit_change;
  if (!from_unit.empty() && from_unit != to.unit) unit_change = faultline::conversion(from_unit, to.unit);
  Conversion whole;
  whole.scale = unit_change.scale * sign * scale;
  whole.offset = unit_change.scale * sign * offset + unit_change.offset;
  return whole;
}

Mapping read_mapping(const std::string& file, const Datasheet& sheet, double resample) {
  const YamlValue root = YamlValue::load(file, "mapping", "channels:");
  root.allow({"channels"}, {"time", "csv", "resample"});
  Mapping mapping;
  mapping.file = file;
  mapping.period = sheet.sample_period;
  if (root.has("time")) read_time(root.at("time"), mapping);
  if (root.has("csv")) read_table(root.at("csv"), mapping.table);
  if (root.has("resample")) read_resample(root.at("resample"), mapping, sheet);
  if (!std::isnan(resample)) {
    mapping.resample = true;
    mapping.period = resample > 0 ? resample : sheet.sample_period;
  }
  const YamlValue channels = root.at("channels");
  std::map<std::string, std::string> taken;
  for (const YamlValue& entry : channels.entries()) {
    mapping.channels.push_back(read_channel(entry, sheet));
    const MappedChannel& last = mapping.channels.back();
    const auto [first, is_new] = taken.emplace(last.from, entry.key());
    if (!is_new)
      entry.fail(fmt::format("comes from '{}', and so does '{}'; each channel has a source of its own", last.from,
                             first->second));
  }
  const std::string lacking = what_lacks(mapping, sheet);
  if (!lacking.empty()) channels.fail(lacking);
  return mapping;
}

Mapping mapping_by_names(const std::string& file, const std::vector<std::string>& columns, const Datasheet& sheet,
                         double resample) {
  Mapping mapping;
  mapping.file = file;
  mapping.resample = true;
  mapping.period = resample > 0 ? resample : sheet.sample_period;
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const std::string& name = sheet.channels[c].name;
    const auto means = [&](const std::string& column) { return column.substr(0, column.find('[')) == name; };
    if (std::none_of(columns.begin(), columns.end(), means)) continue;
    MappedChannel mapped;
    mapped.channel = c;
    mapped.from = name;
    mapped.place = fmt::format("{}: '{}'", file, name);
    mapping.channels.push_back(mapped);
  }
  const std::string lacking = what_lacks(mapping, sheet);
  if (!lacking.empty()) throw InputError(fmt::format("{}: {}", file, lacking));
  return mapping;
}

void check_topics(const Mapping& mapping) {
  for (const MappedChannel& mapped : mapping.channels)
    if (mapped.from.front() != '/')
      throw InputError(fmt::format("{} comes from '{}', which is no /topic/field; name the topic and the field in it",
                                   mapped.place, mapped.from));
  if (!mapping.time_column.empty() || mapping.constant_period > 0)
    throw InputError(
        fmt::format("{}: 'time' is that of a table; for topics it is header, receipt or auto", mapping.file));
}

AssemblyPlan assembly_plan(const Mapping& mapping, const Datasheet& sheet, double wait) {
  AssemblyPlan plan;
  plan.period = mapping.period;
  plan.resample = mapping.resample;
  plan.wait = wait;
  for (const MappedChannel& mapped : mapping.channels)
    plan.signals.push_back({is_held(sheet.channels[mapped.channel]), mapped.hold});
  const auto measured = std::find_if(plan.signals.begin(), plan.signals.end(), [](const auto& s) { return !s.held; });
  plan.leader = static_cast<std::size_t>(measured - plan.signals.begin());
  return plan;
}

void arrange_row(const Mapping& mapping, const std::vector<double>& row, std::vector<double>& values) {
  std::fill(values.begin(), values.end(), 0.0);
  for (std::size_t i = 0; i < row.size(); ++i) values[mapping.channels[i].channel] = row[i];
}

std::vector<std::string> unmapped(const Mapping& mapping, const Datasheet& sheet) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const auto is_this = [&](const MappedChannel& mapped) { return mapped.channel == c; };
    if (std::none_of(mapping.channels.begin(), mapping.channels.end(), is_this))
      names.push_back(sheet.channels[c].name);
  }
  return names;
}

}  // namespace faultline
