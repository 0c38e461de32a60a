// Layouts: every shipped one is read, shows each port once and has no two texts on top of each other, also where
// neighbours are marked; bad ones are refused in one line; a rig without one gets boxes within the canvas.
#include "nodes/view_layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>

#include "config_folder.h"
#include "faultline/signal/error.h"
#include "nodes/view_markers.h"
#include "nodes/view_places.h"
#include "nodes/view_text.h"

namespace faultline {
namespace {

struct Frame {
  double left, right, low, high;
  std::string text;
};

ViewValues resting(const ViewLayout& layout, const Datasheet& sheet) {
  ViewValues values;
  for (const Channel& channel : sheet.channels) values.channels.push_back(channel.maximum);
  values.moves.assign(layout.parts.size(), std::numeric_limits<double>::quiet_NaN());
  values.turns = values.flows = values.moves;
  return values;
}

std::vector<PartMark> healthy(const ViewLayout& layout) {
  return std::vector<PartMark>(layout.parts.size(), {PartLevel::healthy, ""});
}

// About what rviz makes of a text: a letter is half as wide as it is tall.
std::vector<Frame> texts(const ViewLayout& layout, const Datasheet& sheet, const std::vector<PartMark>& marks) {
  std::map<std::string, std::pair<double, double>> places{{"press_1", {0, 0}}};
  for (std::size_t i = 0; i < layout.parts.size(); ++i) {
    const geometry_msgs::TransformStamped frame = frame_of(layout, i, resting(layout, sheet), "press_1");
    const auto parent = places.at(frame.header.frame_id);
    places[frame.child_frame_id] = {parent.first + frame.transform.translation.x,
                                    parent.second + frame.transform.translation.y};
  }
  std::vector<Frame> found;
  const visualization_msgs::MarkerArray drawing =
      markers_of(layout, sheet, marks, resting(layout, sheet), {"No fault found.", "", PartLevel::healthy},
                 {{"a", 1}, {"b", 4}}, "press_1");
  for (const visualization_msgs::Marker& marker : drawing.markers) {
    if (marker.type != visualization_msgs::Marker::TEXT_VIEW_FACING || marker.text.empty()) continue;
    std::size_t longest = 0, lines = 0;
    for (std::size_t begin = 0; begin <= marker.text.size(); ++lines) {
      const std::size_t end = std::min(marker.text.find('\n', begin), marker.text.size());
      longest = std::max(longest, end - begin);
      begin = end + 1;
    }
    const auto place = places.at(marker.header.frame_id);
    const double x = place.first + marker.pose.position.x, y = place.second + marker.pose.position.y;
    const double half = 0.25 * marker.scale.z * static_cast<double>(longest);
    const double tall = 0.5 * marker.scale.z * static_cast<double>(lines);
    found.push_back({x - half, x + half, y - tall, y + tall, marker.text});
  }
  return found;
}

void expect_apart(const std::vector<Frame>& found, const std::string& when) {
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_GE(found[i].left, -0.5 * kCanvasWidth - 0.2) << found[i].text;
    EXPECT_LE(found[i].right, 0.5 * kCanvasWidth + 0.2) << found[i].text;
    for (std::size_t k = 0; k < i; ++k) {
      const bool apart = found[i].right < found[k].left || found[k].right < found[i].left ||
                         found[i].high < found[k].low || found[k].high < found[i].low;
      EXPECT_TRUE(apart) << "'" << found[i].text << "' and '" << found[k].text << "' " << when;
    }
  }
}

class ShippedLayout : public testing::TestWithParam<std::string> {
 protected:
  Datasheet sheet_ = find_datasheet(config_folder(), GetParam());
  ViewLayout layout_ = view_layout(sheet_);
};

TEST_P(ShippedLayout, IsReadAndItsLabelsStandApart) {
  EXPECT_NE(layout_.file, "");
  EXPECT_TRUE(std::any_of(layout_.parts.begin(), layout_.parts.end(), moves));
  const std::vector<Frame> found = texts(layout_, sheet_, healthy(layout_));
  EXPECT_GT(found.size(), 15U);
  expect_apart(found, "");
}

// A label on a part that is not its own names the wrong one.
TEST_P(ShippedLayout, HasNoLabelOnAnotherPart) {
  for (const ViewPart& named : layout_.parts) {
    if (named.label.empty() && named.shows.empty()) continue;
    const std::array<double, 2> place = place_on_canvas(layout_.parts, named);
    std::string words = named.label;
    for (std::size_t i = 0; i < named.shows.size(); ++i) words += words.empty() ? "0.000 MPa" : "\n0.000 MPa";
    const Area area = text_area(place[0] + named.label_at[0], place[1] + named.label_at[1], named.letters, words);
    for (const ViewPart& other : layout_.parts) {
      if (&other == &named || other.shape == PartShape::text || other.shape == PartShape::path || other.clear) continue;
      const std::array<double, 2> at = place_on_canvas(layout_.parts, other);
      EXPECT_EQ(shared_area(area, {at[0], at[1], other.size[0], other.size[1]}), 0)
          << "the label of " << named.name << " on " << other.name;
    }
  }
}

// Each part in turn with the four others next to it, all with something to tell.
TEST_P(ShippedLayout, MarksOfNeighboursStandApart) {
  std::vector<std::size_t> judged;
  for (std::size_t i = 0; i < layout_.parts.size(); ++i)
    if (!layout_.parts[i].ports.empty()) judged.push_back(i);
  const auto distance = [&](std::size_t a, std::size_t b) {
    const std::array<double, 2> p = place_on_canvas(layout_.parts, layout_.parts[a]);
    const std::array<double, 2> q = place_on_canvas(layout_.parts, layout_.parts[b]);
    return std::hypot(p[0] - q[0], p[1] - q[1]);
  };
  for (const std::size_t i : judged) {
    std::vector<std::size_t> near = judged;
    std::sort(near.begin(), near.end(), [&](std::size_t a, std::size_t b) { return distance(a, i) < distance(b, i); });
    std::vector<PartMark> marks = healthy(layout_);
    const std::vector<PartMark> told = {{PartLevel::error, "orifice leakage 100 %"},
                                        {PartLevel::gap, "gap: laminar leakage"},
                                        {PartLevel::candidate, "clogging?"},
                                        {PartLevel::warning, "sensor offset 67 %"},
                                        {PartLevel::candidate, "gap?"}};
    for (std::size_t k = 0; k < told.size(); ++k) marks[near[k]] = told[k];
    const std::vector<Frame> found = texts(layout_, sheet_, marks);
    for (const PartMark& mark : told)
      EXPECT_EQ(std::count_if(found.begin(), found.end(), [&](const Frame& f) { return f.text == mark.text; }), 1);
    expect_apart(found, "around " + layout_.parts[i].name);
  }
}

std::vector<std::string> rigs() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(config_folder()))
    if (std::filesystem::exists(entry.path() / "rig.yaml")) names.push_back(entry.path().filename().string());
  return names;
}
INSTANTIATE_TEST_SUITE_P(Rigs, ShippedLayout, testing::ValuesIn(rigs()), [](const auto& one) { return one.param; });

