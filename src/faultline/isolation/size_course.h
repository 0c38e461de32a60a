// The size of a fault over time, as a straight line by least squares: a transducer's offset that grows in proportion to
// time is a drift.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace faultline {

// Times in s, sizes in any unit.
class SizeCourse {
 public:
  void clear() { *this = SizeCourse(); }
  void add(double time, double size) {
    if (count_ == 0) first_ = time;
    time -= first_;  // stamps may count from 1970
    ++count_;
    time_ += time;
    times_ += time * time;
    size_ += size;
    sizes_ += size * size;
    both_ += time * size;
    latest_ = size;
  }

  std::size_t count() const { return count_; }
  double latest() const { return latest_; }
  double variance() const { return count_ == 0 ? 0 : sizes_ / n() - std::pow(size_ / n(), 2); }  // of the sizes
  double rate() const { return across() / over_time(); }                                         // per second
  double rate_std() const {
    const double left = over_size() - across() * across() / over_time();
    return std::sqrt(std::max(0.0, left) / std::max(n() - 2, 1.0) / over_time());
  }
  // That the correlation with time is `correlation` at least; never of a size that does not change.
  bool straight(double correlation) const {
    return over_time() > 0 && over_size() > 0 &&
           std::abs(across()) >= correlation * std::sqrt(over_time() * over_size());
  }

 private:
  double n() const { return static_cast<double>(count_); }
  // Sums of squares and of products about the means.
  double over_time() const { return count_ == 0 ? 0 : times_ - time_ * time_ / n(); }
  double over_size() const { return count_ == 0 ? 0 : sizes_ - size_ * size_ / n(); }
  double across() const { return count_ == 0 ? 0 : both_ - time_ * size_ / n(); }

  std::size_t count_ = 0;
  double first_ = 0, time_ = 0, times_ = 0, size_ = 0, sizes_ = 0, both_ = 0, latest_ = 0;
};

}  // namespace faultline
