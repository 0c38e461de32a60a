// The course of a diagnosis as a table of at most `rows` rows, for plots. Of a longer recording, rows/4 to rows/2
// stretches of equal length give two rows each: per column its smallest and its largest value there, in the order in
// which they came, so that no spike is lost. Stretches are joined in pairs as the recording goes on: it may last as
// long as it likes.
// Columns: t; every channel; x.STATE and x.STATE.std in the model's units; q.QUANTITY and
// q.QUANTITY.std; i.CHANNEL and i.CHANNEL.std (innovation, model's units); normalised_innovation, of stages that have
// an innovation.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/alarms/diagnosis.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

class Series {
 public:
  // Of all estimators of the diagnosis, which must outlive it; those after the first add their name to
  // normalised_innovation.
  Series(const Datasheet& sheet, const Diagnosis& diagnosis, std::size_t rows);

  void add(double time, const Sample& sample);
  std::string csv();  // ends the table

 private:
  struct Extremes {
    double low, high;  // NaN: no number yet
    std::uint32_t low_at, high_at;
  };
  struct Stretch {
    double begin, end;  // s
  };
  void name_columns();
  void start(double time);
  void add_to_last(double time);
  void start_stretches();  // from single rows
  void join_pairs();
  void row(double time, const double* values);

  const Diagnosis& diagnosis_;
  std::size_t most_;
  std::vector<std::string> channels_;
  std::size_t length_ = 1;  // samples per stretch; 1: every sample as it is
  std::uint32_t samples_ = 0;
  std::vector<double> values_;
  std::vector<double> times_, rows_;  // while every sample is kept
  std::vector<Stretch> stretches_;
  std::vector<Extremes> extremes_;  // stretches x columns
  std::string text_;
};

}  // namespace faultline
