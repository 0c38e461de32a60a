// Why a claim is told or withheld. Every detection and every finding is a claim; the table in reason.cpp holds the
// reasons in the order of their precedence, and the first whose predicate holds is the claim's.
//
// Principles: what rests on a bad transducer or on a model that does not fit is not told; a stage that weighed every
// fault of the datasheet overrules one that looked for a single one; one cause is one alarm; an alarm that was raised
// ends when its condition ends or when it is explained by another cause, not because the circumstances under which it
// was raised have changed.
#pragma once

#include "faultline/rig/alarm_kind.h"

namespace faultline {

enum class Reason {
  told,
  absent,               // its condition does not hold
  transducer_in_doubt,  // a fault that shows in a transducer which is itself off
  explained,            // by another cause, which an isolator named that weighed them all, or by the rig without faults
  judgement_awaited,    // such an isolator has not yet judged the time at which this began
  told_by_another,      // it is the same thing as another stage's alarm and stands under that
  model_does_not_fit    // a fault claimed with a model that does not explain the measurements
};

// What is known about a claim at one instant.
struct Claim {
  AlarmKind kind = AlarmKind::fault;
  bool holds = false;              // its condition, its own minimum and release times included
  bool raised = false;             // it has an alarm already
  bool in_doubt = false;           // one of the transducers that it rests on is known to be off
  bool explained = false;          // by another cause
  bool judgement_awaited = false;  // of when it began
  bool told_by_another = false;
  bool model_fits = true;
  bool on_bad_data = false;  // it weighed all channels, and one of them was off before it was raised
};

Reason reason_of(const Claim& claim);
// One line for people: "withheld: ..." without its first word.
const char* text_of(Reason reason);

}  // namespace faultline
