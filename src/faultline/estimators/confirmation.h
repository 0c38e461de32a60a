// Whether what was found is told. Stretches that had no part in finding it speak for or against it: as much evidence as
// finding takes must come in about the time in which a fault is looked for, since what a model always gets a little
// wrong adds up without end. Of what is not there the next stretch says the opposite, as strongly as it would confirm
// it. What has very much evidence when it is found needs no more.
//
// Evidence as in response_settings.h.
#pragma once

#include "faultline/estimators/response_settings.h"

namespace faultline {

class Confirmation {
 public:
  explicit Confirmation(const ResponseSettings& settings)
      : forgets_(1 / static_cast<double>(settings.recent_stretches)),
        enough_(settings.confirmed_fraction * settings.threshold_evidence),
        sure_(settings.sure_ratio * settings.threshold_evidence) {}

  bool given() const { return given_; }
  void withdraw() {
    given_ = false;
    heard_ = 0;
  }
  void give() { given_ = true; }
  // Of the stretches in which it was found. Where no more is asked for, that is enough.
  void found(double evidence) { given_ = given_ || evidence >= sure_ || heard_ >= enough_; }
  // Of a stretch after these, of it alone.
  void hear(double evidence) {
    heard_ += evidence - forgets_ * heard_;
    given_ = given_ || heard_ >= enough_;
  }

 private:
  double forgets_, enough_, sure_;
  double heard_ = 0;
  bool given_ = false;
};

}  // namespace faultline
