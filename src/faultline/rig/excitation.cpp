#include "faultline/rig/excitation.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kHuge = 1e12;
constexpr double kRepetition = 10;      // a multisine repeats after this many cycles of its lowest tone
constexpr double kPointsPerCycle = 16;  // of its highest tone, at which its peak is looked for: right within 2 %

class Constant : public Excitation {
 public:
  Constant(const Settings& s, std::uint64_t) : value_(s.number("value", -kHuge, kHuge)) {}
  double value(double) override { return value_; }

 private:
  double value_;
};

class Square : public Excitation {
 public:
  Square(const Settings& s, std::uint64_t)
      : low_(s.number("low", -kHuge, kHuge)),
        high_(s.number("high", -kHuge, kHuge)),
        period_(s.number("period", 1e-6, kHuge)),
        duty_(s.number_or("duty", 0.5, 0, 1)),
        start_(s.number_or("start", 0, 0, kHuge)) {}
  double value(double time) override {
    if (time < start_) return low_;
    return std::fmod(time - start_, period_) < duty_ * period_ ? high_ : low_;
  }

 private:
  double low_, high_, period_, duty_, start_;
};

class Triangle : public Excitation {
 public:
  Triangle(const Settings& s, std::uint64_t)
      : amplitude_(s.number("amplitude", 0, kHuge)),
        mean_(s.number_or("mean", 0, -kHuge, kHuge)),
        period_(s.number("period", 1e-6, kHuge)) {}
  double value(double time) override {
    const double phase = std::fmod(time / period_, 1.0);
    const double wave = phase < 0.25 ? 4 * phase : phase < 0.75 ? 2 - 4 * phase : 4 * phase - 4;
    return mean_ + amplitude_ * wave;
  }

 private:
  double amplitude_, mean_, period_;
};

struct Sine {
  double frequency, amplitude, phase;
};

double sum_of(const std::vector<Sine>& sines, double time) {
  double sum = 0;
  for (const Sine& s : sines) sum += s.amplitude * std::sin(2 * kPi * s.frequency * time + s.phase);
  return sum;
}

class Sines : public Excitation {
 public:
  Sines(const Settings& s, std::uint64_t seed) : fade_(s.number_or("fade", 1, 0, kHuge)) {
    const double count = s.number("count", 1, 1000);
    const double base = s.number("base", 0, kHuge);
    const double span = s.number("span", 0, kHuge);
    const double amplitude = s.number("amplitude", 0, kHuge);
    const double roll_off = s.number("roll_off", 1e-9, kHuge);
    const double spread = s.number_or("spread", 0.03, 0, 0.5);
    Random random(seed);
    for (int k = 0; k < static_cast<int>(count); ++k) {
      const double f = (base + span * k / count) * (1 + random.uniform(-spread, spread));
      sines_.push_back({f, amplitude * std::exp(-(f / roll_off) * (f / roll_off)), random.uniform(0, 2 * kPi)});
    }
  }
  double value(double time) override {
    const double fade = fade_ > 0 ? std::min(1.0, time / fade_) : 1.0;
    return fade * sum_of(sines_, time);
  }

 private:
  double fade_;
  std::vector<Sine> sines_;
};

class Multisine : public Excitation {
 public:
  Multisine(const Settings& s, std::uint64_t seed)
      : mean_(s.number_or("mean", 0, -kHuge, kHuge)), fade_(s.number_or("fade", 1, 0, kHuge)) {
    const int count = static_cast<int>(s.number("count", 1, 1000));
    const double lowest = s.number("lowest", 1e-6, kHuge);
    const double highest = s.number("highest", lowest, kHuge);
    const double corner = s.number_or("corner", 1, 1e-9, kHuge);
    amplitude_ = s.number("amplitude", 0, kHuge);
    Random random(seed);
    // Geometric spacing; amplitudes fall with frequency, so that the speed stays within what the rig can do. Every
    // frequency is a multiple of one, so that the signal repeats and its peak can be looked for over one repetition.
    base_ = lowest / kRepetition;
    for (int k = 0; k < count; ++k) {
      const double share = count > 1 ? static_cast<double>(k) / (count - 1) : 0;
      const double f = base_ * std::round(lowest * std::pow(highest / lowest, share) / base_);
      sines_.push_back({f, std::sqrt(lowest / f) / (1 + f / corner), random.uniform(0, 2 * kPi)});
    }
    points_ = static_cast<int>(std::min(1e6, kPointsPerCycle * highest / base_));
  }
  double value(double time) override {
    if (points_ > 0) scale();
    return mean_ + (fade_ > 0 ? std::min(1.0, time / fade_) : 1.0) * sum_of(sines_, time);
  }

