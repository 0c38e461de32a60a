// Stretches of samples out of a stream, as fault_responses.h judges them: one begins every `every_s` (the first
// early_stretches: `early_every_s`), is (segments + 1) segments long, and has no gaps but single missing samples
// (segments/even_rows.h). Between two of them another one is begun, so that it ends when the first has been judged; it
// is needed where that left something undecided.
#pragma once

#include <memory>

#include "faultline/estimators/response_settings.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

class StretchCollector {
 public:
  // `latency_s`: from the end of a stretch to judged(); infinite: none is begun between.
  StretchCollector(const Datasheet& sheet, const ResponseSettings& settings, double latency_s = kInfinity);

  void reset();
  // One sample; outputs that are not fit to be used are NaN, `good`: commands and inputs are. The stretch that it ends,
  // or null. A sample that is not good, or comes late, drops the stretch that was begun; the next begins at once.
  std::unique_ptr<Recording> add(double time, const double* channels, bool good);
  // What was added last was judged. The stretch between is needed, or not.
  void judged(bool undecided);

 private:
  void drop(double time);
  std::unique_ptr<Recording> empty() const;
  double every() const { return ended_ < early_ ? early_every_s_ : every_s_; }

  const Datasheet sheet_;
  const std::size_t rows_;
  const double every_s_, early_every_s_, latency_s_, period_error_fraction_;
  const std::size_t early_;
  // Where stretches are begun between others, memory is taken when those that are due begin, for both.
  std::unique_ptr<Recording> begun_, spare_;
  bool started_ = false, between_ = false;  // between_: the one that was begun
  std::size_t ended_ = 0;                   // stretches
  double next_ = 0;                         // s, when the next stretch begins ...
  double due_ = 0;                          // ... and when the next of those every `every_s`
};

// Whether a command or a transducer does more in a stretch than its noise, as standard deviations go.
bool moves(const Datasheet& sheet, const Recording& stretch);

}  // namespace faultline
