// Says how far the samples' time must have gone on while none came, for AlarmStage::advance. Nothing here reads a
// clock.
//
// Live: the samples' time goes on with a steady clock. In simulated time (replay): with /clock, so that a pause is no
// silence; but /clock and samples travel on separate paths, so only what the clock goes on after `patience` seconds of
// steady time without a sample counts: until then it may still be catching up with the last one. The alarm stage dates
// a silence from the last sample, so the date is the same whenever it is noticed, and the same offline. Fails: a sample
// that is on its way for longer than `patience` makes a false alarm, which it takes back on arrival.
#pragma once

namespace faultline {

class SilenceWatch {
 public:
  explicit SilenceWatch(double patience) : patience_(patience) {}

  // `steady`: s, a clock no one sets. `simulated`: s, /clock; NaN where ROS runs on wall time.
  void arrived(double sample_time, double steady, double simulated);
  // The time to advance to [s, samples' clock]; NaN if nothing can be said. To be called now and then.
  double now(double steady, double simulated);

  // Whether /clock has not moved for a second. To be called now and then with the present times.
  bool clock_stands(double steady, double simulated);

 private:
  double patience_;
  bool any_ = false;
  double sample_time_ = 0, steady_ = 0;
  double simulated_ = 0;  // of the arrival; from the end of the patience on, of that
  bool waited_ = false;
  double clock_value_ = -1, clock_moved_ = 0;
};

}  // namespace faultline