 private:
  // At the first value: a datasheet that is only read and checked asks for none.
  void scale() {
    double peak = 0;
    for (int i = 0; i < points_; ++i) peak = std::max(peak, std::abs(sum_of(sines_, i / (base_ * points_))));
    for (Sine& sine : sines_) sine.amplitude *= amplitude_ / std::max(peak, 1e-300);
    points_ = 0;
  }

  double mean_, fade_, amplitude_ = 0, base_ = 0;
  int points_ = 0;  // at which the peak is sought; 0: the sines are scaled
  std::vector<Sine> sines_;
};

class Chirp : public Excitation {
 public:
  Chirp(const Settings& s, std::uint64_t)
      : lowest_(s.number("lowest", 1e-6, kHuge)),
        highest_(s.number("highest", lowest_, kHuge)),
        sweep_(s.number("sweep", 1e-6, kHuge)),
        amplitude_(s.number("amplitude", 0, kHuge)),
        mean_(s.number_or("mean", 0, -kHuge, kHuge)) {}
  double value(double time) override {
    const double t = std::fmod(time, sweep_), share = t / sweep_;
    const double cycles = lowest_ * t + 0.5 * (highest_ - lowest_) * share * t;
    return mean_ + amplitude_ * share * std::sin(2 * kPi * cycles);
  }

 private:
  double lowest_, highest_, sweep_, amplitude_, mean_;
};

// Levels that hold for a while: the next level and its end are drawn when the last one ends.
class Held : public Excitation {
 public:
  explicit Held(std::uint64_t seed) : seed_(seed), random_(seed) {}
  double value(double time) override {
    if (time < last_time_) {
      random_ = Random(seed_);
      until_ = 0;
      start_over();
    }
    last_time_ = time;
    while (time >= until_ - 1e-9) until_ += draw(random_, level_);
    return level_;
  }

 protected:
  virtual double draw(Random& random, double& level) = 0;  // sets the level, returns for how long [s]
  virtual void start_over() {}

 private:
  std::uint64_t seed_;
  Random random_;
  double last_time_ = 0, until_ = 0, level_ = 0;
};

class Steps : public Held {
 public:
  Steps(const Settings& s, std::uint64_t seed)
      : Held(seed),
        low_(s.number("low", -kHuge, kHuge)),
        high_(s.number("high", -kHuge, kHuge)),
        shortest_(s.number("shortest", 1e-6, kHuge)),
        longest_(s.number("longest", shortest_, kHuge)),
        largest_(s.number_or("largest", 0, 0, kHuge)),
        smallest_(largest_ > 0 ? s.number_or("smallest", 0, 0, std::min(largest_, (high_ - low_) / 2)) : 0) {}

 private:
  double draw(Random& random, double& level) override {
    level = largest_ > 0 && !first_ ? level + step(random, level) : random.uniform(low_, high_);
    first_ = false;
    return random.uniform(shortest_, longest_);
  }
  // The way that was drawn, or the other one where there is no room.
  double step(Random& random, double level) const {
    const double size = random.uniform(smallest_, largest_), up = high_ - level, down = level - low_;
    const bool rises = random.uniform() < 0.5 ? size <= up || up >= down : size > down && up > down;
    return rises ? std::min(size, up) : -std::min(size, down);
  }
  void start_over() override { first_ = true; }
  double low_, high_, shortest_, longest_, largest_, smallest_;
  bool first_ = true;
};

