#include "faultline/isolation/reason.h"

#include <array>

namespace faultline {
namespace {

struct Row {
  Reason reason;
  bool (*holds)(const Claim&);
  const char* text;
};

bool fault(const Claim& c) { return c.kind == AlarmKind::fault; }

constexpr std::array<Row, 7> kReasons = {{
    {Reason::absent, [](const Claim& c) { return !c.holds; }, "its condition does not hold"},
    {Reason::transducer_in_doubt, [](const Claim& c) { return c.on_bad_data || (fault(c) && !c.raised && c.in_doubt); },
     "a transducer that it rests on is itself off"},
    {Reason::explained, [](const Claim& c) { return c.explained; },
     "another cause explains it, or the rig without faults does"},
    {Reason::judgement_awaited, [](const Claim& c) { return !c.raised && c.judgement_awaited; },
     "the isolator has not judged that time yet"},
    {Reason::told_by_another, [](const Claim& c) { return !c.raised && c.told_by_another; },
     "it stands under another stage's alarm"},
    {Reason::model_does_not_fit, [](const Claim& c) { return fault(c) && !c.raised && !c.model_fits; },
     "the model does not explain the measurements"},
    {Reason::told, [](const Claim&) { return true; }, "told"},
}};

}  // namespace

Reason reason_of(const Claim& claim) {
  for (const Row& row : kReasons)
    if (row.holds(claim)) return row.reason;
  return Reason::told;
}

const char* text_of(Reason reason) {
  for (const Row& row : kReasons)
    if (row.reason == reason) return row.text;
  return "";
}

}  // namespace faultline
