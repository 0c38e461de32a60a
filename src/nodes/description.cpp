#include "nodes/description.h"

#include <algorithm>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

std::vector<std::size_t> match_channels(const Datasheet& sheet, const Description& description) {
  if (description.rig != sheet.rig) {
    throw InputError(
        fmt::format("these are samples of the rig '{}', not of '{}': start with that rig, or give the right recording",
                    description.rig, sheet.rig));
  }
  if (description.units.size() != description.names.size()) {
    throw InputError(fmt::format("{}: the description names {} channels but {} units; mend what writes it", sheet.rig,
                                 description.names.size(), description.units.size()));
  }
  std::vector<std::size_t> places;
  places.reserve(sheet.channels.size());
  for (const Channel& channel : sheet.channels) {
    const auto found = std::find(description.names.begin(), description.names.end(), channel.name);
    if (found == description.names.end()) {
      throw InputError(fmt::format("{}: channel '{}' [{}] is missing from the samples; {} asks for it", sheet.rig,
                                   channel.name, channel.unit, sheet.file));
    }
    if (std::find(found + 1, description.names.end(), channel.name) != description.names.end())
      throw InputError(fmt::format("{}: channel '{}' comes twice in the samples; keep one", sheet.rig, channel.name));
    const std::size_t place = static_cast<std::size_t>(found - description.names.begin());
    if (description.units[place] != channel.unit) {
      throw InputError(fmt::format("{}: channel '{}' comes in '{}', {} says '{}'; convert it at the source", sheet.rig,
                                   channel.name, description.units[place], sheet.file, channel.unit));
    }
    places.push_back(place);
  }
  return places;
}

bool arrange(const std::vector<std::size_t>& places, std::size_t described, Sample& sample) {
  if (sample.values.size() != described) return false;
  bool same = places.size() == described;
  for (std::size_t i = 0; same && i < places.size(); ++i) same = places[i] == i;
  if (same) return true;
  std::vector<double> values(places.size());
  std::transform(places.begin(), places.end(), values.begin(), [&](std::size_t place) { return sample.values[place]; });
  sample.values = std::move(values);
  return true;
}

Description describe(const Datasheet& sheet, const std::string& made_by) {
  Description description;
  description.rig = sheet.rig;
  description.sample_period = sheet.sample_period;
  description.made_by = made_by;
  for (const Channel& channel : sheet.channels) {
    description.names.push_back(channel.name);
    description.units.push_back(channel.unit);
  }
  return description;
}

}  // namespace faultline
