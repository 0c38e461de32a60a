// A drawing as rviz shows it: markers and frames of a layout in a given state. Pure functions.
//
// Every part has a frame, SPACE/PART, below that of the part that carries it or the canvas, SPACE; its body is a marker
// locked to that frame, so that it moves with /tf alone. Labels stand still. Namespaces of the markers: parts, labels,
// flows, residuals, head, legend.
#pragma once

#include <string>
#include <vector>

#include <geometry_msgs/TransformStamped.h>
#include <visualization_msgs/MarkerArray.h>

#include "nodes/view_marks.h"

namespace faultline {

// A residual over its sigma: root of the mean square of late.
struct ResidualBar {
  std::string channel;
  double ratio = 0;
};

// The values that move a drawing and stand in it; NaN: not known.
struct ViewValues {
  std::vector<double> channels;             // of the last sample
  std::vector<double> moves, turns, flows;  // of each part: what its sources stand at
};

struct ViewHead {
  std::string verdict;
  std::string gap;  // one sentence; empty: nothing to tell
  PartLevel level = PartLevel::unjudged;
};

// Whether a part moves within its parent.
bool moves(const ViewPart& part);

// Of part `i`, without stamp.
geometry_msgs::TransformStamped frame_of(const ViewLayout& layout, std::size_t i, const ViewValues& values,
                                         const std::string& space);

visualization_msgs::MarkerArray markers_of(const ViewLayout& layout, const Datasheet& sheet,
                                           const std::vector<PartMark>& marks, const ViewValues& values,
                                           const ViewHead& head, const std::vector<ResidualBar>& bars,
                                           const std::string& space);

}  // namespace faultline
