#include "faultline/signal/butterworth.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

Butterworth::Butterworth(double cut_off, double period) {
  if (!(cut_off > 0 && cut_off < 0.5 / period))
    throw InputError(fmt::format("a low pass of {:g} Hz needs a cut-off between 0 and half the sample rate, {:g} Hz",
                                 cut_off, 0.5 / period));
  const double k = std::tan(M_PI * cut_off * period), root = std::sqrt(2.0);
  const double scale = 1 / (1 + root * k + k * k);
  b0_ = k * k * scale;
  a1_ = 2 * (k * k - 1) * scale;
  a2_ = (1 - root * k + k * k) * scale;
  lag_ = root * period / (2 * k);
}

void Butterworth::start(double value) {
  first_ = (1 - b0_) * value;
  second_ = (b0_ - a2_) * value;
}

double Butterworth::step(double value) {
  const double y = b0_ * value + first_;
  first_ = 2 * b0_ * value - a1_ * y + second_;
  second_ = b0_ * value - a2_ * y;
  return y;
}

}  // namespace faultline
