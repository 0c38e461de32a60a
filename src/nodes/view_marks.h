// How each part of a drawing stands: the worst of what alarms and gap say of its ports. Pure functions.
#pragma once

#include <string>
#include <vector>

#include <std_msgs/ColorRGBA.h>

#include "nodes/messages.h"
#include "nodes/view_layout.h"

namespace faultline {

enum class PartLevel {
  unjudged,   // no alarms are heard, or nothing could be judged yet
  healthy,    // no alarm and no gap names it
  candidate,  // not told apart from what is named, or named with less than even odds
  gap,        // the gap has left normal and is placed here
  warning,    // an alarm
  error,
};

struct PartMark {
  PartLevel level = PartLevel::unjudged;
  std::string text;  // what is the matter, in words; empty where nothing is
};

// The latest of each; null: none was heard.
struct Judgements {
  const faultline_msgs::AlarmArray* alarms = nullptr;
  const faultline_msgs::Gap* gap = nullptr;
};

// One a part. Of an alarm and a gap at one part the graver counts (a gap beyond three times its limit is an error),
// of equals the alarm.
std::vector<PartMark> part_marks(const ViewLayout& layout, const Datasheet& sheet, const Judgements& heard);

// Of the whole rig: a cause that is named with less than even odds is a warning.
PartLevel level_of(const faultline_msgs::AlarmArray& alarms);

// Told apart also without seeing red and green: they differ in brightness from step to step, and the gap in hue.
std_msgs::ColorRGBA colour_of(PartLevel level);

// For a legend.
std::string words_of(PartLevel level);

}  // namespace faultline
