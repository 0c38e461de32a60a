#include "nodes/view_markers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "nodes/view_places.h"
#include "nodes/view_text.h"

namespace faultline {
namespace {

using visualization_msgs::Marker;

constexpr double kTextHeight = 0.6;  // z of all text: above every body
constexpr double kGapLetters = 0.18, kBarLetters = 0.15, kLeastLetters = 0.12;
constexpr std::size_t kNamedBars = 12;                // of more than so many only those are named that stand out
constexpr double kStandsOut = 2;                      // sigma
constexpr double kBarsLeft = -7.6, kBarsRight = 4.2;  // x of the residuals' panel
constexpr double kBarsFoot = -4.05, kBarsTall = 0.75;
constexpr double kBarsFull = 5;      // sigma at the top of the panel
constexpr double kBarsLimit = 3;     // sigma: the line across it
constexpr double kLeastFlow = 0.03;  // of full, below which no arrow is drawn

std_msgs::ColorRGBA grey(float level, float alpha = 1) {
  std_msgs::ColorRGBA made;
  made.r = made.g = made.b = level;
  made.a = alpha;
  return made;
}

geometry_msgs::Point point(double x, double y, double z) {
  geometry_msgs::Point made;
  made.x = x;
  made.y = y;
  made.z = z;
  return made;
}

class Drawing {
 public:
  explicit Drawing(std::string space) : space_(std::move(space)) {}

  Marker& add(const std::string& name_space, std::size_t id, int type, const std::string& frame) {
    Marker marker;
    marker.header.frame_id = frame.empty() ? space_ : space_ + "/" + frame;
    marker.ns = name_space;
    marker.id = static_cast<int>(id);
    marker.type = type;
    marker.action = Marker::ADD;
    marker.pose.orientation.w = 1;
    marker.frame_locked = true;
    array_.markers.push_back(marker);
    return array_.markers.back();
  }

  void text(const std::string& name_space, std::size_t id, const std::string& frame, double x, double y, double letters,
            const std::string& words, const std_msgs::ColorRGBA& colour = grey(0.1F)) {
    Marker& marker = add(name_space, id, Marker::TEXT_VIEW_FACING, frame);
    marker.pose.position = point(x, y, kTextHeight);
    marker.scale.z = letters;
    marker.color = colour;
    marker.text = words;
    if (words.empty()) marker.action = Marker::DELETE;
  }

  void box(const std::string& name_space, std::size_t id, double x, double y, double width, double height, double z,
           const std_msgs::ColorRGBA& colour) {
    Marker& marker = add(name_space, id, Marker::CUBE, "");
    marker.pose.position = point(x, y, z);
    marker.scale.x = width;
    marker.scale.y = height;
    marker.scale.z = 0.02;
    marker.color = colour;
  }

  visualization_msgs::MarkerArray take() { return std::move(array_); }

 private:
  std::string space_;
  visualization_msgs::MarkerArray array_;
};

// A piece of a path: markers of lines are drawn askew at their corners.
void draw_piece(const ViewPart& part, std::size_t piece, std::size_t id, const std_msgs::ColorRGBA& colour,
                Drawing& drawing) {
  Marker& body = drawing.add("parts", 1000 * (id + 1) + piece, Marker::CUBE, part.name);
  const auto &from = part.points[piece], &to = part.points[piece + 1];
  const double angle = std::atan2(to[1] - from[1], to[0] - from[0]);
  body.pose.position = point(0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1]), 0);
  body.pose.orientation.z = std::sin(0.5 * angle);
  body.pose.orientation.w = std::cos(0.5 * angle);
  body.scale.x = std::hypot(to[0] - from[0], to[1] - from[1]) + part.size[0];
  body.scale.y = body.scale.z = part.size[0];
  body.color = colour;
}

void draw_body(const ViewPart& part, std::size_t id, const PartMark& mark, Drawing& drawing) {
  if (part.shape == PartShape::text) return;
  const std_msgs::ColorRGBA colour = part.ports.empty() ? grey(0.72F) : colour_of(mark.level);
  if (part.shape == PartShape::path) {
    for (std::size_t i = 0; i + 1 < part.points.size(); ++i) draw_piece(part, i, id, colour, drawing);
    return;
  }
  static const int types[] = {Marker::CUBE, Marker::CYLINDER, Marker::SPHERE};
  Marker& body = drawing.add("parts", id, types[static_cast<int>(part.shape)], part.name);
  body.color = colour;
  body.scale.x = part.size[0];
  body.scale.y = part.size[1];
  body.scale.z = part.size[2];
  if (part.shape == PartShape::cylinder && part.along != 'z') {
    // The marker's own axis is z; the extents are told before it is turned.
    const double half = std::sqrt(0.5);
    body.pose.orientation.w = half;
    if (part.along == 'x') {
      body.pose.orientation.y = half;
      std::swap(body.scale.x, body.scale.z);
    } else {
      body.pose.orientation.x = -half;
      std::swap(body.scale.y, body.scale.z);
    }
  }
  if (part.clear) body.color.a = mark.level <= PartLevel::healthy ? 0.3F : 0.55F;
}

