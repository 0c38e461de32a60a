// What a stage has learnt of the healthy rig, to be kept from one run to the next: a detector's steady value, mean
// features of an isolator, an estimator's histograms. Dumb data; the stage that made it says what the numbers mean, and
// raises `version` when that changes.
//
// As a file it is text: a line `faultline references 1`, the rig, per stage a line with its name, type, version and
// count followed by one `name value` each, and a CRC-32 of all that in the last line. A file that is damaged, cut off,
// of another form or of another rig is refused as a whole.
#pragma once

#include <string>
#include <vector>

namespace faultline {

struct Reference {
  std::string type;  // of the stage that made it, as the datasheet names it
  int version = 0;   // of the numbers' meaning
  std::vector<std::string> names;
  std::vector<double> numbers;  // finite, one per name
};

struct StageReference {
  std::string stage;  // its name in the datasheet
  Reference reference;
};

struct References {
  std::string rig;
  std::string file;  // that they were read from, for messages
  std::vector<StageReference> stages;
};

// InputError unless `given` is of that type and version and holds just these names.
void check_reference(const Reference& given, const std::string& type, int version,
                     const std::vector<std::string>& names);

std::string to_text(const References& references);
// InputErrors begin with `file`.
References parse_references(const std::string& text, const std::string& rig, const std::string& file);

// InputError where the file cannot be read or is refused.
References read_references(const std::string& file, const std::string& rig);
// Whole or not at all. A file that is already there is replaced if it holds references of the same rig; InputError
// where it does not, or cannot be written, and it stays as it is.
void write_references(const References& references, const std::string& file);
// Likewise, but what the file holds of other stages stays, whoever writes them at the same time.
void update_references(const References& references, const std::string& file);
// The same refusal, before the work is done.
void check_replaceable(const std::string& file, const std::string& rig);

}  // namespace faultline
