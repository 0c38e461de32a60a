#include "faultline/rig/rig_library.h"

#include <dlfcn.h>

#include <algorithm>
#include <boost/property_tree/xml_parser.hpp>
#include <filesystem>
#include <fstream>
#include <map>

#include <fmt/format.h>

#include <faultline/interface.h>  // made by the build
#include "faultline/rig/rig.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"
#include "faultline/signal/registry.h"

// What libraries of rigs refer to: see the header.
extern "C" const int FAULTLINE_INTERFACE;
extern "C" const int FAULTLINE_INTERFACE = 1;

namespace faultline {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 6;  // folders below a workspace's src/ in which packages are looked for

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

std::string plain_path(const fs::path& path) {
  std::error_code error;
  const fs::path found = fs::weakly_canonical(path, error);
  return (error ? path : found).string();
}

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    found.push_back(entry->path());
  std::sort(found.begin(), found.end());
  return found;
}

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// `folders`: where lib/ may be, the first that has the library wins.
std::string find_library(const std::string& name, const fs::path& package, std::vector<std::string> spaces,
                         std::string& looked_in) {
  if (name.find('/') != std::string::npos) {
    const fs::path path = package / name;  // of an absolute path, that path
    looked_in = path.parent_path().string();
    return is_file(path) ? path.string() : "";
  }
  for (const char* around : {".", "build/devel", "devel", "../..", "../../devel"})
    spaces.push_back(plain_path(package / around));
  for (const std::string& space : spaces) {
    const fs::path path = fs::path(space) / "lib" / name;
    if (is_file(path)) return path.string();
    if (is_folder(path.parent_path())) looked_in += (looked_in.empty() ? "" : ", ") + path.parent_path().string();
  }
  return "";
}

void check_files(RigPlace& place, const std::string& library, const std::vector<std::string>& spaces) {
  std::string looked_in;
  place.library = find_library(library, place.package, spaces, looked_in);
  if (!is_file(fs::path(place.config) / "rig.yaml"))
    place.trouble =
        fmt::format("{}: this folder of its datasheet holds no rig.yaml; mend package.xml or the folder", place.config);
  else if (place.library.empty())
    place.trouble = fmt::format(
        "{}: its library {} is not in {}; build the package, then source its setup.bash or name its devel "
        "space in FAULTLINE_RIG_PATH",
        place.package, library, looked_in.empty() ? "any lib/ around it" : looked_in);
}

void add_package(const fs::path& folder, const std::vector<std::string>& spaces, std::vector<RigPlace>& places) {
  const fs::path manifest = folder / "package.xml";
  boost::property_tree::ptree tree;
  try {
    boost::property_tree::read_xml(manifest.string(), tree);
  } catch (const boost::property_tree::xml_parser_error& error) {
    places.push_back({"", "", "", folder.string(),
                      fmt::format("{}:{}: this is no XML ({})", manifest.string(), error.line(), error.message())});
    return;
  }
  const auto exports = tree.get_child_optional("package.export");
  if (!exports) return;
  for (const auto& [tag, entry] : *exports) {
    if (tag != "faultline") continue;
    const auto attribute = [&entry = entry, &folder](const std::string& name, const std::string& otherwise) {
      std::string value = entry.get("<xmlattr>." + name, otherwise);
      if (const auto place = value.find("${prefix}"); place != std::string::npos)
        value.replace(place, 9, folder.string());
      return value;
    };
    RigPlace place;
    place.rig = attribute("rig", "");
    place.package = folder.string();
    place.config = plain_path(folder / attribute("config", "config/" + place.rig));
    const std::string library = attribute("library", "");
    if (place.rig.empty() || library.empty())
      place.trouble = fmt::format("{}: <faultline> needs the attributes rig and library", manifest.string());
    else
      check_files(place, library, spaces);
    places.push_back(place);
  }
}

void add_packages_below(const fs::path& folder, const std::vector<std::string>& spaces, int depth,
                        std::vector<RigPlace>& places) {
  if (is_file(folder / "CATKIN_IGNORE")) return;
  if (is_file(folder / "package.xml")) return add_package(folder, spaces, places);
  if (depth == 0) return;
  for (const fs::path& entry : entries_of(folder))
    if (is_folder(entry) && entry.filename().string().front() != '.')
      add_packages_below(entry, spaces, depth - 1, places);
}

void add_folder(const std::string& folder, std::vector<std::string> spaces, std::vector<RigPlace>& places) {
  const fs::path here = plain_path(folder);
  const std::size_t before = places.size();
  if (is_file(here / "package.xml")) {
    add_package(here, spaces, places);
  } else {
    spaces.insert(spaces.begin(), here.string());
    std::ifstream file(here / ".catkin");  // source folders with ; between
    for (std::string source; std::getline(file, source, ';');) {
      while (!source.empty() && source.back() == '\n') source.pop_back();
      if (!source.empty()) add_packages_below(plain_path(source), spaces, kDeepest, places);
    }
    for (const fs::path& package : entries_of(here / "share"))
      if (is_file(package / "package.xml")) add_package(package, spaces, places);
    for (const fs::path& config : entries_of(here / "config")) {
      if (!is_file(config / "rig.yaml")) continue;
      RigPlace place;
      place.rig = config.filename().string();
      place.package = here.string();
      place.config = config.string();
      check_files(place, "lib" + place.rig + ".so", spaces);
      places.push_back(place);
    }
  }
  if (places.size() == before)
    places.push_back({"", "", "", folder,
                      fmt::format("{}: {}; name a package that exports a rig, its devel or install space, or a folder "
                                  "with config/RIG/rig.yaml and lib/libRIG.so",
                                  folder, is_folder(here) ? "no rig is in this folder" : "there is no such folder")});
}

