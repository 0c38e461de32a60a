// From what detectors and isolators say to alarms: watches the data itself, keeps the life cycle of every alarm and
// says the verdict: the second half of the alarm stage; isolation/isolation_stage.h is the other.
//
// What a detector and an isolator both found is one alarm, by the detector's effect and size. An isolator's alarm
// changes its place and size as it learns.
// A cause is named once the confidence in that name is kNamed at least; what an isolator alone finds keeps it as long
// as that is not below kKept and no other one is named, what a detector found until it ends. Until then the alarm says
// that something changed, of kind unknown, with the candidates as its `equivalent`, the likeliest first. Data alarms: a
// channel that is missing or out of range (ends a while after the last such sample); a rig that fell silent (stale:
// from the last sample plus a while; alarm_options.h).
#pragma once

#include <string>
#include <vector>

#include "faultline/alarms/alarm_book.h"
#include "faultline/alarms/alarm_options.h"
#include "faultline/alarms/data_watch.h"
#include "faultline/isolation/assessment.h"

namespace faultline {

// Least confidence at which a cause is told by its name, and at which the name is kept: two that explain as much as
// each other are named together, also where a little is left for others, of three none is. The distance between the
// two keeps a name from coming and going.
constexpr double kNamed = 0.45, kKept = 0.36;

class AlarmKeeper {
 public:
  explicit AlarmKeeper(const Datasheet& sheet, const AlarmOptions& options = {});

  // One sample's; begins anew where time jumps back. InputError unless it has the detectors and isolators of the
  // datasheet.
  void process(const Assessment& assessment);
  // A sample came, whose assessment may come later or never: where the diagnosis pauses, samples alone tell whether the
  // rig was silent. Need not be called where every sample is assessed.
  void heard(double time) { data_.heard(time); }
  // The time went on to `now` [s] without a sample; raises the stale alarm where it is due, dated from the last sample
  // that was heard, be it judged or not. If the next sample shows that there was no such silence, the alarm is taken
  // back, so that what is told never depends on how long a sample was on its way.
  void advance(double now);
  void reset();

  // With the verdict and what is withheld as of the last sample.
  const AlarmReport& report() const;
  // Counts up whenever an alarm is raised, ends, or changes level: what must be published at once.
  std::uint64_t changes() const { return book_.changes(); }

 private:
  // A detector or an isolator, and what became of what it says.
  struct Source {
    int alarm = -1;  // of the book, while active
    Withheld withheld;
    bool named = false;  // its cause has earned its name
    Finding unnamed;     // what is told while it has not
    std::string unnamed_for;
  };
  struct Detecting : Source {
    Finding finding;      // its detection in the datasheet's words
    int unobserved = -1;  // of the report
    double watched_to = 0;
  };
  struct Isolating : Source {
    // The finding in the words of the detector that found the same, and what they were made of: words are made anew
    // only where they change.
    Finding shown, shown_of;
    int shown_for = -1;
    std::vector<std::string> shown_beside;  // names that were added
  };
  static bool is_idle(const Detecting& d) {
    return d.withheld.reason == Reason::absent && d.alarm < 0 && d.unobserved < 0;
  }
  void check(const Assessment& assessment) const;
  // Alarms of detectors that see nothing any more, as after a gap in the samples, go on where an isolator tells the
  // same.
  void pass_on(const Assessment& assessment);
  void take(Detecting& d, const DetectorResult& result, double time);
  void take(Isolating& i, const IsolatorResult& result, const Assessment& assessment);
  const Finding& in_words_of(int detector, const DetectorResult& found, const Finding& finding, Isolating& i) const;
  // With what another isolator, which stands under this one's alarm, cannot tell from it.
  const Finding& with_rivals(const Assessment& assessment, Isolating& i, const Finding& finding) const;
  // By its name where the confidence in that is `least_confidence`, else as something that changed.
  void tell(Source& source, const Finding& finding, double least_confidence, double time);
  bool goes_by(const Source& source, const Finding& finding) const;  // its alarm has that name already
  void watch_blindness(Detecting& d, const DetectorResult& result, double time);
  std::string verdict() const;

  std::string rig_;
  std::vector<Detecting> detecting_;
  std::vector<Isolating> isolating_;
  DataWatch data_;
  bool idle_ = false;  // all detectors have been so since they were quiet
  bool running_ = false;
  double last_time_ = 0;
  mutable AlarmBook book_;  // the report's verdict and what is withheld are only written when somebody reads it
};

}  // namespace faultline
