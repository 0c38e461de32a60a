// Writes samples one by one into NAME.bag or NAME.csv, whole or not at all.
#pragma once

#include <memory>
#include <string>

#include "cli/bag_file.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

class SampleWriter {
 public:
  virtual ~SampleWriter() = default;
  virtual void write(const Sample& sample) = 0;  // time from the recording's zero
  virtual void commit() = 0;                     // without it nothing is left
};

// By the ending of `file`; InputError if it is neither. `with_sequence`: a column for it in a CSV file.
std::unique_ptr<SampleWriter> make_sample_writer(const std::string& file, const Datasheet& sheet,
                                                 const std::string& made_by, double first_time,
                                                 BagCompression compression, bool with_sequence);

}  // namespace faultline
