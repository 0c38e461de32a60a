#include "cli/datasheet_text.h"

#include <regex>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

void set_parameter(const Datasheet& sheet, std::string& text, const std::string& parameter, const std::string& key,
                   double value) {
  // name: X ... key: NUMBER, on one line or the lines of one entry.
  const std::regex entry("(name: *" + parameter + "\\b[^}]*?\\b" + key + ": *)([-+0-9.eE]+)");
  std::smatch match;
  if (!std::regex_search(text, match, entry))
    throw InputError(
        fmt::format("{}: parameter {} is not written as 'name: {}, ..., {}: NUMBER'; edit it by hand to {:.6g}",
                    sheet.file, parameter, parameter, key, value));
  text = match.prefix().str() + match[1].str() + fmt::format("{:.6e}", value) + match.suffix().str();
}

}  // namespace faultline
