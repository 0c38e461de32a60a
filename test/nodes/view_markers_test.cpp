// What a drawing shows of judgements and residuals: colours of parts by alarm and gap, and back; bars as tall as their
// residuals; names of bars that do not overlap.
#include "nodes/view_markers.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "nodes/view_places.h"

namespace faultline {
namespace {

using Colour = std::vector<float>;
using visualization_msgs::Marker;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Colour colour(const std_msgs::ColorRGBA& of) { return {of.r, of.g, of.b}; }

// As docs/views.md and the legend have them.
const Colour kUnjudged{0.80F, 0.80F, 0.80F}, kHealthy{0.48F, 0.67F, 0.82F}, kCandidate{0.98F, 0.91F, 0.35F},
    kGap{0.72F, 0.40F, 0.78F}, kWarning{0.95F, 0.60F, 0.05F}, kError{0.70F, 0.08F, 0.10F},
    kNeverJudged{.72F, .72F, .72F};

// A tank with a clear wall, a pipe of two pieces, and a base without a port.
class Drawn : public testing::Test {
 protected:
  Drawn() {
    for (const char* name : {"flow.tank_air", "restriction.outlet"}) {
      Port port;
      port.name = name;
      sheet_.ports.push_back(port);
    }
    ViewPart tank, outlet, base;
    tank.name = "tank";
    tank.size = {2, 3, 0.3};
    tank.clear = true;
    tank.ports = {"flow.tank_air"};
    tank.label_at = {0, 1.8};
    outlet.name = "outlet";
    outlet.shape = PartShape::path;
    outlet.at = {3, -1, 0};
    outlet.size = {0.1, 0.1, 0.1};
    outlet.points = {{0, 0}, {1, 0}, {1, -1}};
    outlet.ports = {"restriction.outlet"};
    base.name = "base";
    base.at = {0, -2, 0};
    base.size = {3, 0.5, 0.3};
    layout_.parts = {tank, outlet, base};
    alarms_.judged = true;
    alarm_.kind = "fault";
    alarm_.effect = "orifice_leakage";
    alarm_.port = "flow.tank_air";
    alarm_.level = faultline_msgs::Alarm::ERROR;
    alarm_.confidence = 1;
    alarm_.active = true;
    gap_.effect = "clogging";
    gap_.port = "restriction.outlet";
    gap_.worst = 1.5;
    gap_.left_normal = true;
  }

  std::vector<Marker> draw(bool judged, const std::vector<ResidualBar>& bars = {}) const {
    const std::vector<double> unknown(layout_.parts.size(), kNaN);
    return markers_of(layout_, sheet_, part_marks(layout_, sheet_, {judged ? &alarms_ : nullptr, &gap_}),
                      {{}, unknown, unknown, unknown}, {}, bars, "stand")
        .markers;
  }

  // Of the bodies, by part.
  std::map<std::string, std::vector<Colour>> colours(bool judged = true) const {
    std::map<std::string, std::vector<Colour>> found;
    for (const Marker& marker : draw(judged))
      if (marker.ns == "parts") found[marker.header.frame_id.substr(6)].push_back(colour(marker.color));
    return found;
  }

  // The ground of what is told beside a part; empty where nothing is.
  std::vector<Colour> grounds() const {
    std::vector<Colour> found;
    for (const Marker& marker : draw(true))
      if (marker.ns == "labels" && marker.type == Marker::CUBE)
        found.push_back(marker.action == Marker::ADD ? colour(marker.color) : Colour{});
    return found;
  }

