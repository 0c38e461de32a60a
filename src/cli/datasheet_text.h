// Edits numbers in the text of a datasheet in place: comments and layout stay. The outcome goes into a file of its own.
#pragma once

#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

// What a datasheet is written as, in one file: the rig's facts and, where they stand in a file of their own, the
// stages.
std::string datasheet_text(const Datasheet& sheet);

// Gives a parameter another nominal value, or tolerance (`key`). InputError where the text is of a form that cannot be
// edited in place.
void set_parameter(const Datasheet& sheet, std::string& text, const std::string& parameter, const std::string& key,
                   double value);

// Gives a setting of a stage (an entry `- name: STAGE` of estimators, detectors, ...) another value, as text.
void set_stage_setting(const Datasheet& sheet, std::string& text, const std::string& stage, const std::string& key,
                       const std::string& value);

// Writes the text of a datasheet, after it has been read back: what cannot be loaded is not kept.
void write_datasheet(const std::string& text, const std::string& file);

}  // namespace faultline
