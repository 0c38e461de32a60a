// The histograms of one observed variable as somebody looks at them: dumb data in the variable's units, good to draw
// and to send (msg/Histogram.msg).
#pragma once

#include <string>
#include <vector>

namespace faultline {

struct HistogramAxis {  // an explanatory variable, cut into bins of one width
  std::string variable, unit;
  double low = 0, high = 0;
  int bins = 1;
};

struct HistogramView {
  std::string variable, unit;  // observed
  std::vector<HistogramAxis> axes;
  int sections = 0;
  // One per bin, the last axis running fastest; NaN where there is nothing to tell yet.
  std::vector<double> population;
  std::vector<double> start, width;     // of the first section, and of each
  std::vector<double> mean, low, high;  // limits
  std::vector<double> counts;           // bins x sections
  int bin = -1;                         // of the last sample; -1: none
  double value = 0;                     // of the last sample
  double average = 0;                   // moving average, scaled: 0 and 1 are the limits
  double above = 0, below = 0;          // shares of time
};

}  // namespace faultline