  Datasheet sheet_;
  ViewLayout layout_;
  faultline_msgs::AlarmArray alarms_;
  faultline_msgs::Alarm alarm_;
  faultline_msgs::Gap gap_;
};

using ByPart = std::map<std::string, std::vector<Colour>>;

TEST_F(Drawn, APartHasTheColourOfItsAlarmAsLongAsItLasts) {
  gap_.left_normal = false;
  const ByPart nothing{{"tank", {kHealthy}}, {"outlet", {kHealthy, kHealthy}}, {"base", {kNeverJudged}}};
  EXPECT_EQ(colours(), nothing);
  EXPECT_EQ(colours(false).at("tank"), (std::vector<Colour>{kUnjudged}));
  alarm_.equivalent = {"clogging@restriction.outlet"};
  alarms_.alarms = {alarm_};
  EXPECT_EQ(colours(), (ByPart{{"tank", {kError}}, {"outlet", {kCandidate, kCandidate}}, {"base", {kNeverJudged}}}));
  EXPECT_EQ(grounds(), (std::vector<Colour>{kError, kCandidate, {}}));
  alarms_.alarms[0].level = faultline_msgs::Alarm::WARNING;
  EXPECT_EQ(colours().at("tank"), (std::vector<Colour>{kWarning}));
  alarms_.alarms[0].active = false;
  EXPECT_EQ(colours(), nothing);
  EXPECT_EQ(grounds(), (std::vector<Colour>{{}, {}, {}}));
}

TEST_F(Drawn, APartHasTheColourOfTheGapAsLongAsItIsOut) {
  EXPECT_EQ(colours(), (ByPart{{"tank", {kHealthy}}, {"outlet", {kGap, kGap}}, {"base", {kNeverJudged}}}));
  EXPECT_EQ(grounds(), (std::vector<Colour>{{}, kGap, {}}));
  gap_.inseparable = {"flow.tank_air"};
  EXPECT_EQ(colours().at("tank"), (std::vector<Colour>{kCandidate}));
  alarms_.alarms = {alarm_};  // an alarm is graver than a gap's doubt, and takes nothing from the gap's own place
  EXPECT_EQ(colours(), (ByPart{{"tank", {kError}}, {"outlet", {kGap, kGap}}, {"base", {kNeverJudged}}}));
  alarms_.alarms[0].port = "restriction.outlet";
  EXPECT_EQ(colours().at("outlet"), (std::vector<Colour>{kError, kError}));
  alarms_.alarms.clear();
  gap_.left_normal = false;
  EXPECT_EQ(colours(), (ByPart{{"tank", {kHealthy}}, {"outlet", {kHealthy, kHealthy}}, {"base", {kNeverJudged}}}));
  EXPECT_EQ(grounds(), (std::vector<Colour>{{}, {}, {}}));
}

TEST_F(Drawn, AClearPartIsSeenThroughAndLessSoWhereSomethingIsTheMatter) {
  const auto alpha = [&] {
    for (const Marker& marker : draw(true))
      if (marker.ns == "parts" && marker.header.frame_id == "stand/tank") return marker.color.a;
    return 0.0F;
  };
  EXPECT_FLOAT_EQ(alpha(), 0.3F);
  alarms_.alarms = {alarm_};
  EXPECT_FLOAT_EQ(alpha(), 0.55F);
}

// The strip of the verdict is 0.75 tall; below it are 0.45 before the canvas begins.
TEST_F(Drawn, LongSentencesGetSmallerLettersAndStayWithinTheirStrips) {
  const auto heads = [&](std::size_t words) {
    ViewHead head;
    for (std::size_t i = 0; i < words; ++i) head.verdict += "leakage@flow.tank ";
    head.gap = head.verdict;
    const std::vector<double> none(layout_.parts.size(), kNaN);
    std::vector<Area> found;
    for (const Marker& m : markers_of(layout_, sheet_, std::vector<PartMark>(layout_.parts.size()),
                                      {{}, none, none, none}, head, {}, "stand")
                               .markers)
      if (m.ns == "head" && m.type == Marker::TEXT_VIEW_FACING) {
        found.push_back(text_area(m.pose.position.x, m.pose.position.y, m.scale.z, m.text));
        EXPECT_LE(0.9 * found.back().width, kCanvasWidth) << m.text;  // words are narrower than numbers
      }
    return found;
  };
  for (const std::size_t words : {3U, 12U, 18U, 24U}) {
    const std::vector<Area> found = heads(words);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_LE(found[0].height, 0.65) << words;
    EXPECT_LE(found[1].height, 0.42) << words;
  }
  EXPECT_NEAR(heads(3)[0].height, 0.3, 1e-6);
}

class Bars : public Drawn {
 protected:
  struct Bar {
    double x, foot, tall;
    Colour colour;
  };
  // In the order of `bars`; the two lines of the panel are not among them.
  std::vector<Bar> bars(const std::vector<ResidualBar>& told) const {
    std::vector<Bar> found(told.size());
    for (const Marker& m : draw(true, told))
      if (m.ns == "residuals" && m.id >= 100 && m.id < 200)
        found[static_cast<std::size_t>(m.id - 100)] = {m.pose.position.x, m.pose.position.y - 0.5 * m.scale.y,
                                                       m.scale.y, colour(m.color)};
    return found;
  }
  double line(const std::vector<ResidualBar>& told, int id) const {
    for (const Marker& m : draw(true, told))
      if (m.ns == "residuals" && m.id == id) return m.pose.position.y;
    return kNaN;
  }
};

TEST_F(Bars, AreAsTallAsTheResidualOverSigma) {
  const std::vector<ResidualBar> told = {{"level", 1}, {"flow", 2.5}, {"force", 4}, {"position", 5}, {"speed", 80}};
  const std::vector<Bar> drawn = bars(told);
  const double foot = line(told, 1), unit = (line(told, 2) - foot) / 3;  // the upper line is at 3
  ASSERT_GT(unit, 0.1);
  const double ratios[] = {1, 2.5, 4, 5, 5};  // no taller than the panel
  const Colour colours[] = {kHealthy, kHealthy, kWarning, kError, kError};
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_NEAR(drawn[i].foot, foot, 1e-9);
    EXPECT_NEAR(drawn[i].tall, ratios[i] * unit, 1e-9) << told[i].channel;
    EXPECT_EQ(drawn[i].colour, colours[i]) << told[i].channel;
    EXPECT_GT(drawn[i].x, i > 0 ? drawn[i - 1].x + 0.5 : -8);
  }
  EXPECT_EQ(bars({{"level", 3}})[0].colour, kWarning);
  EXPECT_EQ(bars({{"level", 2.99}})[0].colour, kHealthy);  // and as the fault ends
}

TEST_F(Bars, AreNamedWhereTheirNamesHaveRoom) {
  const auto names = [&](const std::vector<ResidualBar>& told) {
    std::map<int, std::string> found;
    std::vector<Area> areas;
    for (const Marker& m : draw(true, told)) {
      if (m.ns != "residuals" || m.id < 200 || m.action != Marker::ADD) continue;
      found[m.id - 200] = m.text;
      areas.push_back(text_area(m.pose.position.x, m.pose.position.y, m.scale.z, m.text));
      for (std::size_t i = 0; i + 1 < areas.size(); ++i) EXPECT_EQ(shared_area(areas[i], areas.back()), 0) << m.text;
    }
    return found;
  };
  const std::map<int, std::string> few = names({{"shaft_speed", 0.31}, {"motor_pressure", 1.26}});
  EXPECT_EQ(few, (std::map<int, std::string>{{0, "shaft speed 0.3"}, {1, "motor pressure 1.3"}}));
  std::vector<ResidualBar> many;
  for (int i = 0; i < 31; ++i) many.push_back({"v1_outlet_temperature", 1});
  EXPECT_EQ(names(many).size(), 0U);
  many[10].ratio = 2.4;
  many[11].ratio = 7;  // the larger neighbour
  many[30].ratio = 2.1;
  const std::map<int, std::string> standing_out = names(many);
  EXPECT_EQ(standing_out,
            (std::map<int, std::string>{{11, "v1 outlet\ntemperature\n7.0"}, {30, "v1 outlet\ntemperature\n2.1"}}));
}

}  // namespace
}  // namespace faultline
