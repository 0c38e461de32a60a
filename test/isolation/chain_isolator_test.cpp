// The isolator `chain` on shares made by hand: each kind of pattern, what it names, and when it says nothing.
#include <gtest/gtest.h>

#include <cmath>

#include "faultline/isolation/isolator.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// demand -> pilot -> spool -> pressure -> torque, with a place behind each but the first.
Datasheet rig() {
  Datasheet sheet;
  sheet.rig = "chained";
  for (const char* name : {"demand", "pilot", "spool", "pressure", "torque", "supply"}) {
    Channel c;
    c.name = name;
    sheet.channels.push_back(c);
  }
  const auto port = [&](const char* name, std::vector<FittingEffect> effects) {
    Port p;
    p.name = name;
    p.kind = port_kind(name);
    p.effects = std::move(effects);
    sheet.ports.push_back(p);
  };
  port("restriction.nozzle", {{"clogging", {}}});
  port("flow.pilot_ambient", {{"orifice_leakage", {}}});
  port("flow.cylinder_ambient", {{"orifice_leakage", {}}});
  port("force.valve", {{"coulomb_friction", {}}});
  port("force.actuator", {{"load_force", {}}});
  port("sensor.pressure", {{"offset", {}}});
  return sheet;
}

std::map<std::string, std::string> words() {
  return {{"chain", "demand, pilot, spool, pressure, torque"},
          {"common", "supply"},
          {"pilot_place", "pilot stage"},
          {"pilot_high", "clogging@restriction.nozzle"},
          {"pilot_low", "orifice_leakage@flow.pilot_ambient, clogging@restriction.nozzle"},
          {"spool_place", "actuator"},
          {"spool_high", "orifice_leakage@flow.cylinder_ambient"},
          {"pressure_place", "actuator"},
          {"torque_place", "valve"},
          {"torque_both", "coulomb_friction@force.valve"}};
}

class Chain : public ::testing::Test {
 protected:
  void make(std::map<std::string, double> numbers, std::map<std::string, std::string> with = words()) {
    numbers.insert({{"share", 0.4}, {"both", 0.2}, {"settle", 10}});
    isolator_ = make_isolator(rig(), {"place", "chain", Settings("test", std::move(numbers), {}, std::move(with))});
    estimate_ = Estimate();
    finding_ = Finding();
    estimate_.quantities.push_back({"judging", "1", 1, 0});
    for (const Channel& c : rig().channels)
      for (const char* what : {".average", ".above", ".below", ".level"})
        estimate_.quantities.push_back({c.name + what, "1", 0, 0});
    for (Quantity& q : estimate_.quantities)
      if (q.name.find("average") != std::string::npos || q.name.find("level") != std::string::npos) q.value = 0.5;
  }
  void set(const std::string& name, double value) {
    for (Quantity& q : estimate_.quantities)
      if (q.name == name) q.value = value;
  }
  // One letter a link of the chain: . h l b
  void pattern(const std::string& letters) {
    for (std::size_t i = 0; i < letters.size(); ++i) {
      const std::string name = rig().channels[i].name;
      set(name + ".above", letters[i] == 'h' ? 0.6 : letters[i] == 'b' ? 0.25 : 0.05);
      set(name + ".below", letters[i] == 'l' ? 0.6 : letters[i] == 'b' ? 0.25 : 0.05);
    }
  }
  const Finding& hear(double seconds = 30) {
    for (const double end = estimate_.time + seconds; estimate_.time < end; estimate_.time += 0.5)
      isolator_->process(estimate_, {}, finding_);
    return finding_;
  }
  const Finding& of(const std::string& letters) {
    pattern(".....");
    hear();
    EXPECT_FALSE(finding_.active);
    pattern(letters);
    return hear();
  }
  std::unique_ptr<Isolator> isolator_;
  Estimate estimate_;
  Finding finding_;
};