std::string label_of(const ViewPart& part, const Datasheet& sheet, const ViewValues& values) {
  std::string words = part.label;
  for (const int channel : part.shows) {
    const double value = values.channels[static_cast<std::size_t>(channel)];
    if (!words.empty()) words += '\n';
    words += std::isnan(value) ? "-" : shown_value(value, sheet.channels[static_cast<std::size_t>(channel)]);
  }
  return words;
}

void draw_labels(const ViewLayout& layout, const Datasheet& sheet, const std::vector<PartMark>& marks,
                 const ViewValues& values, Drawing& drawing) {
  std::vector<PlacedWords> labels;
  for (const ViewPart& part : layout.parts) {
    const std::array<double, 2> place = place_on_canvas(layout.parts, part);
    const std::string words = label_of(part, sheet, values);
    labels.push_back({words, text_area(place[0] + part.label_at[0], place[1] + part.label_at[1], part.letters, words)});
  }
  const std::vector<Area> places = mark_places(layout, labels, marks);
  for (std::size_t i = 0; i < layout.parts.size(); ++i) {
    const ViewPart& part = layout.parts[i];
    const std::string parent = part.parent < 0 ? "" : layout.parts[static_cast<std::size_t>(part.parent)].name;
    const std::array<double, 2> place = place_on_canvas(layout.parts, part);
    const double left = place[0] - part.at[0], low = place[1] - part.at[1];  // of the parent
    const bool dark = marks[i].level == PartLevel::error && std::abs(part.label_at[0]) < part.size[0] / 2 &&
                      std::abs(part.label_at[1]) < part.size[1] / 2 && !part.clear;
    drawing.text("labels", i, parent, labels[i].area.x - left, labels[i].area.y - low, part.letters, labels[i].words,
                 grey(dark ? 1.0F : 0.1F));
    // What is the matter, on a ground of its own.
    const double x = places[i].x - left, y = places[i].y - low;
    Marker& ground = drawing.add("labels", 10000 + i, Marker::CUBE, parent);
    if (marks[i].text.empty()) {
      ground.action = Marker::DELETE;
    } else {
      ground.pose.position = point(x, y, kTextHeight - 0.05);
      ground.scale.x = places[i].width;
      ground.scale.y = places[i].height;
      ground.scale.z = 0.01;
      ground.color = colour_of(marks[i].level);
    }
    drawing.text("labels", 20000 + i, parent, x, y, part.letters, marks[i].text,
                 grey(marks[i].level == PartLevel::error ? 1.0F : 0.05F));
  }
}

void draw_flow(const ViewPart& part, std::size_t id, double value, Drawing& drawing) {
  Marker& arrow = drawing.add("flows", id, Marker::ARROW, part.name);
  const double share = std::isnan(value) ? 0 : std::clamp(value / part.flow_full, -1.0, 1.0);
  if (std::abs(share) < kLeastFlow) {
    arrow.action = Marker::DELETE;
    return;
  }
  std::size_t longest = 0;
  double length = 0;
  for (std::size_t i = 0; i + 1 < part.points.size(); ++i) {
    const double piece =
        std::hypot(part.points[i + 1][0] - part.points[i][0], part.points[i + 1][1] - part.points[i][1]);
    if (piece > length) {
      length = piece;
      longest = i;
    }
  }
  const auto& from = part.points[longest];
  const auto& to = part.points[longest + 1];
  const double half = 0.5 * share;
  const double x = 0.5 * (from[0] + to[0]), y = 0.5 * (from[1] + to[1]), dx = to[0] - from[0], dy = to[1] - from[1];
  arrow.points = {point(x - half * dx, y - half * dy, 0.3), point(x + half * dx, y + half * dy, 0.3)};
  arrow.scale.x = 0.12;
  arrow.scale.y = 0.3;
  arrow.scale.z = std::min(0.25, 0.5 * std::abs(share) * length);
  arrow.color.g = 0.25F;
  arrow.color.b = 0.45F;
  arrow.color.a = 1;
}

