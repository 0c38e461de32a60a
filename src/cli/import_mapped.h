// Somebody's own recordings, as a mapping (rig/mapping.h) says: bags with any messages, tables of any layout.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/mapping.h"
#include "faultline/signal/sample.h"

namespace faultline {

struct MappedImport {
  Recording recording;               // s since 2000, or from the time that the table begins at
  std::vector<std::string> remarks;  // one line each
  std::string filter;                // the anti-alias filter and what it was laid on; empty: none
};

// All files are bags (.bag), or none is. InputError names file, topic or column.
MappedImport import_mapped(const std::vector<std::string>& files, const Mapping& mapping, const Datasheet& sheet);

}  // namespace faultline
