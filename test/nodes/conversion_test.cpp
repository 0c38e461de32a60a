#include "nodes/conversion.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "faultline/signal/error.h"
#include "nodes/conversion_lcm.h"

namespace faultline {
namespace {

Datasheet small_sheet() {
  Datasheet sheet;
  sheet.file = "small.yaml";
  sheet.rig = "small";
  sheet.sample_period = 0.01;
  Channel a, b;
  a.name = "command";
  a.unit = "V";
  a.role = Role::command;
  b.name = "pressure";
  b.unit = "Pa";
  b.role = Role::output;
  sheet.channels = {a, b};
  return sheet;
}

std::string message_of(const Datasheet& sheet, const faultline_msgs::RigDescription& description) {
  try {
    check_description(sheet, description);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Conversion, StampsRoundOnceAndThenStay) {
  for (const double time :
       {0.0, 0.001, 0.3, 59.999, 1.0 / 3, 4.0e6 + 0.1234567891, 1.7e9 + 0.001, 1.7e9 + 123.456789}) {
    const double once = to_seconds(to_stamp(time));
    EXPECT_NEAR(once, time, 0.51e-9 + std::abs(time) * 2.3e-16);
    EXPECT_EQ(to_seconds(to_stamp(once)), once);
    EXPECT_EQ(to_stamp(once), to_stamp(time));
  }
  EXPECT_EQ(to_stamp(2.9999999999), ros::Time(3, 0));
}

TEST(Conversion, EpochStampsKeepTheirDouble) {
  for (int k = 0; k < 5000; ++k) {
    const double time = 1.7e9 + k * 0.001;
    EXPECT_EQ(to_seconds(to_stamp(time)), time);
  }
}

TEST(Conversion, RefusesTimesThatAStampCannotHold) {
  EXPECT_THROW(to_stamp(-0.001), InputError);
  EXPECT_THROW(to_stamp(5e9), InputError);
  EXPECT_THROW(to_stamp(std::numeric_limits<double>::quiet_NaN()), InputError);
}

TEST(Conversion, SampleGoesAroundUnchanged) {
  Sample sample;
  sample.time = 1.7e9 + 0.123;
  sample.sequence = (1ULL << 60) + 3;
  sample.values = {1.5, std::numeric_limits<double>::quiet_NaN(), -7e6};
  const faultline_msgs::Sample message = to_message(sample, "small");
  EXPECT_EQ(message.header.frame_id, "small");
  const Sample back = from_message(message);
  EXPECT_EQ(back.time, sample.time);
  EXPECT_EQ(back.sequence, sample.sequence);
  ASSERT_EQ(back.values.size(), 3u);
  EXPECT_EQ(back.values[0], 1.5);
  EXPECT_TRUE(std::isnan(back.values[1]));
  EXPECT_EQ(back.values[2], -7e6);
}

TEST(Conversion, MessagesKeepTheirNameOnTheWire) {
  EXPECT_STREQ(ros::message_traits::DataType<faultline_msgs::Sample>::value(), "faultline/Sample");
  EXPECT_STREQ(ros::message_traits::DataType<faultline_msgs::AlarmArray>::value(), "faultline/AlarmArray");
}

TEST(Conversion, DescriptionGoesAroundAndFits) {
  const Datasheet sheet = small_sheet();
  const faultline_msgs::RigDescription message = to_message(sheet, "a test");
  EXPECT_EQ(message.channels[0].role, "command");
  EXPECT_EQ(message.channels[1].role, "output");
  EXPECT_EQ(message.sample_period, 0.01);
  const Description back = from_message(message);
  EXPECT_EQ(back.rig, "small");
  EXPECT_EQ(back.made_by, "a test");
  EXPECT_EQ(check_description(sheet, message), (std::vector<std::size_t>{0, 1}));
}

TEST(Conversion, DescriptionsInAnotherOrderAreArranged) {
  const Datasheet sheet = small_sheet();
  faultline_msgs::RigDescription message = to_message(sheet, "");
  faultline_msgs::ChannelDescription extra;
  extra.name = "room_temperature";
  extra.unit = "K";
  message.channels.insert(message.channels.begin(), extra);
  std::swap(message.channels[1], message.channels[2]);
  const std::vector<std::size_t> places = check_description(sheet, message);
  EXPECT_EQ(places, (std::vector<std::size_t>{2, 1}));
  Sample sample;
  sample.values = {293, 5e6, 1};
  EXPECT_TRUE(arrange(places, 3, sample));
  EXPECT_EQ(sample.values, (std::vector<double>{1, 5e6}));
  EXPECT_FALSE(arrange(places, 3, sample));
}

TEST(Conversion, BadDescriptionsAreNamed) {
  const Datasheet sheet = small_sheet();
  const faultline_msgs::RigDescription good = to_message(sheet, "");
  faultline_msgs::RigDescription bad = good;
  bad.rig = "other";
  EXPECT_NE(message_of(sheet, bad).find("'other', not of 'small'"), std::string::npos);
  bad = good;
  bad.channels.pop_back();
  EXPECT_NE(message_of(sheet, bad).find("'pressure' [Pa] is missing"), std::string::npos);
  bad = good;
  bad.channels[1].unit = "bar";
  EXPECT_NE(message_of(sheet, bad).find("'pressure' comes in 'bar', small.yaml says 'Pa'"), std::string::npos);
  bad = good;
  bad.channels.push_back(bad.channels[0]);
  EXPECT_NE(message_of(sheet, bad).find("'command' comes twice"), std::string::npos);
}

TEST(Conversion, EstimateGoesAroundUnchanged) {
  Estimate estimate;
  estimate.time = 1.7e9 + 0.5;
  estimate.sequence = 42;
  estimate.restarted = true;
  estimate.state = {1, 2};
  estimate.covariance = {4, 0.5, 0.5, 9};
  estimate.innovation = {0.1};
  estimate.innovation_std = {0.2};
  estimate.normalised_innovation = 0.25;
  estimate.observed = 1;
  estimate.channel_status = {ChannelStatus::good, ChannelStatus::out_of_range};
  estimate.quantities = {{"leak_flow", "m^3/s", 1e-5, 1e-7}};
  EstimateNames names;
  names.rig = "small";
  names.stage = "leak_and_friction";
  names.states = {"a", "b"};
  names.channels = {"pressure"};
  const faultline_msgs::Estimate message = to_message(estimate, names);
  EXPECT_EQ(message.stage, "leak_and_friction");
  EXPECT_EQ(message.state_names, names.states);
  EXPECT_EQ(message.channel_names, names.channels);
  const Estimate back = from_message(message);
  EXPECT_EQ(back.time, estimate.time);
  EXPECT_EQ(back.sequence, estimate.sequence);
  EXPECT_EQ(back.restarted, estimate.restarted);
  EXPECT_EQ(back.state, estimate.state);
  EXPECT_EQ(back.covariance, estimate.covariance);
  EXPECT_EQ(back.innovation, estimate.innovation);
  EXPECT_EQ(back.innovation_std, estimate.innovation_std);
  EXPECT_EQ(back.normalised_innovation, estimate.normalised_innovation);
  EXPECT_EQ(back.observed, estimate.observed);
  EXPECT_EQ(back.channel_status, estimate.channel_status);
  ASSERT_EQ(back.quantities.size(), 1u);
  EXPECT_EQ(back.quantities[0].name, "leak_flow");
  EXPECT_EQ(back.quantities[0].unit, "m^3/s");
  EXPECT_EQ(back.quantities[0].value, 1e-5);
  EXPECT_EQ(back.quantities[0].std, 1e-7);

  EXPECT_FALSE(back.ranking);

  faultline_msgs::Estimate unknown = message;
  unknown.channel_status[0] = 9;
  EXPECT_THROW(from_message(unknown), InputError);
}

TEST(Conversion, RankingsGoAroundUnchanged) {
  RankedHypothesis leak;
  leak.effect = "orifice_leakage";
  leak.port = "flow.chamber_a_chamber_b";
  leak.kind = AlarmKind::fault;
  leak.size_name = "coefficient";
  leak.size_unit = "m^3/(s sqrt(Pa))";
  leak.order = 17;
  leak.none = std::numeric_limits<double>::infinity();
  leak.full = 2e-8;
  leak.lowest = -0.25;
  leak.amplitude = 0.7;
  leak.std = 0.03;
  leak.evidence = 123.4;
  RankedHypothesis offset = leak;
  offset.effect = "offset";
  offset.port = "sensor.pressure";
  offset.kind = AlarmKind::sensor;
  offset.order = 18;
  Ranking ranking;
  ranking.since = 1.7e9 + 1.0 / 3;  // no stamp holds these
  ranking.judged_until = 1.0 / 7;
  ranking.shows = false;
  ranking.threshold = 15;
  ranking.evidence = 130.5;
  ranking.doubt = "position: its sign is turned";
  ranking.stuck = "sensor.position";
  ranking.first = {leak, offset};
  ranking.suspected = {offset, leak, offset};
  ranking.second = {offset};
  Estimate estimate;
  estimate.ranking = std::make_shared<Ranking>(ranking);
  const faultline_msgs::Estimate message = to_message(estimate, EstimateNames());
  const Estimate back = from_message(message);
  ASSERT_TRUE(back.ranking);
  EXPECT_EQ(back.ranking->since, ranking.since);
  EXPECT_EQ(back.ranking->judged_until, ranking.judged_until);
  EXPECT_FALSE(back.ranking->shows);
  EXPECT_EQ(back.ranking->threshold, 15);
  EXPECT_EQ(back.ranking->evidence, 130.5);
  EXPECT_EQ(back.ranking->doubt, ranking.doubt);
  EXPECT_EQ(back.ranking->stuck, ranking.stuck);
  ASSERT_EQ(back.ranking->first.size(), 2u);
  ASSERT_EQ(back.ranking->suspected.size(), 3u);
  EXPECT_EQ(back.ranking->suspected[1].name(), leak.name());
  ASSERT_EQ(back.ranking->second.size(), 1u);
  const RankedHypothesis& b = back.ranking->first[0];
  EXPECT_EQ(b.effect, leak.effect);
  EXPECT_EQ(b.port, leak.port);
  EXPECT_EQ(b.kind, AlarmKind::fault);
  EXPECT_EQ(b.size_name, leak.size_name);
  EXPECT_EQ(b.size_unit, leak.size_unit);
  EXPECT_EQ(b.order, 17u);
  EXPECT_EQ(b.none, leak.none);
  EXPECT_EQ(b.full, leak.full);
  EXPECT_EQ(b.lowest, leak.lowest);
  EXPECT_EQ(b.amplitude, leak.amplitude);
  EXPECT_EQ(b.std, leak.std);
  EXPECT_EQ(b.evidence, leak.evidence);
  EXPECT_EQ(back.ranking->first[1].name(), "offset@sensor.pressure");
  EXPECT_EQ(back.ranking->second[0].name(), "offset@sensor.pressure");

  faultline_msgs::Estimate twice = message;
  twice.ranking.push_back(twice.ranking.front());
  EXPECT_THROW(from_message(twice), InputError);
}

TEST(Conversion, HistogramsTakeTheirShiftFromTheEstimateOfTheSameSample) {
  HistogramView view;
  view.variable = "pressure";
  view.above = 0.25;
  view.below = 0.125;
  Estimate estimate;
  estimate.time = 12.5;
  estimate.quantities = {{"judging", "1", 1, 0}, {"flow.level", "1", 0.5, 0}, {"pressure.level", "1", 0.75, 0}};
  const EstimateNames names{"small", "points", {}, {}};
  const faultline_msgs::Histogram message = to_message(view, names, estimate);
  EXPECT_EQ(message.header.stamp, ros::Time(12, 500000000));
  EXPECT_EQ(message.above, 0.25);
  EXPECT_EQ(message.below, 0.125);
  EXPECT_EQ(message.level, 0.75);
  EXPECT_TRUE(message.judging);
  estimate.quantities[0].value = 0;
  EXPECT_FALSE(to_message(view, names, estimate).judging);
  estimate.quantities.pop_back();
  EXPECT_THROW(to_message(view, names, estimate), InputError);
}

TEST(Conversion, AlarmsGoAroundUnchanged) {
  Alarm alarm;
  alarm.kind = AlarmKind::fault;
  alarm.effect = "orifice_leakage";
  alarm.port = "flow.chamber_a_chamber_b";
  alarm.level = AlarmLevel::error;
  alarm.since = 1.7e9 + 20;
  alarm.raised = 1.7e9 + 22.5;
  alarm.until = 1.7e9 + 30;
  alarm.active = true;
  alarm.has_size = true;
  alarm.equivalent = {"laminar_leakage@flow.chamber_a_chamber_b"};
  alarm.size_name = "flow";
  alarm.size_unit = "m^3/s";
  alarm.size = 1.1e-5;
  alarm.low = 1.0e-5;
  alarm.high = 1.2e-5;
  alarm.confidence = 0.98;
  alarm.text = "leak";
  AlarmReport report;
  report.rig = "small";
  report.time = 1.7e9 + 30;
  report.verdict = "leak.";
  report.judged = true;
  report.alarms = {alarm};
  const AlarmReport back = from_message(to_message(report));
  EXPECT_EQ(back.rig, report.rig);
  EXPECT_EQ(back.time, report.time);
  EXPECT_EQ(back.verdict, report.verdict);
  EXPECT_TRUE(back.judged);
  ASSERT_EQ(back.alarms.size(), 1u);
  const Alarm& b = back.alarms[0];
  EXPECT_EQ(b.kind, alarm.kind);
  EXPECT_EQ(b.effect, alarm.effect);
  EXPECT_EQ(b.port, alarm.port);
  EXPECT_EQ(b.level, alarm.level);
  EXPECT_EQ(b.since, alarm.since);
  EXPECT_EQ(b.raised, alarm.raised);
  EXPECT_EQ(b.until, alarm.until);
  EXPECT_EQ(b.active, alarm.active);
  EXPECT_EQ(b.has_size, alarm.has_size);
  EXPECT_EQ(b.size_name, alarm.size_name);
  EXPECT_EQ(b.size_unit, alarm.size_unit);
  EXPECT_EQ(b.size, alarm.size);
  EXPECT_EQ(b.low, alarm.low);
  EXPECT_EQ(b.high, alarm.high);
  EXPECT_EQ(b.confidence, alarm.confidence);
  EXPECT_EQ(b.text, alarm.text);
  EXPECT_EQ(b.equivalent, alarm.equivalent);

  faultline_msgs::AlarmArray foreign = to_message(report);
  foreign.alarms[0].kind = "falt";
  EXPECT_THROW(from_message(foreign), InputError);
}

TEST(ConversionLcm, SampleGoesThroughBytesUnchangedToTheMicrosecond) {
  Sample sample;
  sample.time = 1.7e9 + 0.123456;
  sample.sequence = 77;
  sample.values = {1, -2.5};
  const faultline_lcm::sample_t sent = to_lcm(sample);
  std::vector<unsigned char> bytes(static_cast<std::size_t>(sent.getEncodedSize()));
  ASSERT_GT(sent.encode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
  faultline_lcm::sample_t received;
  ASSERT_GT(received.decode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
  const Sample back = from_lcm(received);
  EXPECT_EQ(back.time, to_seconds(ros::Time(1700000000, 123456000)));
  EXPECT_EQ(back.time, to_seconds(to_stamp(back.time)));
  EXPECT_EQ(back.sequence, 77u);
  EXPECT_EQ(back.values, sample.values);
}

TEST(ConversionLcm, RefusesWhatCannotBeASample) {
  Sample sample;
  sample.time = 1;
  faultline_lcm::sample_t message = to_lcm(sample);
  message.timestamp_us = -1;
  EXPECT_THROW(from_lcm(message), InputError);
  message = to_lcm(sample);
  message.sequence = -5;
  EXPECT_THROW(from_lcm(message), InputError);
  message = to_lcm(sample);
  message.count = 3;
  EXPECT_THROW(from_lcm(message), InputError);
}

// A packet of 40 bytes must not make room for 2^31 values, and a negative length must not end the program.
TEST(ConversionLcm, LengthsAreCheckedBeforeTheyAreBelieved) {
  Sample sample;
  sample.time = 1;
  sample.values = {1};
  const faultline_lcm::sample_t sent = to_lcm(sample);
  std::vector<unsigned char> bytes(static_cast<std::size_t>(sent.getEncodedSize()));
  const int size = static_cast<int>(bytes.size());
  ASSERT_EQ(sent.encode(bytes.data(), 0, size), size);
  faultline_lcm::sample_t received;
  EXPECT_TRUE(decode(bytes.data(), size, received));
  for (int cut = 0; cut < size; ++cut) EXPECT_FALSE(decode(bytes.data(), cut, received)) << cut;
  for (const int high : {0x7f, 0x80, 0xff}) {
    std::vector<unsigned char> lying = bytes;
    lying[24] = static_cast<unsigned char>(high);  // of the count
    EXPECT_FALSE(decode(lying.data(), size, received)) << high;
  }
  EXPECT_LT(received.values.capacity(), 100u);

  const faultline_lcm::rig_description_t described = to_lcm(small_sheet());
  std::vector<unsigned char> text(static_cast<std::size_t>(described.getEncodedSize()));
  const int length = static_cast<int>(text.size());
  ASSERT_EQ(described.encode(text.data(), 0, length), length);
  faultline_lcm::rig_description_t read;
  EXPECT_TRUE(decode(text.data(), length, read));
  for (int cut = 0; cut < length; ++cut) EXPECT_FALSE(decode(text.data(), cut, read)) << cut;
  for (int at = 8; at < length; ++at)
    for (const int value : {0x7f, 0x80, 0xff}) {
      std::vector<unsigned char> lying = text;
      lying[static_cast<std::size_t>(at)] = static_cast<unsigned char>(value);
      decode(lying.data(), length, read);  // whatever it says, it comes back
      EXPECT_LT(read.names.capacity(), 100u);
    }
}

TEST(ConversionLcm, DescriptionFits) {
  const Datasheet sheet = small_sheet();
  const Description description = from_lcm(to_lcm(sheet));
  EXPECT_EQ(description.sample_period, 0.01);
  EXPECT_EQ(match_channels(sheet, description), (std::vector<std::size_t>{0, 1}));
}

}  // namespace
}  // namespace faultline