class RandomBinary : public Held {
 public:
  RandomBinary(const Settings& s, std::uint64_t seed)
      : Held(seed),
        low_(s.number("low", 0, kHuge)),
        high_(s.number("high", 0, kHuge)),
        clock_(s.number("clock", 1e-6, kHuge)),
        longest_(s.number_or("longest", 1, 1, 1000)),
        mean_(s.number_or("mean", 0, -kHuge, kHuge)) {}

 private:
  double draw(Random& random, double& level) override {
    sign_ = -sign_;
    level = mean_ + sign_ * random.uniform(low_, high_);
    return clock_ * (1 + std::floor(random.uniform(0, longest_)));
  }
  void start_over() override { sign_ = -1; }
  double low_, high_, clock_, longest_, mean_;
  double sign_ = -1;
};

class Cycle : public Excitation {
 public:
  Cycle(const Settings& s, std::uint64_t)
      : low_(s.number("low", -kHuge, kHuge)),
        high_(s.number("high", -kHuge, kHuge)),
        move_(s.number("move", 1e-6, kHuge)),
        dwell_(s.number("dwell", 0, kHuge)) {}
  double value(double time) override {
    const double t = std::fmod(time, 2 * (move_ + dwell_));
    const double up = std::clamp(t / move_, 0.0, 1.0);
    const double down = std::clamp((t - move_ - dwell_) / move_, 0.0, 1.0);
    return low_ + (high_ - low_) * (up - down);
  }

 private:
  double low_, high_, move_, dwell_;
};

class Table : public Excitation {
 public:
  Table(const Settings& s, std::uint64_t) : time_(s.list("time", 0, -kHuge, kHuge)) {
    if (time_.empty()) throw InputError(s.where() + ": 'time' must have at least one number");
    if (std::adjacent_find(time_.begin(), time_.end(), std::greater_equal<>()) != time_.end())
      throw InputError(s.where() + ": 'time' must rise from each number to the next");
    value_ = s.list("value", time_.size(), -kHuge, kHuge);
  }
  double value(double time) override {
    const auto after = std::upper_bound(time_.begin(), time_.end(), time);
    if (after == time_.begin()) return value_.front();
    if (after == time_.end()) return value_.back();
    const auto i = static_cast<std::size_t>(after - time_.begin());
    const double share = (time - time_[i - 1]) / (time_[i] - time_[i - 1]);
    return value_[i - 1] + share * (value_[i] - value_[i - 1]);
  }

 private:
  std::vector<double> time_, value_;
};

template <class T>
std::unique_ptr<Excitation> make(const Settings& settings, std::uint64_t seed) {
  return std::make_unique<T>(settings, seed);
}

struct Shape {
  const char* name;
  std::unique_ptr<Excitation> (*make)(const Settings&, std::uint64_t);
};

constexpr Shape kShapes[] = {
    {"constant", make<Constant>},   {"square", make<Square>}, {"triangle", make<Triangle>}, {"sines", make<Sines>},
    {"multisine", make<Multisine>}, {"steps", make<Steps>},   {"prbs", make<RandomBinary>}, {"cycle", make<Cycle>},
    {"table", make<Table>},         {"chirp", make<Chirp>},
};

}  // namespace

std::vector<std::string> excitation_shapes() {
  std::vector<std::string> names;
  for (const Shape& shape : kShapes) names.emplace_back(shape.name);
  return names;
}

std::unique_ptr<Excitation> make_excitation(const std::string& wanted, const Settings& settings, std::uint64_t seed) {
  for (const Shape& shape : kShapes) {
    if (wanted != shape.name) continue;
    auto excitation = shape.make(settings, seed);
    settings.check_used();
    return excitation;
  }
  throw InputError(fmt::format("{}: there is no excitation shape '{}'; there are {}", settings.where(), wanted,
                               fmt::join(excitation_shapes(), ", ")));
}

}  // namespace faultline
