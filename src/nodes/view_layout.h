// Where the parts of a rig stand in its drawing: config/RIG/view.yaml, or, where there is none, a layout made of the
// datasheet. Schema: docs/views.md. Dumb data; knows no ROS.
//
// The canvas is kCanvasWidth x kCanvasHeight, its origin in the middle, x to the right, y up, z towards the viewer; the
// strips above and below it belong to the verdict, the residuals and the legend. Units of the canvas mean nothing.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

constexpr double kCanvasWidth = 16, kCanvasHeight = 6;

enum class PartShape { box, cylinder, sphere, path, text };

// A number of the rig that moves something: an estimated state of this name, else the channel that measures it.
struct ViewSource {
  std::string name;  // of a channel or a state of the datasheet; empty: none
  int channel = -1;  // that shows the same; -1: none
};

struct ViewPart {
  std::string name;
  PartShape shape = PartShape::box;
  std::array<double, 3> at{};                 // its middle in the frame of its parent
  std::array<double, 3> size{};               // extents; of a path its width alone; of a text none
  char along = 'z';                           // the axis of a cylinder
  bool clear = false;                         // a body that others are seen through
  std::vector<std::array<double, 2>> points;  // of a path, from its middle
  std::vector<std::string> ports;             // whose faults and gaps it shows
  std::string label;                          // may be empty
  std::array<double, 2> label_at{};           // middle of the text, from the part's
  double letters = 0.2;                       // height of the text
  std::vector<int> shows;                     // channels whose values stand below the label
  int parent = -1;                            // an earlier part that carries it; -1: the canvas
  ViewSource moves;                           // by `move_by` per unit
  std::array<double, 2> move_by{};
  ViewSource turns;  // about z, by `turn_by` rad per unit
  double turn_by = 0;
  ViewSource flow;       // of a path: an arrow on its longest piece, from first to last point where it is positive
  double flow_full = 1;  // at which the arrow is as long as the piece
};

struct ViewLayout {
  std::string file;  // empty: generated
  std::vector<ViewPart> parts;
};

// Of the part's middle in the canvas, `parts` being those before it, while nothing has moved.
std::array<double, 2> place_on_canvas(const std::vector<ViewPart>& parts, const ViewPart& part);

// Reads view.yaml strictly; every complaint is an InputError of one line. Each port of the datasheet must be shown by
// exactly one part.
ViewLayout read_view_layout(const std::string& file, const Datasheet& sheet);

// A box for each component, or for each channel where no port names one: what drives the rig on the left, mechanics on
// the right, transducers in a row below.
ViewLayout generated_layout(const Datasheet& sheet);

// view.yaml beside the datasheet if it is there, else generated.
ViewLayout view_layout(const Datasheet& sheet);

}  // namespace faultline
