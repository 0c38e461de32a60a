// A mapping: where each channel of a rig is found in somebody's own recordings or topics, in which unit, and by which
// clock. One file serves `faultline import` and the live driver; docs/import.md tells its schema.
//
//   value [channel's unit] = convert(sign (scale raw + offset) [unit])
// Reading is strict (yaml_reader.h): unknown and doubled keys, a channel that the rig has not, a unit that does not
// convert, two channels on one source, and a measured channel or command without a source are InputErrors of one line.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/csv_table.h"
#include "faultline/signal/row_assembly.h"
#include "faultline/signal/units.h"

namespace faultline {

struct MappedChannel {
  std::size_t channel = 0;  // of the datasheet
  std::string from;         // /topic/field, or a column's name
  std::string place;        // FILE:LINE: 'key', for messages
  std::string unit;         // as given; empty: not given
  double scale = 1, offset = 0;
  double sign = 1;
  double hold = std::numeric_limits<double>::quiet_NaN();  // s; NaN: not given

  // The conversion of a raw number in `unit` (the channel's own where it is empty) to the channel's unit.
  Conversion conversion(const Channel& channel, const std::string& unit) const;
};

struct Mapping {
  std::string file;

  std::string clock = "auto";  // of topics: header, receipt, or auto: the header where it has a stamp
  std::string time_column;     // of tables; empty: t
  std::string time_unit;       // empty: s
  std::string time_format;     // of a date-time, by strptime; empty: ISO 8601 where the text is no number
  double constant_period = 0;  // s; > 0: the table has no column of time
  CsvDialect table;

  bool resample = false;
  double period = 0;                    // s, of the rows: `resample`, else the rig's sample period
  std::vector<MappedChannel> channels;  // in the order of the file
};

// `resample` [s]: as asked for on the command line: NaN: not, 0: at the rig's sample period. Overrides the file's.
Mapping read_mapping(const std::string& file, const Datasheet& sheet,
                     double resample = std::numeric_limits<double>::quiet_NaN());

// That of a table whose columns are called as the rig's channels are, with or without a unit in brackets. `file` is for
// messages; `resample` as above, but given. InputError: the columns lack a measured channel or a command.
Mapping mapping_by_names(const std::string& file, const std::vector<std::string>& columns, const Datasheet& sheet,
                         double resample);

// The mapping is of topics, not of columns: else InputError.
void check_topics(const Mapping& mapping);

// Signals are the mapping's channels in their order. Rows come at the stamps of the first measured one, unless they
// are resampled.
AssemblyPlan assembly_plan(const Mapping& mapping, const Datasheet& sheet, double wait);

// Whether a channel's last value holds until the next one, or it is measured.
bool is_held(const Channel& channel);

// The values of a row in the datasheet's order; 0 for channels that are not mapped.
void arrange_row(const Mapping& mapping, const std::vector<double>& row, std::vector<double>& values);

// Set points and ground truth that are not mapped: they are written as 0.
std::vector<std::string> unmapped(const Mapping& mapping, const Datasheet& sheet);

}  // namespace faultline
