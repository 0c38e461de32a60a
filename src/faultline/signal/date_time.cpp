#include "faultline/signal/date_time.h"

#include <time.h>

#include <cstdlib>
#include <regex>

namespace faultline {
namespace {

constexpr double kEpoch = 946684800;  // s, 2000-01-01T00:00:00Z after 1970

double seconds_of(std::tm& parts) { return static_cast<double>(::timegm(&parts)) - kEpoch; }

std::optional<double> parse_iso(const std::string& text) {
  static const std::regex pattern(
      R"((\d{4})-(\d{2})-(\d{2})[T ](\d{2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,12}))?)? ?(Z|([+-])(\d{2}):?(\d{2})?)?)");
  std::smatch match;
  if (!std::regex_match(text, match, pattern)) return std::nullopt;
  const auto number = [&](std::size_t i) { return match[i].matched ? std::atoi(match[i].str().c_str()) : 0; };
  std::tm parts = {};
  parts.tm_year = number(1) - 1900;
  parts.tm_mon = number(2) - 1;
  parts.tm_mday = number(3);
  parts.tm_hour = number(4);
  parts.tm_min = number(5);
  parts.tm_sec = number(6);
  if (parts.tm_mon < 0 || parts.tm_mon > 11 || parts.tm_mday < 1 || parts.tm_mday > 31 || parts.tm_hour > 24 ||
      parts.tm_min > 59 || parts.tm_sec > 60)
    return std::nullopt;
  double seconds = seconds_of(parts);
  if (match[7].matched) seconds += std::strtod(("0." + match[7].str()).c_str(), nullptr);
  const double offset = 3600 * number(10) + 60 * number(11);
  return seconds - (match[9] == "-" ? -offset : offset);
}

}  // namespace

std::optional<double> parse_date_time(const std::string& text, const std::string& format) {
  if (format.empty()) return parse_iso(text);
  // strptime knows no fractions: it is cut out behind the seconds, which follow the minutes.
  static const std::regex fraction(R"((:\d{2}:\d{2})[.,](\d{1,12}))");
  std::smatch match;
  std::string whole = text;
  double rest = 0;
  if (std::regex_search(text, match, fraction)) {
    rest = std::strtod(("0." + match[2].str()).c_str(), nullptr);
    whole = match.prefix().str() + match[1].str() + match.suffix().str();
  }
  std::tm parts = {};
  parts.tm_year = 100;
  parts.tm_mday = 1;
  const char* end = ::strptime(whole.c_str(), format.c_str(), &parts);
  if (end == nullptr || *end != '\0') return std::nullopt;
  const long offset = parts.tm_gmtoff;  // of %z; timegm sets it to 0
  return seconds_of(parts) - static_cast<double>(offset) + rest;
}

}  // namespace faultline