TEST_F(Chain, TheLastShiftedVariableNamesThePlace) {
  make({});
  const Finding& f = of("hl...");
  ASSERT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::fault);
  EXPECT_EQ(f.effect, "orifice_leakage");
  EXPECT_EQ(f.port, "flow.pilot_ambient");
  EXPECT_EQ(f.equivalent, std::vector<std::string>{"clogging@restriction.nozzle"});
  EXPECT_EQ(f.confidence, 0.5);
  EXPECT_EQ(f.text, "Pilot stage: shifted are demand high, pilot low");
  EXPECT_NEAR(f.since, 30, 0.51);
  EXPECT_EQ(of(".h...").effect, "clogging");  // by its sign
  EXPECT_EQ(of("hlh..").port, "flow.cylinder_ambient");
  EXPECT_EQ(of("h.h..").port, "flow.cylinder_ambient");  // one that does not show makes no difference
  EXPECT_EQ(of("....b").port, "force.valve");
  EXPECT_EQ(of("...lb").port, "force.valve");
  EXPECT_EQ(of("hlhhb").port, "force.valve");
  EXPECT_EQ(of("..llb").text, "Valve and actuator: shifted are spool low, pressure low, torque high and low in turn");
  EXPECT_EQ(of("...l.").text, "Actuator: shifted are pressure low");
  EXPECT_EQ(finding_.effect, "");  // no effect is listed for that
  EXPECT_EQ(finding_.kind, AlarmKind::unknown);
}

TEST_F(Chain, WhatNamesNoPlaceIsUnknown) {
  make({});
  const Finding& f = of("h....");
  ASSERT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::unknown);
  EXPECT_EQ(f.effect + f.port, "");
  EXPECT_NE(f.text.find("names no place: shifted are demand high"), std::string::npos);
}

TEST_F(Chain, ALevelWithoutAPlaceIsNotTold) {
  make({{"level", 0.1}});
  pattern(".....");
  hear();
  set("demand.level", 0.3);
  EXPECT_FALSE(hear().active);
  set("pilot.level", 0.3);
  EXPECT_EQ(hear().text, "Pilot stage: shifted are demand low, pilot low");
}

TEST_F(Chain, ACommonCauseHasLimitsOfItsOwn) {
  make({{"level", 0.1}, {"common_share", 0.8}, {"common_level", 0.3}});
  set("supply.below", 0.7);
  set("supply.above", 0.25);  // both ways in turn is no shift of a common cause
  set("supply.level", 0.3);
  pattern("h....");
  EXPECT_TRUE(hear().active);
  pattern(".....");
  hear();
  set("supply.below", 0.81);
  hear();
  pattern("h....");
  EXPECT_FALSE(hear().active);
  set("supply.below", 0.3);
  EXPECT_TRUE(hear().active);
  pattern(".....");
  hear();
  set("supply.level", 0.1);
  hear();
  pattern("h....");
  EXPECT_FALSE(hear().active);
}

TEST_F(Chain, SaysUntilWhenItHasJudged) {
  make({{"learn", 30}});
  hear(35);  // settles for 10 s, learns for 30
  EXPECT_FALSE(std::isfinite(isolator_->judged_until()));
  hear(30);
  EXPECT_EQ(isolator_->judged_until(), estimate_.time - 0.5);
  set("judging", 0);
  hear(5);
  EXPECT_LT(isolator_->judged_until(), estimate_.time - 4);
}

