// Look-ups in a datasheet, and which datasheets a folder holds. The reader is in rig/datasheet_reader.cpp.
#include "faultline/rig/datasheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "faultline/rig/nearest_name.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

template <class T>
std::vector<std::string> names_of(const std::vector<T>& things) {
  std::vector<std::string> names;
  for (const T& thing : things) names.push_back(thing.name);
  return names;
}

template <class T>
std::size_t find(const Datasheet& sheet, const std::vector<T>& things, const char* what, const std::string& name) {
  if (sheet.asked) sheet.asked->insert(fmt::format("{}s.{}", what, name));
  for (std::size_t i = 0; i < things.size(); ++i)
    if (things[i].name == name) return i;
  throw InputError(fmt::format("{}: {} has no {} '{}'; there are {}{}", sheet.file, sheet.rig, what, name,
                               joined(names_of(things)), did_you_mean(name, names_of(things))));
}

// Folders of rigs (RIG/rig.yaml) in a folder, sorted by name.
std::vector<std::filesystem::path> rig_folders(const std::string& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> found;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (std::filesystem::exists(entry->path() / "rig.yaml")) found.push_back(entry->path());
  if (error)
    throw InputError(
        fmt::format("{}: the folder cannot be read ({}); give the one with the datasheets", folder, error.message()));
  if (found.empty()) throw InputError(fmt::format("{}: the folder holds no datasheet (RIG/rig.yaml)", folder));
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

const Port& Datasheet::port(const std::string& name) const { return ports[find(*this, ports, "port", name)]; }
int Datasheet::channel(const std::string& name) const {
  return static_cast<int>(find(*this, channels, "channel", name));
}
int Datasheet::parameter(const std::string& name) const {
  return static_cast<int>(find(*this, parameters, "parameter", name));
}
const Profile& Datasheet::profile(const std::string& name) const {
  return profiles[find(*this, profiles, "profile", name)];
}
const Fault& Datasheet::fault(const std::string& name) const { return faults[find(*this, faults, "fault", name)]; }

std::size_t Datasheet::estimator(const std::string& name) const { return find(*this, estimators, "estimator", name); }

std::string Datasheet::place(const std::string& entry) const {
  const auto found = places.find(entry);
  return found == places.end() ? file + ":" : found->second;
}

std::vector<double> Datasheet::nominal() const {
  std::vector<double> values;
  for (const Parameter& parameter : parameters) values.push_back(parameter.nominal);
  return values;
}

std::vector<Datasheet> read_datasheets(const std::string& folder) {
  std::vector<Datasheet> sheets;
  for (const auto& path : rig_folders(folder)) sheets.push_back(read_datasheet(path.string()));
  std::sort(sheets.begin(), sheets.end(), [](const Datasheet& a, const Datasheet& b) { return a.rig < b.rig; });
  for (std::size_t i = 1; i < sheets.size(); ++i)
    if (sheets[i].rig == sheets[i - 1].rig)
      throw InputError(fmt::format("{}: rig '{}' is already described by {}; remove one of the two", sheets[i].file,
                                   sheets[i].rig, sheets[i - 1].file));
  return sheets;
}

Datasheet find_datasheet(const std::string& folder, const std::string& rig) {
  // By the folder's name, so that a mistake in one datasheet does not stop work on another rig.
  std::vector<std::string> rigs;
  for (const auto& path : rig_folders(folder)) {
    rigs.push_back(path.filename().string());
    if (rigs.back() != rig) continue;
    Datasheet sheet = read_datasheet(path.string());
    if (sheet.rig != rig)
      throw InputError(
          fmt::format("{}: the file describes rig '{}'; name its folder {}", sheet.file, sheet.rig, sheet.rig));
    return sheet;
  }
  throw InputError(fmt::format("{}: there is no rig '{}'; there are {}", folder, rig, joined(rigs)));
}

}  // namespace faultline
