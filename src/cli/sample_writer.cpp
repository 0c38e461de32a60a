#include "cli/sample_writer.h"

#include <fmt/format.h>

#include "cli/output_file.h"
#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::size_t kBlock = 1 << 16;  // characters written at once

class BagSampleWriter : public SampleWriter {
 public:
  BagSampleWriter(const std::string& file, const Datasheet& sheet, const std::string& made_by, double first_time,
                  BagCompression compression)
      : output_(file), bag_(output_.written(), file, sheet, made_by, first_time, compression) {}
  void write(const Sample& sample) override { bag_.write(sample); }
  void commit() override {
    bag_.close();
    output_.commit();
  }

 private:
  OutputFile output_;
  BagWriter bag_;
};

class CsvSampleWriter : public SampleWriter {
 public:
  CsvSampleWriter(const std::string& file, const Datasheet& sheet, bool with_sequence)
      : output_(file), with_sequence_(with_sequence) {
    text_ = csv_header(sheet.channels, with_sequence);
  }
  void write(const Sample& sample) override {
    if (with_sequence_)
      append_csv_row(text_, sample.time, sample.sequence, sample.values);
    else
      append_csv_row(text_, sample.time, sample.values);
    if (text_.size() < kBlock) return;
    output_.write(text_);
    text_.clear();
  }
  void commit() override {
    output_.write(text_);
    output_.commit();
  }

 private:
  TextOutput output_;
  bool with_sequence_;
  std::string text_;
};

}  // namespace

std::unique_ptr<SampleWriter> make_sample_writer(const std::string& file, const Datasheet& sheet,
                                                 const std::string& made_by, double first_time,
                                                 BagCompression compression, bool with_sequence) {
  if (ends_with(file, ".bag")) return std::make_unique<BagSampleWriter>(file, sheet, made_by, first_time, compression);
  if (ends_with(file, ".csv")) return std::make_unique<CsvSampleWriter>(file, sheet, with_sequence);
  throw InputError(fmt::format("{}: the name must end in .bag or .csv", file));
}

}  // namespace faultline
