// Which of two isolators has the say: one that knows the faults of a table, and one that weighed every effect.
#include <gtest/gtest.h>

#include <limits>

#include "faultline/detectors/detector.h"
#include "faultline/isolation/isolation_stage.h"
#include "faultline/isolation/isolator.h"

namespace faultline {
namespace {

// Says what the test put here, for the isolator of its stage's name.
struct Said {
  Finding table, all;
  bool watch = false;
  double judged_until = 0;  // long ago: what it found then stands until it says otherwise
  double undecided_since = std::numeric_limits<double>::quiet_NaN();
  bool suspects = true;
};
Said said;

class Watch : public Detector {
 public:
  Watch(const Datasheet&, const StageSpec&) {}
  void reset() override {}
  void process(const Estimate&, Detection& detection) override { detection.active = said.watch; }
};

class Table : public Isolator {
 public:
  Table(const Datasheet&, const StageSpec&) {}
  void reset() override {}
  void process(const Estimate&, const std::vector<bool>&, Finding& finding) override { finding = said.table; }
  bool overrules() const override { return true; }
};

class All : public Table {
 public:
  using Table::Table;
  void process(const Estimate&, const std::vector<bool>&, Finding& finding) override { finding = said.all; }
  bool weighs_every_effect() const override { return true; }
  double judged_until() const override { return said.judged_until; }
  double undecided_since() const override { return said.undecided_since; }
  bool suspects(const Finding&) const override { return said.suspects; }
};

FAULTLINE_DETECTOR(says_watch, {"says_watch", make_detector_of<Watch>});
FAULTLINE_ISOLATOR(says_table, {"says_table", make_isolator_of<Table>});
FAULTLINE_ISOLATOR(says_all, {"says_all", make_isolator_of<All>});

Finding found(const char* effect, const char* port, std::vector<std::string> equivalent = {}) {
  Finding f;
  f.active = true;
  f.kind = *effect ? AlarmKind::fault : AlarmKind::unknown;
  f.effect = effect;
  f.port = port;
  f.equivalent = std::move(equivalent);
  return f;
}

class WhoHasTheSay : public ::testing::Test {
 protected:
  WhoHasTheSay() : stage_(sheet()) {
    said = Said();
    hear();
  }
  static Datasheet sheet() {
    Datasheet sheet;
    sheet.rig = "one";
    sheet.detectors = {
        {"watch", "says_watch",
         Settings("test", {}, {}, {{"kind", "sensor"}, {"effect", "stuck"}, {"port", "sensor.a"}, {"text", "stuck"}})}};
    sheet.isolators = {{"table", "says_table", Settings("test", {}, {}, {})},
                       {"all", "says_all", Settings("test", {}, {}, {})}};
    return sheet;
  }
  void hear() {
    estimate_.time += 1;
    const Assessment& heard = stage_.process(estimate_);
    table_ = heard.isolators[0].reason;
    all_ = heard.isolators[1].reason;
    watch_ = heard.detectors[0].reason;
  }

  // Of something that began at 5 s, where the other judges every 2 s, and has judged until 4.
  void the_table_speaks_between_judgements() {
    for (const double judged : {2, 4}) {
      said.judged_until = judged;
      hear();
    }
    estimate_.time = 5;
    said.table = found("scale", "transmission.pump");
    said.table.since = 5;
  }

  Estimate estimate_;
  IsolationStage stage_;
  Reason table_{}, all_{}, watch_{};
};

TEST_F(WhoHasTheSay, ATableAloneIsTold) {
  said.table = found("scale", "transmission.pump");
  hear();
  EXPECT_EQ(table_, Reason::told);
  EXPECT_EQ(all_, Reason::absent);
}

TEST_F(WhoHasTheSay, AnotherCauseEndsWhatTheTableTook) {
  said.table = found("scale", "transmission.pump");
  hear();
  said.all = found("coulomb_friction", "force.shaft", {"load_force@force.shaft"});
  hear();
  EXPECT_EQ(table_, Reason::explained);
  EXPECT_EQ(all_, Reason::told);
  hear();
  EXPECT_EQ(table_, Reason::explained);
}

TEST_F(WhoHasTheSay, AListWithoutTheTablesCauseFirstEndsIt) {
  said.table = found("scale", "transmission.pump");
  said.all = found("", "", {"coulomb_friction@force.shaft", "scale@transmission.pump"});
  hear();
  EXPECT_EQ(table_, Reason::explained);
  said.all.equivalent = {"scale@transmission.pump", "coulomb_friction@force.shaft"};
  hear();
  EXPECT_EQ(table_, Reason::told);
}

TEST_F(WhoHasTheSay, ATableWaitsForTheOneThatWeighsAll) {
  the_table_speaks_between_judgements();
  hear();
  EXPECT_EQ(table_, Reason::judgement_awaited);
  said.undecided_since = 4;  // it judged that time, and suspects something else
  said.suspects = false;
  hear();
  EXPECT_EQ(table_, Reason::judgement_awaited);
  said.suspects = true;
  hear();
  EXPECT_EQ(table_, Reason::told);
}

TEST_F(WhoHasTheSay, ATableDoesNotWaitForEver) {
  the_table_speaks_between_judgements();
  for (int k = 0; k < 5; ++k) hear();
  EXPECT_EQ(table_, Reason::judgement_awaited);
  hear();  // three intervals of 2 s
  EXPECT_EQ(table_, Reason::told);
}

TEST_F(WhoHasTheSay, OneCauseIsOneAlarm) {
  said.table = found("scale", "transmission.pump");
  hear();
  said.all = found("scale", "transmission.motor", {"scale@transmission.pump"});
  hear();
  EXPECT_EQ(table_, Reason::told);
  EXPECT_EQ(all_, Reason::told_by_another);
}

// The isolator had another cause until it saw what the detector had told already, or saw it first.
TEST_F(WhoHasTheSay, OneStuckTransducerIsOneAlarm) {
  said.all = found("scale", "command.valve");
  hear();
  said.watch = true;
  hear();
  EXPECT_EQ(watch_, Reason::told);
  EXPECT_EQ(all_, Reason::told);
  said.all = found("stuck", "sensor.a");
  hear();
  EXPECT_EQ(watch_, Reason::told);
  EXPECT_EQ(all_, Reason::told_by_another);
  said.watch = false;
  hear();
  EXPECT_EQ(watch_, Reason::absent);
  EXPECT_EQ(all_, Reason::told);
  said.watch = true;
  hear();
  EXPECT_EQ(watch_, Reason::told_by_another);
  EXPECT_EQ(all_, Reason::told);
}

}  // namespace
}  // namespace faultline
