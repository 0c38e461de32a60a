#include "nodes/view_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace faultline {
namespace {

constexpr double kMargin = 0.06;                    // of a mark's ground around its text
constexpr double kLow = -3.05, kHigh = 3.2;         // the strips below and above the canvas begin here
constexpr double kFarthest = 2.5, kStep = 0.05;     // of a mark from where it is wanted
constexpr double kOverText = 100, kOverBodies = 8;  // what covering a unit of area weighs against a unit of distance

// At rest, on the canvas; a path has one a piece. Others are seen through clear parts, words as well.
std::vector<Area> bodies_of(const ViewLayout& layout) {
  std::vector<Area> found;
  for (const ViewPart& part : layout.parts) {
    const std::array<double, 2> place = place_on_canvas(layout.parts, part);
    if (part.shape != PartShape::text && part.shape != PartShape::path && !part.clear)
      found.push_back({place[0], place[1], part.size[0], part.size[1]});
    for (std::size_t i = 0; i + 1 < part.points.size(); ++i) {
      const auto &from = part.points[i], &to = part.points[i + 1];
      found.push_back({place[0] + 0.5 * (from[0] + to[0]), place[1] + 0.5 * (from[1] + to[1]),
                       std::abs(to[0] - from[0]) + part.size[0], std::abs(to[1] - from[1]) + part.size[0]});
    }
  }
  return found;
}

struct Offset {
  double x, y, distance;
};

// Nearest first.
const std::vector<Offset>& offsets() {
  static const std::vector<Offset> made = [] {
    std::vector<Offset> all;
    const int most = static_cast<int>(std::lround(kFarthest / kStep));
    for (int i = -most; i <= most; ++i)
      for (int k = -most; k <= most; ++k)
        if (i * i + k * k <= most * most) all.push_back({kStep * i, kStep * k, kStep * std::hypot(i, k)});
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.distance < b.distance; });
    return all;
  }();
  return made;
}

double covered(const Area& area, const std::vector<Area>& others) {
  return std::accumulate(others.begin(), others.end(), 0.0,
                         [&](double sum, const Area& other) { return sum + shared_area(area, other); });
}

Area best_place(const Area& wanted, const std::vector<Area>& texts, const std::vector<Area>& bodies) {
  Area best = wanted;
  double least = 1e9;
  for (const Offset& offset : offsets()) {
    if (offset.distance >= least) break;
    Area area = wanted;
    area.x += offset.x;
    area.y += offset.y;
    if (std::abs(area.x) + 0.5 * area.width > 0.5 * kCanvasWidth || area.y - 0.5 * area.height < kLow ||
        area.y + 0.5 * area.height > kHigh)
      continue;
    const double cost = offset.distance + kOverText * covered(area, texts) + kOverBodies * covered(area, bodies);
    if (cost >= least) continue;
    least = cost;
    best = area;
  }
  return best;
}

}  // namespace

Area text_area(double x, double y, double letters, const std::string& words) {
  if (words.empty()) return {x, y, 0, 0};
  std::size_t longest = 0, lines = 0;
  for (std::size_t begin = 0; begin <= words.size(); ++lines) {
    const std::size_t end = std::min(words.find('\n', begin), words.size());
    longest = std::max(longest, end - begin);
    begin = end + 1;
  }
  return {x, y, 0.5 * letters * static_cast<double>(longest), letters * static_cast<double>(lines)};
}

double shared_area(const Area& a, const Area& b) {
  const double wide = 0.5 * (a.width + b.width) - std::abs(a.x - b.x);
  const double tall = 0.5 * (a.height + b.height) - std::abs(a.y - b.y);
  return wide > 0 && tall > 0 ? std::min({wide, a.width, b.width}) * std::min({tall, a.height, b.height}) : 0;
}

std::vector<Area> mark_places(const ViewLayout& layout, const std::vector<PlacedWords>& labels,
                              const std::vector<PartMark>& marks) {
  const std::vector<Area> bodies = bodies_of(layout);
  std::vector<Area> texts, places(marks.size());
  for (const PlacedWords& label : labels)
    if (!label.words.empty()) texts.push_back(label.area);
  std::vector<std::size_t> order(marks.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return marks[a].level > marks[b].level; });
  for (const std::size_t i : order) {
    if (marks[i].text.empty()) continue;
    const Area& label = labels[i].area;
    Area wanted = text_area(label.x, label.y, layout.parts[i].letters, marks[i].text);
    wanted.width += 2 * kMargin;
    wanted.height += kMargin;
    // Beside the label, away from the part.
    if (!labels[i].words.empty())
      wanted.y += (layout.parts[i].label_at[1] < 0 ? -0.5 : 0.5) * (label.height + wanted.height + kMargin);
    places[i] = best_place(wanted, texts, bodies);
    texts.push_back(places[i]);
  }
  return places;
}

}  // namespace faultline
