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

  double operator()(double x) const { return at(place(x)); }

  // Where x lies: for several columns of one table.
  struct Place {
    std::size_t point = 0;
    double beyond = 0;
  };
  Place place(double x) const {
    if (!(x > x_.front())) return {};
    if (x >= x_.back()) return {x_.size() - 1, 0};
    std::size_t i = 0;
    while (x > x_[i + 1]) ++i;
    return {i, x - x_[i]};
  }
  double at(const Place& place) const { return y_[place.point] + slope_[place.point] * place.beyond; }

 private:
  std::vector<double> x_, y_, slope_;  // slope_[i]: from point i to i + 1
};

}  // namespace faultline
