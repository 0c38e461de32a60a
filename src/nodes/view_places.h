// Where words stand in a drawing. Text is taken to be as large as rviz draws it: a letter half as wide as it is tall,
// which is somewhat wide for words and right for numbers. Places are of the drawing while nothing has moved, so that
// words do not wander with the parts. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "nodes/view_marks.h"

namespace faultline {

struct Area {
  double x = 0, y = 0, width = 0, height = 0;  // its middle in the canvas, its extents
};

struct PlacedWords {
  std::string words;
  Area area;
};

Area text_area(double x, double y, double letters, const std::string& words);

// That both cover.
double shared_area(const Area& a, const Area& b);

// Of every part, where its mark's text stands: beside the label (where there is none, in its place), or as near to that
// as it covers no other text and little of the parts. The graver a mark, the earlier it chooses. Where all is full, the
// least is covered.
std::vector<Area> mark_places(const ViewLayout& layout, const std::vector<PlacedWords>& labels,
                              const std::vector<PartMark>& marks);

}  // namespace faultline
