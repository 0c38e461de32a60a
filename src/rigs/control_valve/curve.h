// A table of a datasheet as a function: linear between points, flat beyond the ends.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

class Curve {
 public:
  // InputError where the datasheet has no such table or column, or `x` does not rise.
  Curve(const Datasheet& sheet, const std::string& table, const std::string& x, const std::string& y);

  double operator()(double x) const {
    std::size_t i = 1;
    if (!(x > x_.front())) return y_.front();
    if (x >= x_.back()) return y_.back();
    while (x > x_[i]) ++i;
    return y_[i - 1] + slope_[i] * (x - x_[i - 1]);
  }

 private:
  std::vector<double> x_, y_, slope_;  // slope_[i]: from point i - 1 to i
};

}  // namespace faultline
