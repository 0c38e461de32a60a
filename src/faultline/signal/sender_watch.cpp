#include "faultline/signal/sender_watch.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kLeastTolerance = 1e-3;    // s, as of the sequence monitor
constexpr double kWindow = 1000;            // W, samples
constexpr std::uint64_t kEnough = 10;       // samples of a line that is believed
constexpr double kSilence = 1, kSteps = 5;  // s, or periods if that is longer, after which the other line counts

}  // namespace

SenderWatch::SenderWatch(double period)
    : period_(period),
      tolerance_(std::max(kLeastTolerance, period / 2)),
      silence_(std::max(kSilence, kSteps * period)) {}

bool SenderWatch::goes_on(const Line& line, std::uint64_t number, double stamp) const {
  if (line.samples == 0) return false;
  const double step =
      number >= line.number ? static_cast<double>(number - line.number) : -static_cast<double>(line.number - number);
  return std::abs(step) <= kWindow && std::abs(stamp - line.stamp - step * period_) <= tolerance_;
}

std::size_t SenderWatch::begin_line() const {
  std::size_t place = own_ == 0 ? 1 : 0;
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    if (lines_[i].samples == 0) return i;
    if (i != own_ && lines_[i].arrival < lines_[place].arrival) place = i;
  }
  return place;
}

bool SenderWatch::own(std::uint64_t number, double stamp, double arrival) {
  std::size_t place = own_;
  if (!goes_on(lines_[own_], number, stamp)) {
    place = 0;
    while (place < lines_.size() &&
           !(arrival - lines_[place].arrival <= silence_ && goes_on(lines_[place], number, stamp)))
      ++place;
  }
  // The next number is own whatever its stamp, unless another line claims it: stamps jitter.
  if (place == lines_.size() && (lines_[own_].samples == 0 || number == lines_[own_].number + 1)) place = own_;
  if (place == lines_.size()) {
    place = begin_line();
    lines_[place] = Line();
  }
  Line& line = lines_[place];
  Line& mine = lines_[own_];
  line.number = number;
  line.stamp = stamp;
  line.arrival = arrival;
  ++line.samples;
  if (place == own_) return true;
  if (line.foreign && arrival - mine.arrival <= silence_) {
    ++foreign_;
    return false;
  }
  mine.foreign = !line.foreign && line.samples > kEnough && mine.samples >= kEnough;
  line.foreign = false;
  own_ = place;
  return true;
}

}  // namespace faultline
