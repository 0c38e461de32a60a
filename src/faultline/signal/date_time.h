// Points in time as text. ISO 8601: 2024-03-01T12:30:05.25, with a blank for T, a comma before the fraction, without
// seconds, and with Z or an offset such as +01:00 behind it; without one, UTC. Or by a format of strptime(3), such as
// "%d.%m.%Y %H:%M:%S", where a fraction may follow the seconds; a part that the format lacks is that of 2000-01-01.
#pragma once

#include <optional>
#include <string>

namespace faultline {

// s since 2000-01-01T00:00:00Z, leap seconds left out; nothing where the text is no such time. `format` empty: ISO
// 8601.
std::optional<double> parse_date_time(const std::string& text, const std::string& format);

}  // namespace faultline
