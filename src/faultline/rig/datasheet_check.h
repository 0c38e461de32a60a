// Holds a datasheet against what it describes: the equations of its rig and its controllers, where this build has them.
// What they look up is taken down while they are made once, and compared with what the datasheet lists, both ways:
//
// - every port, channel and parameter that they ask for is listed;
// - every port that passes no signal is asked for by the equations; an effect at another would silently do nothing;
// - so is every output and command channel, and every parameter that has a tolerance or is to be identified; an exact
// parameter may
//   serve people only, an input may be measured only to be watched;
// - every input that drives the equations has a value for simulated runs;
// - the states are as many as the equations integrate, and a channel that is said to measure one shows it and nothing
// else;
// - every controller exists, and each profile's can be made from its settings;
// - a port or an effect that a stage names exists.
//
// A datasheet without equations (a rig that is only described) passes. read_datasheet() ends with this check.
#pragma once

#include "faultline/rig/datasheet.h"

namespace faultline {

// Throws InputError of one line, with file and line of the entry.
void check_datasheet(const Datasheet& sheet);

}  // namespace faultline