// A short layout of a rig with three ports.
class WrittenLayout : public testing::Test {
 protected:
  WrittenLayout() {
    sheet_.rig = "stand";
    sheet_.file = "rig.yaml";
    Channel level;
    level.name = "level";
    level.unit = "m";
    level.maximum = 2;
    sheet_.channels = {level};
    sheet_.states = {{"depth", "h", "m", 0}};
    for (const char* name : {"flow.tank_air", "sensor.level", "restriction.outlet"}) {
      Port port;
      port.name = name;
      port.kind = port_kind(name);
      port.component = name;
      if (port.kind == PortKind::sensor) port.channel = "level";
      sheet_.ports.push_back(port);
    }
  }
  ViewLayout read(const std::string& text) {
    const std::string file = testing::TempDir() + "view_layout_test.yaml";
    std::ofstream(file) << text;
    return read_view_layout(file, sheet_);
  }
  std::string refused(const std::string& text) {
    try {
      read(text);
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return "not refused";
  }
  Datasheet sheet_;
  const std::string good_ =
      "rig: stand\nparts:\n"
      "  - {name: tank, shape: box, at: [1, 0], size: [2, 3], ports: [flow.tank_air], label: Tank, shows: [level]}\n"
      "  - {name: float, shape: cylinder, along: x, at: [0, -1], size: [1, 0.2], on: tank, moves: {with: depth, by: "
      "[0, 0.5]}, ports: [sensor.level]}\n";
  const std::string outlet_ =
      "  - {name: outlet, shape: path, at: [3, -1], size: [0.1], points: [[0, 0], [2, 0]], ports: "
      "[restriction.outlet]}\n";
};

TEST_F(WrittenLayout, GivesFramesThatMove) {
  const ViewLayout layout = read(good_ + outlet_);
  ASSERT_EQ(layout.parts.size(), 3U);
  EXPECT_TRUE(moves(layout.parts[1]));
  EXPECT_FALSE(moves(layout.parts[0]));
  EXPECT_EQ(layout.parts[1].moves.channel, 0);  // where there is no estimate
  ViewValues values = resting(layout, sheet_);
  values.moves[1] = 1.5;
  const geometry_msgs::TransformStamped frame = frame_of(layout, 1, values, "press_1");
  EXPECT_EQ(frame.header.frame_id, "press_1/tank");
  EXPECT_EQ(frame.child_frame_id, "press_1/float");
  EXPECT_DOUBLE_EQ(frame.transform.translation.y, -1 + 0.5 * 1.5);
  EXPECT_EQ(frame_of(layout, 0, values, "press_1").header.frame_id, "press_1");
}

TEST_F(WrittenLayout, IsRefusedInOneLineThatNamesTheKey) {
  const std::map<std::string, std::string> wrong = {
      {"rig: other\nparts: []\n", "'rig' is 'other'"},
      {"rig: stand\nparts: []\n", "no part with the port flow.tank_air, sensor.level, restriction.outlet"},
      {good_, "no part with the port restriction.outlet"},
      {good_ + "  - {name: outlet, shape: cone, at: [0, 0]}\n", "is 'cone'; allowed are box"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], colour: red}\n", "'colour'"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0]}\n", "lacks the key 'size'"},
      {good_ + "  - {name: outlet, shape: box, at: [9, 0], size: [1, 1]}\n", "the canvas ends at 8, 3"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [-1, 1]}\n", "must be above 0"},
      {good_ + "  - {name: tank, shape: box, at: [0, 0], size: [1, 1]}\n", "a second time"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], ports: [restriction.outlets]}\n",
       "did you mean 'restriction.outlet'?"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], ports: [sensor.level]}\n",
       "which an earlier part shows"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], on: tanks}\n", "did you mean 'tank'?"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], moves: {with: levels, by: [1, 1]}}\n",
       "no channel and no state of the rig"},
      {good_ + "  - {name: outlet, shape: box, at: [0, 0], size: [1, 1], points: [[0, 0], [1, 1]]}\n",
       "is for shape: path only"},
      {good_ + "  - {name: outlet, shape: path, at: [0, 0], size: [1]}\n", "lacks the key 'points'"},
      {good_ + "  - {name: outlet, shape: text, at: [0, 0], ports: [restriction.outlet]}\n", "not for shape: text"},
  };
  for (const auto& [text, message] : wrong) EXPECT_NE(refused(text).find(message), std::string::npos) << refused(text);
}

