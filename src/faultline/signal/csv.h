// Recordings as text: one header line, one line per sample. Written with commas and decimal points; read with ; or tab
// and with decimal commas as well (csv_table.h).
//
//   t,channel,...         t in s; each channel in its own SI unit
//   t[ms],channel[bar]    or in the unit in brackets, converted on reading (units.h)
//   sequence              may stand as a further column: the DAQ's count; without it rows are counted from 0
// A number may be missing: an empty cell or `nan`. Lines that are empty or begin with # are skipped. Numbers are
// written with as many digits as bring back the same bits. Set points and ground truth may be absent from a file: they
// become 0. Fails with InputError that names file, line and column: text in a number, a cell too few, a column that the
// rig has not, a channel that the file has not, a unit that does not convert, time that does not rise, a file without
// samples.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faultline/signal/sample.h"

namespace faultline {

struct CsvContent {
  Recording recording;
  std::vector<std::string> filled;     // channels that the file has not, set to 0
  std::vector<std::string> converted;  // columns given in another unit, as written
  std::size_t missing = 0;             // numbers that are not there: empty or nan
};

// `text`: the whole file; `file`: its name, for messages.
CsvContent read_csv(const std::string& text, const std::string& file, const std::string& rig,
                    const std::vector<Channel>& channels);

std::string csv_header(const std::vector<Channel>& channels, bool with_sequence);
// Appends one line to `text`. The time is rounded to whole nanoseconds, which is what messages carry.
void append_csv_row(std::string& text, double time, const std::vector<double>& values);
void append_csv_row(std::string& text, double time, std::uint64_t sequence, const std::vector<double>& values);

}  // namespace faultline
