#include "faultline/signal/anti_alias.h"

#include <cmath>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kReach = 8;     // T
constexpr double kCorner = 0.4;  // 1/T
constexpr double kBeta = 5.0;
constexpr double kStop = 54;             // dB
constexpr std::size_t kSteps = 512 * 8;  // of the table: interpolated, it is good to 1e-6 of h(0)
constexpr double kPi = 3.14159265358979323846;

}  // namespace

AntiAlias::AntiAlias(double period) : reach_(kReach * period), corner_(kCorner / period) {
  table_.reserve(kSteps + 2);
  for (std::size_t i = 0; i <= kSteps; ++i) {
    const double part = static_cast<double>(i) / kSteps;
    const double angle = 2 * kPi * kCorner * kReach * part;
    const double window = std::cyl_bessel_i(0, kBeta * std::sqrt(1 - part * part)) / std::cyl_bessel_i(0, kBeta);
    table_.push_back((i == 0 ? 1 : std::sin(angle) / angle) * window);
  }
  table_.push_back(0);
}

double AntiAlias::weight(double tau) const {
  const double place = std::abs(tau) / reach_ * kSteps;
  if (!(place <= kSteps)) return 0;
  const auto i = static_cast<std::size_t>(place);
  return table_[i] + (place - static_cast<double>(i)) * (table_[i + 1] - table_[i]);
}

std::string AntiAlias::describe(double period) const {
  return fmt::format(
      "windowed-sinc FIR low-pass (Kaiser {:.1f}, order {}, half amplitude at {:.4g} Hz, {:g} dB from {:.4g} Hz, zero "
      "phase)",
      kBeta, 2 * std::lround(reach_ / period), corner_, kStop, corner_ / kCorner / 2);
}

}  // namespace faultline