TEST_F(Chain, OneThatNothingDrivesIsItsTransducer) {
  auto with = words();
  with["pressure_alone"] = "offset@sensor.pressure, load_force@force.actuator";
  make({}, with);
  ASSERT_TRUE(of("...l.").active);
  EXPECT_EQ(finding_.kind, AlarmKind::sensor);
  EXPECT_EQ(finding_.effect + "@" + finding_.port, "offset@sensor.pressure");
  EXPECT_EQ(finding_.equivalent, std::vector<std::string>{"load_force@force.actuator"});
  EXPECT_EQ(finding_.text, "Transducer of pressure: shifted are pressure low");
  // The pressure is at 0.6 of 0.4; the spool has answered from 0.2 of 0.4 on.
  set("spool.above", 0.19);
  set("torque.above", 0.3);  // it lies behind
  hear(1);
  EXPECT_EQ(finding_.kind, AlarmKind::sensor);
  set("spool.above", 0.21);
  hear(1);
  EXPECT_EQ(finding_.kind, AlarmKind::unknown);
  EXPECT_EQ(finding_.text, "Actuator: shifted are pressure low");
  EXPECT_EQ(of("h..l.").kind, AlarmKind::sensor);  // a loop that uses it moves what lies before
  EXPECT_EQ(of("h.hl.").kind, AlarmKind::unknown);
  EXPECT_EQ(of("...lb").port, "force.valve");
  EXPECT_EQ(of("...b.").kind, AlarmKind::unknown);  // friction and play go both ways
  EXPECT_EQ(of(".h...").kind, AlarmKind::fault);    // nothing is listed
  make({{"place", 2}}, with);
  EXPECT_FALSE(of("...l.").active);
}

TEST_F(Chain, PairsAreTwoFindings) {
  make({});
  EXPECT_EQ(of(".h..b").port, "force.valve");
  EXPECT_EQ(of("h.h.b").port, "force.valve");
  make({{"place", 2}});
  EXPECT_EQ(of(".h..b").port, "restriction.nozzle");
  EXPECT_EQ(of(".l.lb").port, "flow.pilot_ambient");
  EXPECT_EQ(of("h.h.b").port, "flow.cylinder_ambient");
  EXPECT_EQ(of("hlhbb").port, "flow.cylinder_ambient");
  EXPECT_EQ(
      of("hlhhb").text,
      "Actuator and valve: shifted are demand high, pilot low, spool high, pressure high, torque high and low in turn");
  EXPECT_FALSE(of("h..lb").active);  // the first has no place of its own, the fourth drives the fifth
  EXPECT_FALSE(of("hllb.").active);  // the same place
  EXPECT_FALSE(of("hl...").active);
}

TEST_F(Chain, ACommonCauseExplainsShifts) {
  make({});
  pattern(".....");
  hear();
  pattern("hl...");
  set("supply.below", 0.5);
  EXPECT_FALSE(hear().active);
  set("supply.below", 0.21);  // until it is below half of the limit
  EXPECT_FALSE(hear().active);
  set("supply.below", 0.19);
  EXPECT_FALSE(hear(9).active);  // from then on a shift must last
  EXPECT_TRUE(hear(2).active);
  // What was named stays, and becomes nothing else.
  set("supply.above", 0.5);
  pattern("hlh..");
  EXPECT_TRUE(hear().active);
  EXPECT_EQ(finding_.port, "flow.pilot_ambient");
}

TEST_F(Chain, ACommonCauseThatWandersByItselfExplainsNothing) {
  make({{"learn", 1000}, {"sigmas", 3}});
  hear(20);
  for (int k = 0; k < 100; ++k) {
    set("supply.below", k % 2 ? 0.6 : 0.4);
    hear(10);
  }
  const Reference learnt = *isolator_->reference();
  const auto told = [&](double below) {
    make({{"learn", 1000}, {"sigmas", 3}});
    isolator_->restore(learnt);
    pattern("hl...");
    set("supply.below", below);
    return hear().active;
  };
  EXPECT_TRUE(told(0.78));
  EXPECT_FALSE(told(0.83));
}

TEST_F(Chain, WhatLiesBehindAVariableThatIsHeldNoMoreNamesNothing) {
  auto with = words();
  with["held"] = "pressure";
  make({}, with);
  EXPECT_EQ(of("h.hl.").port, "");  // the pressure itself: a place without an effect
  EXPECT_EQ(finding_.text, "Actuator: shifted are demand high, spool high, pressure low");
  EXPECT_EQ(of("h.hlb").text,
            "Actuator: shifted are demand high, spool high, pressure low, torque high and low in turn");
  EXPECT_EQ(of("h.h.b").port, "force.valve");
}

