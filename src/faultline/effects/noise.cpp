// Noise: y = u + std n_k, n_k independent and normal with variance 1, a new one each step.
//
// std [of what passes]. Same seed, same noise; reset() starts the sequence again. Linear in `std`.
// xorshift64* (Vigna 2016) and Marsaglia's polar method, written out so that every standard library gives the same
// numbers. Limit: white per step of the simulation: behind a slow plant its power falls with the step; there is no
// colour.

#include <cmath>
#include <cstdint>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Noise : public Effect {
 public:
  void reset() override {
    state_ = (context().seed + 1) * 0x9E3779B97F4A7C15ULL;  // neighbouring seeds far apart
    if (state_ == 0) state_ = 1;
    for (int i = 0; i < 8; ++i) uniform();
    has_spare_ = false;
  }

  double signal(double value, double /*time*/) override { return value + parameter(0) * normal(); }

 private:
  double uniform() {  // in -1..1
    state_ ^= state_ >> 12;
    state_ ^= state_ << 25;
    state_ ^= state_ >> 27;
    return static_cast<double>((state_ * 0x2545F4914F6CDD1DULL) >> 11) * 0x1p-52 - 1;
  }

  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double a = 0, b = 0, square = 0;
    do {
      a = uniform();
      b = uniform();
      square = a * a + b * b;
    } while (square >= 1 || square == 0);
    const double stretch = std::sqrt(-2 * std::log(square) / square);
    spare_ = b * stretch;
    has_spare_ = true;
    return a * stretch;
  }

  std::uint64_t state_ = 1;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace

FAULTLINE_EFFECT(noise, {"noise",
                         "resolution",
                         "u + std n(t), n white and normal",
                         {PortKind::command, PortKind::sensor},
                         {{"std", "port", 0, 0, 1e9}},
                         &make_effect<Noise>});

}  // namespace faultline
