// A layout for a rig that brings none; see view_layout.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "nodes/view_layout.h"
#include "nodes/view_text.h"

namespace faultline {
namespace {

constexpr double kGap = 0.3;
constexpr double kLow = -kCanvasHeight / 2, kSensorHeight = 1.1;

// Columns from left to right.
int column_of(PortKind kind) {
  switch (kind) {
    case PortKind::command:
    case PortKind::source:
      return 0;
    case PortKind::restriction:
    case PortKind::line:
      return 1;
    case PortKind::flow:
    case PortKind::compliance:
    case PortKind::heat:
      return 2;
    default:
      return 3;
  }
}

ViewPart box(std::size_t number, const std::string& title, double x, double y, double width, double height) {
  ViewPart part;
  part.name = "part_" + std::to_string(number);
  part.at = {x, y, 0};
  part.size = {width, height, 0.2};
  part.letters = std::clamp(0.35 * height, 0.1, 0.2);
  part.label = wrapped(title, static_cast<std::size_t>(std::max(8.0, 1.7 * width / part.letters)));
  return part;
}

using Group = std::pair<std::string, std::vector<const Port*>>;

// Boxes of `groups` in `rows` rows of the rectangle, from the left, from the top.
void fill(const std::vector<Group>& groups, std::size_t columns, double left, double top, double width, double height,
          std::vector<ViewPart>& parts) {
  if (groups.empty()) return;
  const std::size_t rows = (groups.size() + columns - 1) / columns;
  const double wide = width / static_cast<double>(columns), tall = height / static_cast<double>(rows);
  for (std::size_t i = 0; i < groups.size(); ++i) {
    const double x = left + (static_cast<double>(i % columns) + 0.5) * wide;
    const double y = top - (static_cast<double>(i / columns) + 0.5) * tall;
    parts.push_back(
        box(parts.size(), groups[i].first, x, y, wide - kGap, std::min(tall - std::min(kGap, 0.2 * tall), 1.2)));
    for (const Port* port : groups[i].second) parts.back().ports.push_back(port->name);
  }
}

}  // namespace

ViewLayout generated_layout(const Datasheet& sheet) {
  std::array<std::vector<Group>, 4> columns;
  std::vector<Group> sensors;
  for (const Port& port : sheet.ports) {
    std::vector<Group>& groups =
        port.kind == PortKind::sensor ? sensors : columns[static_cast<std::size_t>(column_of(port.kind))];
    const auto same =
        std::find_if(groups.begin(), groups.end(), [&](const Group& group) { return group.first == port.component; });
    if (same == groups.end())
      groups.push_back({port.component, {&port}});
    else
      same->second.push_back(&port);
  }
  ViewLayout layout;
  if (sheet.ports.empty()) {
    std::vector<Group> channels;
    for (const Channel& channel : sheet.channels) channels.push_back({channel.name, {}});
    fill(channels, std::min<std::size_t>(channels.size(), 6), -kCanvasWidth / 2, -kLow, kCanvasWidth, kCanvasHeight,
         layout.parts);
    for (std::size_t i = 0; i < layout.parts.size(); ++i) layout.parts[i].shows.push_back(static_cast<int>(i));
  }
  const auto used = std::count_if(columns.begin(), columns.end(), [](const auto& groups) { return !groups.empty(); });
  const double low = sensors.empty() ? kLow : kLow + kSensorHeight;
  double left = -kCanvasWidth / 2;
  for (const std::vector<Group>& groups : columns) {
    if (groups.empty()) continue;
    const double width = kCanvasWidth / static_cast<double>(used);
    fill(groups, groups.size() > 6 ? 2 : 1, left, -kLow, width, -kLow - low, layout.parts);
    left += width;
  }
  const std::size_t process = layout.parts.size();
  fill(sensors, std::min<std::size_t>(std::max<std::size_t>(sensors.size(), 1), 6), -kCanvasWidth / 2, low,
       kCanvasWidth, kSensorHeight, layout.parts);
  for (std::size_t i = process; i < layout.parts.size(); ++i)
    for (const Port* port : sensors[i - process].second)
      if (sensors[i - process].second.size() == 1)
        layout.parts[i].shows.push_back(find_channel(sheet.channels, port->channel));
  for (ViewPart& part : layout.parts) part.label_at = {0, 0};
  return layout;
}

}  // namespace faultline
