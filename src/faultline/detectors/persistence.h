// Turns a condition that flickers into one that lasts: on after it held for `minimum` s, off after it was gone for
// `release` s. `since` is when the condition began, not when it was believed.
#pragma once

namespace faultline {

class Persistence {
 public:
  Persistence(double minimum, double release) : minimum_(minimum), release_(release) {}
  void reset() { *this = Persistence(minimum_, release_); }

  bool update(double time, bool condition) {
    if (condition) {
      if (!seen_) begin_ = time;
      seen_ = true;
      last_ = time;
      if (time - begin_ >= minimum_) active_ = true;
    } else if (seen_ && time - last_ > (active_ ? release_ : 0)) {
      seen_ = active_ = false;
    }
    return active_;
  }
  bool active() const { return active_; }
  double since() const { return begin_; }

 private:
  double minimum_, release_;
  double begin_ = 0, last_ = 0;
  bool seen_ = false, active_ = false;
};

}  // namespace faultline