void draw_bars(const std::vector<ResidualBar>& bars, Drawing& drawing) {
  const bool many = bars.size() > kNamedBars;
  const std::string heading =
      bars.empty() ? "no residuals yet"
                   : fmt::format("residual over sigma, mean of 1 s; line at {:g}{}", kBarsLimit,
                                 many ? fmt::format("; {} channels, named from {:g}", bars.size(), kStandsOut) : "");
  const double middle = 0.5 * (kBarsLeft + kBarsRight), whole = kBarsRight - kBarsLeft;
  drawing.text("residuals", 0, "", middle, kBarsFoot + kBarsTall + 0.17, kBarLetters, heading);
  drawing.box("residuals", 1, middle, kBarsFoot, whole, 0.02, 0, grey(0.3F));
  drawing.box("residuals", 2, middle, kBarsFoot + kBarsTall * kBarsLimit / kBarsFull, whole, 0.015, 0.2, grey(0.5F));
  if (bars.empty()) return;
  const double wide = std::min(whole / static_cast<double>(bars.size()), 2.0);
  const double left = middle - 0.5 * wide * static_cast<double>(bars.size());
  std::vector<Area> names;
  std::vector<std::size_t> order(bars.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return bars[a].ratio > bars[b].ratio; });
  for (const std::size_t i : order) {
    const double x = left + (static_cast<double>(i) + 0.5) * wide;
    const double tall = kBarsTall * std::clamp(bars[i].ratio / kBarsFull, 0.01, 1.0);
    const PartLevel level = bars[i].ratio >= kBarsFull    ? PartLevel::error
                            : bars[i].ratio >= kBarsLimit ? PartLevel::warning
                                                          : PartLevel::healthy;
    drawing.box("residuals", 100 + i, x, kBarsFoot + 0.5 * tall, 0.4 * wide, tall, 0.1, colour_of(level));
    // Of bars so close that their names would overlap, the largest has its name.
    const auto letters = static_cast<std::size_t>(std::max(11.0, 1.8 * wide / kBarLetters));
    const std::string name = wrapped(fmt::format("{} {:.1f}", words_of(bars[i].channel), bars[i].ratio), letters);
    Area area = text_area(x, 0, kBarLetters, name);
    area.y = kBarsFoot - 0.04 - 0.5 * area.height;
    const bool told = (!many || bars[i].ratio >= kStandsOut) &&
                      std::none_of(names.begin(), names.end(), [&](const Area& a) { return shared_area(a, area) > 0; });
    if (told) names.push_back(area);
    drawing.text("residuals", 200 + i, "", area.x, area.y, kBarLetters, told ? name : "");
  }
}

// Text in the middle of the canvas, as large as it fits into a strip so tall, at most `letters`.
void draw_strip(std::size_t id, double y, double tall, double letters, const std::string& text,
                const std_msgs::ColorRGBA& colour, Drawing& drawing) {
  std::string words;
  for (;; letters -= 0.01) {
    words = wrapped(text, static_cast<std::size_t>(34 / letters));
    const auto lines = static_cast<double>(1 + std::count(words.begin(), words.end(), '\n'));
    if (letters * lines <= tall || letters <= kLeastLetters) break;
  }
  drawing.text("head", id, "", 0, y, letters, words, colour);
}

void draw_head(const ViewHead& head, Drawing& drawing) {
  drawing.box("head", 0, 0, 4.05, kCanvasWidth, 0.75, 0, colour_of(head.level));
  draw_strip(1, 4.05, 0.62, 0.3, head.verdict, grey(head.level == PartLevel::error ? 1.0F : 0.05F), drawing);
  draw_strip(2, 3.42, 0.4, kGapLetters, head.gap, grey(0.1F), drawing);
}

void draw_legend(const std::string& space, Drawing& drawing) {
  drawing.text("legend", 1000, "", 6.3, -3.1, 0.19, space);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto level = static_cast<PartLevel>(i);
    const double x = 5.45 + 1.7 * static_cast<double>(i % 2), y = -3.45 - 0.4 * static_cast<double>(i / 2);
    drawing.box("legend", i, x, y, 1.6, 0.34, 0, colour_of(level));
    drawing.text("legend", 100 + i, "", x, y, 0.19, words_of(level), grey(level == PartLevel::error ? 1.0F : 0.05F));
  }
}

}  // namespace

bool moves(const ViewPart& part) { return !part.moves.name.empty() || !part.turns.name.empty(); }

geometry_msgs::TransformStamped frame_of(const ViewLayout& layout, std::size_t i, const ViewValues& values,
                                         const std::string& space) {
  const ViewPart& part = layout.parts[i];
  geometry_msgs::TransformStamped frame;
  frame.header.frame_id =
      part.parent < 0 ? space : space + "/" + layout.parts[static_cast<std::size_t>(part.parent)].name;
  frame.child_frame_id = space + "/" + part.name;
  const double moved = std::isfinite(values.moves[i]) ? values.moves[i] : 0;
  const double turned = std::isfinite(values.turns[i]) ? part.turn_by * values.turns[i] : 0;
  frame.transform.translation.x = part.at[0] + part.move_by[0] * moved;
  frame.transform.translation.y = part.at[1] + part.move_by[1] * moved;
  frame.transform.translation.z = part.at[2];
  frame.transform.rotation.z = std::sin(0.5 * turned);
  frame.transform.rotation.w = std::cos(0.5 * turned);
  return frame;
}

visualization_msgs::MarkerArray markers_of(const ViewLayout& layout, const Datasheet& sheet,
                                           const std::vector<PartMark>& marks, const ViewValues& values,
                                           const ViewHead& head, const std::vector<ResidualBar>& bars,
                                           const std::string& space) {
  Drawing drawing(space);
  for (std::size_t i = 0; i < layout.parts.size(); ++i) {
    draw_body(layout.parts[i], i, marks[i], drawing);
    if (!layout.parts[i].flow.name.empty()) draw_flow(layout.parts[i], i, values.flows[i], drawing);
  }
  draw_labels(layout, sheet, marks, values, drawing);
  draw_head(head, drawing);
  draw_bars(bars, drawing);
  draw_legend(space, drawing);
  return drawing.take();
}

}  // namespace faultline
