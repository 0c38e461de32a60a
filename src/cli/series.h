// The course of a diagnosis as a table of at most 4000 rows, for plots. A longer recording is cut into 2000 stretches
// and each gives two rows: per column its smallest and its largest value there, in the order in which they came, so
// that no spike is lost.
// Columns: t; every channel; x.STATE and x.STATE.std in the model's units; q.QUANTITY and
// q.QUANTITY.std; i.CHANNEL and i.CHANNEL.std (innovation, model's units); normalised_innovation, of stages that have
// an innovation.
#pragma once

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
    double low = 0, high = 0;
    std::size_t low_at = 0, high_at = 0;
    bool any = false;
  };
  void name_columns();
  void end_stretch();
  void row(double time, const std::vector<double>& values);

  const Diagnosis& diagnosis_;
  std::vector<std::string> channels_;
  std::size_t stretch_;  // samples per stretch; 1: every sample as it is
  std::size_t in_stretch_ = 0;
  std::vector<double> times_, values_, first_, second_;
  std::vector<Extremes> extremes_;
  std::string text_;
};

}  // namespace faultline
