// Assessments as messages: there and back number for number, and joined again whatever the order of the topics.
#include "nodes/assessment_messages.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <limits>
#include <vector>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"

namespace faultline {
namespace {

Assessment full(std::uint64_t number) {
  Assessment a;
  a.time = to_seconds(to_stamp(1.7e9 + 1e-3 * static_cast<double>(number)));
  a.sequence = number;
  a.judged = true;
  a.undecided_since = 2.0 / 7;
  a.channel_status = {ChannelStatus::good, ChannelStatus::out_of_range};
  DetectorResult d;
  d.name = "internal_leak";
  d.detection = {true, 1.0 / 3, true, 2.0 / 3, -1e-300, 1e300, 4e-9, 0.7, true};
  d.size_name = "leak_flow";
  d.size_unit = "m^3/s";
  d.evidence = 1.25;
  d.reason = Reason::model_does_not_fit;
  d.takes_over = 1;
  a.detectors.push_back(d);
  IsolatorResult i;
  i.name = "fault";
  i.finding.active = true;
  i.finding.since = 1.7e9 + 1.0 / 3;
  i.finding.kind = AlarmKind::sensor;
  i.finding.effect = "offset";
  i.finding.port = "sensor.position";
  i.finding.equivalent = {"scale@sensor.position", "lag@sensor.position"};
  i.finding.text = "Position: offset";
  i.finding.has_size = true;
  i.finding.size_name = "value";
  i.finding.size_unit = "m";
  i.finding.size = 1.0 / 7;
  i.finding.low = 0.1;
  i.finding.high = 0.2;
  i.finding.none = std::numeric_limits<double>::infinity();
  i.finding.confidence = 0.9;
  i.reason = Reason::told_by_another;
  i.detector = 0;
  a.isolators.push_back(i);
  return a;
}

auto detections(std::uint64_t number) {
  return boost::make_shared<const faultline_msgs::Detections>(detections_of(full(number), "rig"));
}
auto hypotheses(std::uint64_t number) {
  return boost::make_shared<const faultline_msgs::Hypotheses>(hypotheses_of(full(number), "rig"));
}

TEST(AssessmentMessages, ThereAndBack) {
  const Assessment a = full(3), b = to_assessment(*detections(3), *hypotheses(3));
  EXPECT_EQ(b.time, a.time);
  EXPECT_EQ(b.sequence, 3u);
  EXPECT_TRUE(b.judged);
  EXPECT_EQ(b.undecided_since, a.undecided_since);
  EXPECT_EQ(b.channel_status, a.channel_status);
  const DetectorResult &d = b.detectors.at(0), &e = a.detectors[0];
  EXPECT_EQ(d.name, e.name);
  EXPECT_TRUE(d.detection.active && d.detection.has_size && d.detection.blind);
  EXPECT_EQ(d.detection.since, e.detection.since);
  EXPECT_EQ(d.detection.size, e.detection.size);
  EXPECT_EQ(d.detection.low, e.detection.low);
  EXPECT_EQ(d.detection.high, e.detection.high);
  EXPECT_EQ(d.detection.per_effect, e.detection.per_effect);
  EXPECT_EQ(d.detection.confidence, e.detection.confidence);
  EXPECT_EQ(d.size_name + d.size_unit, e.size_name + e.size_unit);
  EXPECT_EQ(d.evidence, e.evidence);
  EXPECT_EQ(d.reason, e.reason);
  EXPECT_EQ(d.takes_over, 1);
  const Finding &f = b.isolators.at(0).finding, &g = a.isolators[0].finding;
  EXPECT_EQ(b.isolators[0].name, "fault");
  EXPECT_EQ(b.isolators[0].reason, Reason::told_by_another);
  EXPECT_EQ(b.isolators[0].detector, 0);
  EXPECT_TRUE(f.active && f.has_size);
  EXPECT_EQ(f.since, g.since);
  EXPECT_EQ(f.kind, g.kind);
  EXPECT_EQ(f.effect + f.port + f.text, g.effect + g.port + g.text);
  EXPECT_EQ(f.equivalent, g.equivalent);
  EXPECT_EQ(f.size_name + f.size_unit, g.size_name + g.size_unit);
  EXPECT_EQ(f.size, g.size);
  EXPECT_EQ(f.low, g.low);
  EXPECT_EQ(f.high, g.high);
  EXPECT_EQ(f.none, g.none);
  EXPECT_EQ(f.confidence, g.confidence);
}

TEST(AssessmentMessages, WordsThatThereAreNotAreRefused) {
  faultline_msgs::Detections wrong = detections_of(full(1), "rig");
  wrong.detections[0].reason = 7;
  EXPECT_THROW(to_assessment(wrong, *hypotheses(1)), InputError);
  faultline_msgs::Hypotheses odd = hypotheses_of(full(1), "rig");
  odd.hypotheses[0].kind = "gremlin";
  EXPECT_THROW(to_assessment(*detections(1), odd), InputError);
}

TEST(AssessmentJoin, PairsComeOutInOrderAndWhatLostItsPartnerIsCounted) {
  AssessmentJoin join;
  for (const std::uint64_t k : {0, 1, 2, 4}) join.add(detections(k));  // 3 was lost
  EXPECT_FALSE(join.next());
  for (const std::uint64_t k : {0, 2, 3, 4}) join.add(hypotheses(k));  // 1 was lost
  for (const std::uint64_t k : {0, 2, 4}) EXPECT_EQ(join.next().value().sequence, k);
  EXPECT_FALSE(join.next());
  EXPECT_EQ(join.dropped(), 2u);
}

// A word that comes before its partner has not lost it, whatever was lost before.
TEST(AssessmentJoin, ALossCostsNoOtherPair) {
  AssessmentJoin join;
  std::vector<std::uint64_t> joined;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const bool detection = k < 3 || k > 5, hypothesis = k < 5 || k > 7;  // 3 to 5 were lost, and 5 to 7
    if (detection) join.add(detections(k));
    while (const auto pair = join.next()) joined.push_back(pair->sequence);
    if (hypothesis) join.add(hypotheses(k));
    while (const auto pair = join.next()) joined.push_back(pair->sequence);
  }
  EXPECT_EQ(joined, (std::vector<std::uint64_t>{0, 1, 2, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19}));
  EXPECT_EQ(join.dropped(), 4u);  // 3, 4; 6, 7
}

}  // namespace
}  // namespace faultline
