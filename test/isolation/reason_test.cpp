// The table of reasons against the rules it stands for, over everything that can be known about a claim.
#include "faultline/isolation/reason.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace faultline {
namespace {

constexpr AlarmKind kKinds[] = {AlarmKind::fault, AlarmKind::sensor, AlarmKind::model, AlarmKind::unknown,
                                AlarmKind::data};

template <class Check>
void for_every_claim(const Check& check) {
  for (const AlarmKind kind : kKinds)
    for (int bits = 0; bits < 256; ++bits)
      check(Claim{kind, (bits & 1) > 0, (bits & 2) > 0, (bits & 4) > 0, (bits & 8) > 0, (bits & 16) > 0,
                  (bits & 32) > 0, (bits & 64) > 0, (bits & 128) > 0});
}

TEST(Reason, ToldIsWhatNothingSpeaksAgainst) {
  int told = 0;
  for_every_claim([&told](const Claim& c) {
    const bool fault = c.kind == AlarmKind::fault;
    const bool wanted = c.holds && !c.on_bad_data && !c.explained &&
                        (c.raised || (!c.judgement_awaited && !c.told_by_another)) &&
                        (!fault || c.raised || (c.model_fits && !c.in_doubt));
    ASSERT_EQ(reason_of(c) == Reason::told, wanted);
    told += wanted;
  });
  EXPECT_EQ(told, 4 * 20 + 17);
}

TEST(Reason, EachIsGivenForWhatItSays) {
  std::set<Reason> seen;
  for_every_claim([&seen](const Claim& c) {
    const Reason reason = reason_of(c);
    seen.insert(reason);
    switch (reason) {
      case Reason::told:
        break;
      case Reason::absent:
        ASSERT_FALSE(c.holds);
        break;
      case Reason::transducer_in_doubt:
        ASSERT_TRUE(c.on_bad_data || (c.in_doubt && c.kind == AlarmKind::fault && !c.raised));
        break;
      case Reason::explained:
        ASSERT_TRUE(c.explained);
        break;
      case Reason::judgement_awaited:
        ASSERT_TRUE(c.judgement_awaited && !c.raised && !c.explained);
        break;
      case Reason::told_by_another:
        ASSERT_TRUE(c.told_by_another && !c.raised && !c.judgement_awaited);
        break;
      case Reason::model_does_not_fit:
        ASSERT_TRUE(!c.model_fits && c.kind == AlarmKind::fault && !c.raised && !c.told_by_another);
        break;
    }
  });
  EXPECT_EQ(seen.size(), 7u);
}

TEST(Reason, EachHasALineOfItsOwn) {
  std::set<std::string> lines;
  for (int k = 0; k <= static_cast<int>(Reason::model_does_not_fit); ++k) {
    const std::string line = text_of(static_cast<Reason>(k));
    EXPECT_FALSE(line.empty()) << k;
    EXPECT_TRUE(lines.insert(line).second) << line;
  }
}

TEST(Reason, AnAlarmThatWasRaisedEndsWithItsConditionByAnotherCauseOrWithItsData) {
  for_every_claim([](Claim c) {
    c.raised = true;
    ASSERT_EQ(reason_of(c) == Reason::told, c.holds && !c.explained && !c.on_bad_data);
  });
}

}  // namespace
}  // namespace faultline
