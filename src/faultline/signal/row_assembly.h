// Rows out of signals that each come with time stamps of their own: topics of a robot or a stand, columns of a log.
//
// Common grid (`resample`): t_k = t_0 + k T, t_0 the first instant at which every signal has begun. Else: rows at the
// stamps of one signal, `leader`; T is then only the period that rows should have.
//   measured  between its neighbours t_a <= t < t_b linearly, if t_b - t_a <= g max(T, T_s): a longer gap stays one.
//             T_s: the signal's own period. Without the grid also only if the nearer of the two is within T/2 of t.
//             Where T_s < 0.95 T, on the grid, the anti-alias filter (anti_alias.h) takes the place of the line.
//   held      (commands, set points) the last value not after t: what holds an actuator is the last number sent, and a
//             line between two numbers would be a command that nobody gave, known before it was sent. It counts for
//             `hold` s, or if that is not said for g times the longest interval it had so far (at least T).
// What is missing is NaN; rows in which every measured signal is missing are left out, and their numbers are skipped.
// T_s is the mean of the first 16 intervals, those above 1.5 times their median left out, once 16 are there or 16 T
// have gone by.
//
// A row is made when nothing can change it any more: when every measured signal is past it (by the reach of the
// filter), or so far behind the others that what comes would make a gap; and a held one is past it, or `wait` s went by
// in the stamps of the others. So rows do not depend on how signals interleave on their way, and what runs live and
// what runs over a recording gives the same rows, unless something was more than `wait` late.
// Times in s of one clock; units of values are the caller's. Fails: clocks of signals that differ by more than `wait`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "faultline/signal/anti_alias.h"

namespace faultline {

struct SignalPlan {
  bool held = false;
  double hold = std::numeric_limits<double>::quiet_NaN();  // s; NaN: by its own intervals
};

struct AssemblyPlan {
  double period = 1;  // T [s]
  bool resample = false;
  std::size_t leader = 0;
  double wait = std::numeric_limits<double>::infinity();  // s; infinite: until finish()
  std::vector<SignalPlan> signals;
};

// g. One lost sample (2 T) is bridged with some jitter to spare, two in a row are a gap: over 3 T a motion near the top
// of the band turns round.
constexpr double kGapPeriods = 2.5;

class RowAssembler {
 public:
  // `row`: counts from 0, also over rows that are left out. `values`: in the order of the plan's signals.
  using Deliver = std::function<void(double time, std::uint64_t row, const std::vector<double>& values)>;

  RowAssembler(const AssemblyPlan& plan, Deliver deliver);

  enum class Taken { yes, late, backward };
  // late: taken, but the row it belongs to is made. backward: not after the signal's last stamp, and left out. A
  // measured NaN is no value and left out.
  Taken push(std::size_t signal, double time, double value);
  void settle();   // nothing is on its way: rows wait for no further held value
  void finish();   // no more will come
  void restart();  // forgets all signals; rows are counted from 0 again

  bool begun() const { return begun_; }
  double newest() const { return newest_; }  // s, of all signals; -infinite: none
  double newest(std::size_t signal) const { return signals_[signal].newest; }
  bool filtered(std::size_t signal) const { return signals_[signal].filtered; }
  double own_period(std::size_t signal) const { return signals_[signal].period; }  // T_s [s]; 0: not known yet
  const AntiAlias& filter() const { return filter_; }
  // A measured signal that lies further behind the others than a gap, or one that never came.
  bool silent(std::size_t signal) const;

 private:
  struct Point {
    double time, value, until;  // until: held, how long it counts
  };
  struct Signal {
    std::deque<Point> points;
    double newest = -std::numeric_limits<double>::infinity();
    double first = 0, longest = 0;
    std::size_t count = 0;
    std::vector<double> intervals;  // the first ones
    double period = 0;
    bool filtered = false;
  };

  void learn_period(std::size_t signal, bool last_chance);
  bool begin();
  void make_rows();
  bool row_time(double& time) const;
  bool ready(double time) const;
  double value(std::size_t signal, double time);
  double gap(const Signal& signal) const;
  double reach(const Signal& signal) const;

  AssemblyPlan plan_;
  Deliver deliver_;
  AntiAlias filter_;
  std::vector<Signal> signals_;
  std::deque<double> leader_times_;
  std::vector<double> row_;
  bool begun_ = false, settled_ = false, finished_ = false;
  double start_ = 0, newest_ = -std::numeric_limits<double>::infinity();
  double made_ = -std::numeric_limits<double>::infinity();
  std::uint64_t number_ = 0;
};

}  // namespace faultline
