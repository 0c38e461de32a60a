// How the reader of datasheets is divided: rig/datasheet_reader.cpp reads what a rig is, rig/datasheet_runs.cpp how it
// is run (inputs, controllers, profiles, faults) and diagnosed. Private to these two.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/yaml_reader.h"

namespace faultline::datasheet_sections {

using Names = std::set<std::string>;

// InputError at the entry if the name is in use; else adds it.
void add_unique(Names& names, const YamlValue& entry, const std::string& name);

// What stands at a key that may be absent.
std::vector<YamlValue> list_at(const YamlValue& root, const std::string& key);
std::vector<YamlValue> mapping_at(const YamlValue& root, const std::string& key);
std::string text_or(const YamlValue& entry, const std::string& key, const std::string& fallback);

// A unit as faultline/signal/units.h reads it; InputError at `value` else, or if it must be an SI unit and is not.
std::string unit_of(const YamlValue& value, bool must_be_si);

// InputError at `value` if a quantity of this unit is above 0 by its nature (an area, a mass, a time, ...) and `number`
// is not.
void check_sign(const YamlValue& value, const std::string& unit, double number);
// What such a quantity is: "an area"; empty where its sign is free.
std::string positive_quantity(const std::string& unit);

// InputError at `place` if the rig has no such channel.
const Channel& channel_named(const Datasheet& sheet, const YamlValue& place, const std::string& name);

// Need channels and ports of the sheet; fill the rest.
void read_excitation(const YamlValue& root, Datasheet& sheet);
void read_faults(const YamlValue& root, Datasheet& sheet);
void read_diagnosis(const YamlValue& root, Datasheet& sheet);

}  // namespace faultline::datasheet_sections