TEST_F(Chain, AShiftMustLastAndEndsBelowHalf) {
  make({});
  pattern(".....");
  hear();
  pattern(".h...");
  EXPECT_FALSE(hear(9).active);
  EXPECT_TRUE(hear(2).active);
  set("pilot.above", 0.25);
  EXPECT_TRUE(hear().active);
  set("pilot.above", 0.19);
  EXPECT_FALSE(hear().active);
  set("judging", 0);
  pattern(".h...");
  EXPECT_FALSE(hear().active);
}

TEST_F(Chain, WhatTheHealthyRigDoesIsNoShift) {
  make({{"learn", 1000}, {"sigmas", 3}});
  pattern(".....");
  hear(20);
  for (int k = 0; k < 100; ++k) {  // the torque is above its limits for 0.5 +- 0.1 of the time
    set("torque.above", k % 2 ? 0.6 : 0.4);
    hear(10);
  }
  EXPECT_FALSE(finding_.active);
  const std::optional<Reference> learnt = isolator_->reference();
  ASSERT_TRUE(learnt);
  set("torque.above", 0.78);
  EXPECT_FALSE(hear().active);
  set("torque.above", 0.83);
  EXPECT_TRUE(hear().active);
  make({{"learn", 1000}, {"sigmas", 3}});
  EXPECT_FALSE(isolator_->reference());
  isolator_->restore(*learnt);
  set("torque.above", 0.78);
  EXPECT_FALSE(hear().active);
  set("torque.above", 0.83);
  EXPECT_TRUE(hear().active);
}

TEST_F(Chain, ALevelOffItsHealthyMeanIsAShift) {
  make({{"level", 0.1}, {"sigmas", 3}, {"learn", 1000}});
  pattern(".....");
  hear(20);
  for (int k = 0; k < 100; ++k) {  // the torque's level is 0.6 +- 0.05
    set("torque.level", k % 2 ? 0.65 : 0.55);
    hear(10);
  }
  set("torque.level", 0.74);
  EXPECT_FALSE(hear().active);
  set("torque.level", 0.76);
  EXPECT_TRUE(hear().active);
  set("torque.level", 0.68);
  EXPECT_TRUE(hear().active);
  set("torque.level", 0.67);
  EXPECT_FALSE(hear().active);
  set("pilot.level", 0.39);
  EXPECT_EQ(hear().text, "Pilot stage: shifted are pilot low");
  pattern(".b...");  // shares say more
  EXPECT_EQ(hear().text, "Pilot stage: shifted are pilot high and low in turn");
  make({});
  pattern(".....");
  hear();
  set("pilot.level", 0.01);  // not looked at where no limit is given
  EXPECT_FALSE(hear().active);
}

TEST_F(Chain, BadSettingsAreNamed) {
  const auto said = [&](const char* key, const char* value) {
    auto with = words();
    with[key] = value;
    try {
      make({}, with);
      hear();
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(said("chain", "demand, wind").find("wind"), std::string::npos);
  EXPECT_NE(said("chain", "").find("'chain' is missing"), std::string::npos);
  EXPECT_NE(said("held", "supply").find("'held' is 'supply'"), std::string::npos);
  EXPECT_NE(said("pilot_high", "clogging@force.valve").find("clogging@force.valve"), std::string::npos);
  EXPECT_NE(said("pilot_high", "clogging").find("'clogging' is no effect@port"), std::string::npos);
  EXPECT_NE(said("pressure_alone", "load_force@force.actuator").find("an effect of a transducer"), std::string::npos);
  EXPECT_EQ(said("pilot_high", "clogging@restriction.nozzle"), "");
}

}  // namespace
}  // namespace faultline