TEST_F(WrittenLayout, IsMadeWhereThereIsNone) {
  const ViewLayout layout = view_layout(sheet_);
  EXPECT_EQ(layout.file, "");
  std::vector<std::string> shown;
  for (const ViewPart& part : layout.parts) {
    shown.insert(shown.end(), part.ports.begin(), part.ports.end());
    EXPECT_LE(std::abs(part.at[0]) + 0.5 * part.size[0], 0.5 * kCanvasWidth);
    EXPECT_LE(std::abs(part.at[1]) + 0.5 * part.size[1], 0.5 * kCanvasHeight);
  }
  std::sort(shown.begin(), shown.end());
  EXPECT_EQ(shown, (std::vector<std::string>{"flow.tank_air", "restriction.outlet", "sensor.level"}));
  sheet_.ports.clear();
  const ViewLayout bare = view_layout(sheet_);
  ASSERT_EQ(bare.parts.size(), 1U);
  EXPECT_EQ(bare.parts[0].shows, std::vector<int>{0});
}

// Boxes of a rig with many ports do not overlap either.
TEST(GeneratedLayout, KeepsBoxesApart) {
  for (const std::string& rig : rigs()) {
    const ViewLayout layout = generated_layout(find_datasheet(config_folder(), rig));
    for (std::size_t i = 0; i < layout.parts.size(); ++i)
      for (std::size_t k = 0; k < i; ++k) {
        const ViewPart &a = layout.parts[i], &b = layout.parts[k];
        EXPECT_TRUE(std::abs(a.at[0] - b.at[0]) >= 0.5 * (a.size[0] + b.size[0]) ||
                    std::abs(a.at[1] - b.at[1]) >= 0.5 * (a.size[1] + b.size[1]))
            << rig << ": " << a.label << ", " << b.label;
      }
  }
}

