#include "nodes/view_text.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "faultline/signal/units.h"

namespace faultline {

std::string shown_value(double value, const Channel& channel) {
  std::string unit = channel.unit;
  double scale = 1;
  const double largest = std::max(std::abs(channel.minimum), std::abs(channel.maximum));
  if (unit == "m^3/s") {
    unit = "l/min";
    scale = conversion("m^3/s", unit).scale;
  } else if (unit == "Pa" || unit == "m" || unit == "N" || unit == "W" || unit == "V") {
    static const struct {
      double from;
      const char* prefix;
      double scale;
    } prefixes[] = {{1e6, "M", 1e-6}, {1e3, "k", 1e-3}, {1, "", 1}, {1e-3, "m", 1e3}, {0, "u", 1e6}};
    for (const auto& prefix : prefixes)
      if (largest >= prefix.from) {
        unit = prefix.prefix + unit;
        scale = prefix.scale;
        break;
      }
  }
  if (unit == "1") unit.clear();
  // As many decimals for all values of a channel: four digits of its range.
  const int decimals = std::clamp(3 - static_cast<int>(std::floor(std::log10(std::max(largest * scale, 1e-12)))), 0, 3);
  return fmt::format("{:.{}f}{}{}", value * scale, decimals, unit.empty() ? "" : " ", unit);
}

std::string wrapped(const std::string& text, std::size_t width) {
  std::istringstream words(text);
  std::string lines;
  std::size_t length = 0;
  for (std::string word; words >> word;) {
    if (length > 0) {
      const bool fits = length + 1 + word.size() <= width;
      lines += fits ? ' ' : '\n';
      length = fits ? length + 1 : 0;
    }
    lines += word;
    length += word.size();
  }
  return lines;
}

std::string words_of(const std::string& name) {
  std::string words = name;
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

}  // namespace faultline
