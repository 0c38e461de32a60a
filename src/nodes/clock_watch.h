// Whether ROS waits for a clock that nobody gives: with simulated time on (a replay before may have left it in the
// master) and no publisher of /clock, time stands at 0 and all that waits for it is silent. Nothing here reads a clock.
#pragma once

namespace faultline {

class ClockWatch {
 public:
  // To be called now and then; `steady`: s, a clock no one sets; `without`: simulated time is on, stands at 0, and
  // nobody publishes it. True after five seconds of that: nodes of one launch do not start all at once.
  bool missing(double steady, bool without) {
    if (!without) since_ = -1;
    if (without && since_ < 0) since_ = steady;
    return without && steady - since_ > 5;
  }

 private:
  double since_ = -1;  // s
};

}  // namespace faultline
