#include "faultline/rig/alarm_kind.h"

#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::array<const char*, 5> kWords = {"fault", "sensor", "model", "unknown", "data"};  // in the enum's order

}  // namespace

const char* to_string(AlarmKind kind) { return kWords.at(static_cast<std::size_t>(kind)); }

AlarmKind parse_alarm_kind(const std::string& word, const std::string& where) {
  for (std::size_t i = 0; i < kWords.size(); ++i)
    if (word == kWords[i]) return static_cast<AlarmKind>(i);
  throw InputError(fmt::format("{}: there is no kind '{}'; allowed are {}", where, word, fmt::join(kWords, ", ")));
}

}  // namespace faultline
