// The mean square of something that scatters, as it is on this rig in good order: transducers are not as quiet as
// their datasheet says, and what is half again as noisy as that from the first sample on is no fault that came.
//   level = min(max(mean of the first kRows squares, nominal), widest nominal);  nominal if the mean is beyond widest
// So a quieter transducer is judged by its datasheet, and one that is far noisier too: that is told.
#pragma once

#include <algorithm>

namespace faultline {

class OwnLevel {
 public:
  OwnLevel() = default;
  // `widest`: times `nominal`, up to which the rig's own mean square is taken.
  OwnLevel(double nominal, double widest) : nominal_(nominal), widest_(widest * nominal) {}

  void add(double square) {
    if (rows_ < kRows) mean_ += (square - mean_) / ++rows_;
  }
  // Goes on: what becomes noisier slowly is taken as it is, up to the widest.
  void follow(double square) {
    if (rows_ < kRows) ++rows_;
    mean_ += (square - mean_) / rows_;
  }
  bool known() const { return rows_ >= kKnown; }
  bool settled() const { return rows_ >= kRows; }
  // While it is not known: the widest.
  double level() const {
    if (!known()) return widest_;
    return mean_ > widest_ ? nominal_ : std::max(mean_, nominal_);
  }

 private:
  // Squares of second differences: their mean is known to 24 % (one sigma) and to 8 %.
  static constexpr double kKnown = 100, kRows = 1000;
  double nominal_ = 0, widest_ = 0, mean_ = 0, rows_ = 0;
};

}  // namespace faultline
