// A smooth function of one number by cubics through its values and slopes at points an equal way apart: for what every
// evaluation of the equations asks for and the mathematical library takes long to say. The error is h^4/384 times the
// fourth derivative, h the way from point to point.
#pragma once

#include <array>
#include <cstddef>

namespace faultline {

template <std::size_t kIntervals>
class CubicTable {
 public:
  // `value` and `slope`: functions of x from `from` to `to`.
  template <class Value, class Slope>
  CubicTable(double from, double to, Value&& value, Slope&& slope)
      : from_(from), to_(to), per_interval_(kIntervals / (to - from)) {
    const double width = (to - from) / kIntervals;
    for (std::size_t i = 0; i < kIntervals; ++i) {
      const double x0 = from + static_cast<double>(i) * width, x1 = x0 + width;
      const double y0 = value(x0), y1 = value(x1), slope0 = width * slope(x0), slope1 = width * slope(x1);
      cubics_[i] = {y0, slope0, 3 * (y1 - y0) - 2 * slope0 - slope1, 2 * (y0 - y1) + slope0 + slope1};
    }
  }

  bool holds(double x) const { return x >= from_ && x < to_; }
  // Where it holds x.
  double operator()(double x) const { return at(place(x)); }

  // Where x lies: for several tables of one range.
  struct Place {
    std::size_t interval;
    double part;
  };
  Place place(double x) const {
    const double place = (x - from_) * per_interval_;
    const auto i = static_cast<std::ptrdiff_t>(place);  // signed: one instruction
    return {static_cast<std::size_t>(i < kLast ? i : kLast), place - static_cast<double>(i)};
  }
  double at(const Place& place) const {
    const std::array<double, 4>& c = cubics_[place.interval];
    return (c[0] + place.part * c[1]) + place.part * place.part * (c[2] + place.part * c[3]);
  }

 private:
  static constexpr std::ptrdiff_t kLast = static_cast<std::ptrdiff_t>(kIntervals) - 1;
  double from_, to_, per_interval_;
  std::array<std::array<double, 4>, kIntervals> cubics_;
};

}  // namespace faultline