const RigPlace* place_of(const std::vector<RigPlace>& places, const std::string& rig) {
  const auto place = std::find_if(places.begin(), places.end(), [&](const RigPlace& p) { return p.rig == rig; });
  return place == places.end() ? nullptr : &*place;
}

// Empty where the library is loaded, else what went wrong.
std::string open_library(const RigPlace& place) {
  std::vector<std::string> taken;
  taken_names() = &taken;
  const void* handle = ::dlopen(place.library.c_str(), RTLD_NOW);
  taken_names() = nullptr;
  if (!handle) {
    const char* said = ::dlerror();
    const std::string why = one_line(said ? said : "unknown reason");
    if (why.find("undefined symbol") != std::string::npos)
      return fmt::format("{}; it was built against another version of faultline: build the package {} again", why,
                         place.package);
    return fmt::format("{}; build the package {} again", why, place.package);
  }
  if (!taken.empty()) return fmt::format("{}: {}; rename this one", place.library, taken.front());
  if (!find_rig_type(place.rig))
    return fmt::format(
        "{}: it brings no equations of this name; FAULTLINE_RIG in its sources and package.xml must "
        "name the same rig",
        place.library);
  return "";
}

}  // namespace

std::vector<RigPlace> find_rig_places(const std::vector<std::string>& folders, const std::vector<std::string>& spaces) {
  std::vector<RigPlace> found, places;
  for (const std::string& folder : folders) add_folder(folder, spaces, found);
  // The same package by two ways is one; what differs shares its name with another.
  for (const RigPlace& place : found) {
    const auto twin = std::find_if(places.begin(), places.end(),
                                   [&](const RigPlace& p) { return !p.rig.empty() && p.rig == place.rig; });
    if (twin == places.end()) {
      places.push_back(place);
    } else if (twin->config != place.config) {
      twin->trouble = fmt::format("two rigs have this name, in {} and in {}; rename one, or take one off the path",
                                  twin->package, place.package);
    } else if (!twin->trouble.empty()) {
      *twin = place;
    }
  }
  return places;
}

void load_rig(const RigPlace& place) {
  static std::map<std::string, std::string> outcome;  // by library and rig: what went wrong, empty if nothing
  std::string trouble = place.trouble;
  if (trouble.empty()) {
    const auto [entry, is_new] = outcome.try_emplace(place.library + ":" + place.rig);
    if (is_new) entry->second = open_library(place);
    trouble = entry->second;
  }
  if (!trouble.empty()) throw InputError(fmt::format("rig '{}': {}", place.rig, trouble));
}

void load_rig(const std::vector<RigPlace>& places, const std::string& rig) {
  const RigPlace* place = place_of(places, rig);
  if (place && !rig.empty() && !find_rig_type(rig)) load_rig(*place);
}

Datasheet find_datasheet(const std::string& own, const std::vector<RigPlace>& places, const std::string& rig) {
  const RigPlace* place = place_of(places, rig);
  const bool is_own = is_file(fs::path(own) / rig / "rig.yaml");
  if (!place || rig.empty()) {
    if (is_own || places.empty()) return find_datasheet(own, rig);
    std::vector<std::string> rigs;
    for (const fs::path& entry : entries_of(own))
      if (is_file(entry / "rig.yaml")) rigs.push_back(entry.filename().string());
    for (const RigPlace& other : places)
      if (!other.rig.empty()) rigs.push_back(other.rig);
    std::sort(rigs.begin(), rigs.end());
    throw InputError(fmt::format("there is no rig '{}'; there are {}", rig, joined(rigs)));
  }
  if (is_own)
    throw InputError(
        fmt::format("rig '{}': two rigs have this name, in {} and in {}; rename the second, or take it off the path",
                    rig, (fs::path(own) / rig).string(), place->package));
  load_rig(*place);
  Datasheet sheet = read_datasheet(place->config);
  if (sheet.rig != rig)
    throw InputError(fmt::format("{}: the file describes rig '{}', package.xml of {} says '{}'; make them agree",
                                 sheet.file, sheet.rig, place->package, rig));
  return sheet;
}

Datasheet read_datasheet(const std::string& path, const std::vector<RigPlace>& places) {
  if (!places.empty()) {
    const fs::path file = is_folder(path) ? fs::path(path) / "rig.yaml" : fs::path(path);
    const YamlValue root = YamlValue::load(file.string());
    // Whatever is wrong with this key, reading the datasheet says it.
    if (root.has("rig")) load_rig(places, root.at("rig").text());
  }
  return read_datasheet(path);
}

}  // namespace faultline
