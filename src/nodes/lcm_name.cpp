#include "nodes/lcm_name.h"

#include <algorithm>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "nodes/conversion_lcm.h"
#include "nodes/lcm_log.h"

namespace faultline {
namespace {

constexpr std::size_t kLongestChannel = 63;  // characters: LCM_MAX_CHANNEL_NAME_LENGTH
constexpr std::size_t kLongestName = kLongestChannel - sizeof(".description") + 1;
constexpr double kSearch = 10;  // s behind the first sample: a DAQ describes itself once a second

struct Recorded {
  bool samples = false, of_another_rig = false;
};

std::vector<std::string> names_of(const std::map<std::string, Recorded>& recorded, bool others) {
  std::vector<std::string> names;
  for (const auto& [name, what] : recorded)
    if (what.samples && (others || !what.of_another_rig)) names.push_back(name);
  return names;
}

std::string listed(const std::vector<std::string>& names) {
  return printable(fmt::format("{}", fmt::join(names, ", ")));
}

}  // namespace

std::string read_lcm_name(Parameters& parameters) {
  const std::string name = parameters.word("lcm_name", "");
  const bool fits = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '/' || c == '.';
  });
  if (!fits || name.size() > kLongestName)
    throw InputError(fmt::format("parameter ~lcm_name is '{}'; 1 to {} letters, digits and _ - / . are allowed",
                                 printable(name), kLongestName));
  return name;
}

std::string lcm_channel(const std::string& name, const std::string& what) { return name + "." + what; }

std::string lcm_name_of(const std::string& channel, const std::string& what) {
  const std::string end = "." + what;
  if (channel.size() <= end.size() || channel.compare(channel.size() - end.size(), end.size(), end) != 0) return "";
  return channel.substr(0, channel.size() - end.size());
}

std::string find_lcm_name(const std::string& path, const std::string& rig, const std::string& wanted) {
  LcmLog log(path);
  LcmEvent event;
  std::map<std::string, Recorded> recorded;
  double first = -1;  // s, arrival of the first sample; before: -1
  while (log.next(event)) {
    if (const std::string name = lcm_name_of(event.channel, "sample"); !name.empty()) {
      if (name == wanted) return name;
      if (first < 0) first = event.arrival;
      recorded[name].samples = true;
    } else if (const std::string of = lcm_name_of(event.channel, "description"); !of.empty()) {
      faultline_lcm::rig_description_t message;
      if (decode(event.data.data(), static_cast<int>(event.data.size()), message))
        recorded[of].of_another_rig = message.rig != rig;
    }
    if (wanted.empty() && first >= 0 && event.arrival > first + kSearch) break;
  }
  const std::vector<std::string> all = names_of(recorded, true), own = names_of(recorded, false);
  if (all.empty())
    throw InputError(log.trouble().empty() ? fmt::format("{}: no sample of the rig '{}' in it", path, rig)
                                           : log.trouble());
  if (!wanted.empty())
    throw InputError(fmt::format("{}: no LCM channel '{}' in it; it holds the samples of {}: give one as lcm_name",
                                 path, lcm_channel(wanted, "sample"), listed(all)));
  if (own.size() == 1) return own.front();
  if (own.empty() && all.size() == 1) return all.front();  // whose description says what does not fit
  if (own.empty())
    throw InputError(fmt::format("{}: no sample of the rig '{}' in it, but of {}", path, rig, listed(all)));
  throw InputError(fmt::format("{}: it holds the samples of {}: give one as lcm_name", path, listed(own)));
}

}  // namespace faultline