TEST_F(WrittenLayout, PartsHaveTheWorstOfAlarmAndGap) {
  const ViewLayout layout = read(good_ + outlet_);
  faultline_msgs::AlarmArray alarms;
  faultline_msgs::Gap gap;
  const auto levels = [&](bool judged) {
    std::vector<PartLevel> found;
    for (const PartMark& mark : part_marks(layout, sheet_, {judged ? &alarms : nullptr, &gap}))
      found.push_back(mark.level);
    return found;
  };
  using L = PartLevel;
  EXPECT_EQ(levels(false), (std::vector<L>{L::unjudged, L::unjudged, L::unjudged}));
  EXPECT_EQ(levels(true), (std::vector<L>{L::unjudged, L::unjudged, L::unjudged}));  // heard, but of nothing
  EXPECT_EQ(level_of(alarms), L::unjudged);
  alarms.judged = true;
  EXPECT_EQ(levels(true), (std::vector<L>{L::healthy, L::healthy, L::healthy}));
  EXPECT_EQ(level_of(alarms), L::healthy);
  faultline_msgs::Alarm alarm;
  alarm.kind = "fault";
  alarm.effect = "orifice_leakage";
  alarm.port = "flow.tank_air";
  alarm.level = faultline_msgs::Alarm::ERROR;
  alarm.confidence = 0.87;
  alarm.active = true;
  alarm.equivalent = {"clogging@restriction.outlet"};
  alarms.alarms = {alarm};
  EXPECT_EQ(level_of(alarms), L::error);
  EXPECT_EQ(levels(true), (std::vector<L>{L::error, L::healthy, L::candidate}));
  EXPECT_EQ(part_marks(layout, sheet_, {&alarms, nullptr})[0].text, "orifice leakage 87 %");
  EXPECT_EQ(part_marks(layout, sheet_, {&alarms, nullptr})[2].text, "clogging?");
  alarms.alarms[0].confidence = 0.33;  // less than even odds
  EXPECT_EQ(levels(true), (std::vector<L>{L::candidate, L::healthy, L::candidate}));
  EXPECT_EQ(level_of(alarms), L::warning);
  alarms.alarms[0].kind = "data";  // by channel; no claim that confidence is about
  alarms.alarms[0].effect = "";
  alarms.alarms[0].port = "level";
  alarms.alarms[0].equivalent.clear();
  EXPECT_EQ(levels(true), (std::vector<L>{L::healthy, L::error, L::healthy}));
  alarms.alarms[0].level = faultline_msgs::Alarm::WARNING;
  gap.left_normal = true;
  gap.port = "sensor.level";
  gap.worst = 2;
  gap.inseparable = {"flow.tank_air"};
  EXPECT_EQ(levels(true), (std::vector<L>{L::candidate, L::warning, L::healthy}));
  gap.worst = 4;  // graver than a warning
  EXPECT_EQ(levels(true), (std::vector<L>{L::candidate, L::gap, L::healthy}));
  alarms.alarms[0].active = false;
  EXPECT_EQ(level_of(alarms), L::healthy);
  gap.port = "";  // not placed: no part
  gap.inseparable.clear();
  EXPECT_EQ(levels(true), (std::vector<L>{L::healthy, L::healthy, L::healthy}));
  gap.left_normal = false;
  EXPECT_EQ(levels(true), (std::vector<L>{L::healthy, L::healthy, L::healthy}));
}

TEST(ShownValue, HasAPrefixByTheRange) {
  Channel channel;
  const auto shown = [&](double value, const std::string& unit, double largest) {
    channel.unit = unit;
    channel.maximum = largest;
    return shown_value(value, channel);
  };
  EXPECT_EQ(shown(4.5234e6, "Pa", 1e7), "4.52 MPa");
  EXPECT_EQ(shown(2.2094e5, "Pa", 8e5), "220.9 kPa");
  EXPECT_EQ(shown(0.0521, "m", 0.127), "52.1 mm");
  EXPECT_EQ(shown(0.01, "m^3/s", 0.03), "600 l/min");
  EXPECT_EQ(shown(0.25, "1", 1), "0.250");
  EXPECT_EQ(wrapped("one two three", 8), "one two\nthree");
}

}  // namespace
}  // namespace faultline
