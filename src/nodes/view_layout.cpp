#include "nodes/view_layout.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include <fmt/format.h>

#include "faultline/rig/nearest_name.h"
#include "faultline/rig/yaml_reader.h"

namespace faultline {
namespace {

constexpr double kDepth = 0.3;  // of a box or a path that says none

const std::vector<std::string> kShapes = {"box", "cylinder", "sphere", "path", "text"};

std::vector<double> numbers(const YamlValue& value, std::size_t least, std::size_t most) {
  std::vector<double> found = value.numbers();
  if (found.size() < least || found.size() > most)
    value.fail(least == most ? fmt::format("must be {} numbers", least)
                             : fmt::format("must be {} to {} numbers", least, most));
  return found;
}

ViewSource source(const YamlValue& value, const Datasheet& sheet) {
  ViewSource found{value.name(), find_channel(sheet.channels, value.name())};
  std::vector<std::string> known;
  for (const Channel& channel : sheet.channels) known.push_back(channel.name);
  bool state = false;
  for (const State& s : sheet.states) {
    known.push_back(s.name);
    if (s.name != found.name) continue;
    state = true;
    if (found.channel < 0) found.channel = s.channel;
  }
  if (!state && found.channel < 0)
    value.fail(fmt::format("is '{}', which is no channel and no state of the rig{}", found.name,
                           did_you_mean(found.name, known)));
  return found;
}

void read_shape(const YamlValue& entry, ViewPart& part) {
  const std::string shape = entry.at("shape").text();
  const auto found = std::find(kShapes.begin(), kShapes.end(), shape);
  if (found == kShapes.end())
    entry.at("shape").fail(
        fmt::format("is '{}'; allowed are {}{}", shape, joined(kShapes), did_you_mean(shape, kShapes)));
  part.shape = static_cast<PartShape>(found - kShapes.begin());
  const bool path = part.shape == PartShape::path;
  for (const char* key : {"points", "flow"})
    if (entry.has(key) && !path) entry.at(key).fail("is for shape: path only");
  if (entry.has("along") && part.shape != PartShape::cylinder) entry.at("along").fail("is for shape: cylinder only");
  if (part.shape == PartShape::text) {
    for (const char* key : {"size", "ports", "moves", "turns", "clear"})
      if (entry.has(key)) entry.at(key).fail("is not for shape: text");
    return;
  }
  if (!entry.has("size")) entry.fail("lacks the key 'size'");
  const std::vector<double> size = numbers(entry.at("size"), path ? 1 : 2, path ? 1 : 3);
  for (const double extent : size)
    if (extent <= 0 || extent > kCanvasWidth)
      entry.at("size").fail(fmt::format("must be above 0 and at most {}", kCanvasWidth));
  if (path) {
    part.size = {size[0], size[0], size[0]};
    if (!entry.has("points")) entry.fail("lacks the key 'points'");
    for (const YamlValue& point : entry.at("points").items()) {
      const std::vector<double> xy = numbers(point, 2, 2);
      part.points.push_back({xy[0], xy[1]});
    }
    if (part.points.size() < 2) entry.at("points").fail("must be two points at least");
  } else {
    part.size = {size[0], size[1],
                 size.size() > 2                ? size[2]
                 : part.shape == PartShape::box ? kDepth
                                                : std::min(size[0], size[1])};
  }
  if (entry.has("along")) {
    const std::string axis = entry.at("along").text();
    if (axis != "x" && axis != "y" && axis != "z")
      entry.at("along").fail(fmt::format("is '{}'; allowed are x, y, z", axis));
    part.along = axis[0];
  }
}

void read_motion(const YamlValue& entry, const Datasheet& sheet, ViewPart& part) {
  if (entry.has("moves")) {
    const YamlValue moves = entry.at("moves");
    moves.allow({"with", "by"}, {});
    part.moves = source(moves.at("with"), sheet);
    const std::vector<double> by = numbers(moves.at("by"), 2, 2);
    part.move_by = {by[0], by[1]};
  }
  if (entry.has("turns")) {
    const YamlValue turns = entry.at("turns");
    turns.allow({"with", "by"}, {});
    part.turns = source(turns.at("with"), sheet);
    part.turn_by = turns.at("by").number();
  }
  if (entry.has("flow")) {
    const YamlValue flow = entry.at("flow");
    flow.allow({"with", "full"}, {});
    part.flow = source(flow.at("with"), sheet);
    part.flow_full = flow.at("full").number();
    if (part.flow_full == 0) flow.at("full").fail("must not be 0");
  }
}

ViewPart read_part(const YamlValue& entry, const Datasheet& sheet, const std::vector<ViewPart>& earlier) {
  entry.allow({"name", "shape", "at"}, {"size", "along", "clear", "points", "ports", "label", "label_at", "letters",
                                        "shows", "on", "moves", "turns", "flow"});
  ViewPart part;
  part.name = entry.at("name").name();
  for (const ViewPart& other : earlier)
    if (other.name == part.name)
      entry.fail(fmt::format("uses the name '{}' a second time; names must differ", part.name));
  read_shape(entry, part);
  if (entry.has("on")) {
    const std::string name = entry.at("on").name();
    std::vector<std::string> names;
    for (const ViewPart& other : earlier) names.push_back(other.name);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      entry.at("on").fail(
          fmt::format("is '{}', which is no part that stands before it{}", name, did_you_mean(name, names)));
    part.parent = static_cast<int>(found - names.begin());
  }
  const std::vector<double> at = numbers(entry.at("at"), 2, 3);
  part.at = {at[0], at[1], at.size() > 2 ? at[2] : 0};
  const std::array<double, 2> place = place_on_canvas(earlier, part);
  if (std::abs(place[0]) > kCanvasWidth / 2 || std::abs(place[1]) > kCanvasHeight / 2)
    entry.at("at").fail(fmt::format("puts the part at {:g}, {:g}; the canvas ends at {:g}, {:g}", place[0], place[1],
                                    kCanvasWidth / 2, kCanvasHeight / 2));
  if (entry.has("clear")) part.clear = entry.at("clear").truth();
  if (entry.has("label")) part.label = entry.at("label").text();
  if (part.shape == PartShape::path)
    part.label_at = {0, 0.25};
  else if (part.shape != PartShape::text)
    part.label_at = {0, part.size[1] / 2 + 0.25};
  if (entry.has("label_at")) {
    const std::vector<double> xy = numbers(entry.at("label_at"), 2, 2);
    part.label_at = {xy[0], xy[1]};
  }
  if (entry.has("letters")) part.letters = entry.at("letters").number(0.05, 1);
  if (entry.has("shows"))
    for (const YamlValue& item : entry.at("shows").items()) {
      const ViewSource shown = source(item, sheet);
      if (shown.channel < 0) item.fail(fmt::format("is '{}', which no channel measures", shown.name));
      part.shows.push_back(shown.channel);
    }
  read_motion(entry, sheet, part);
  return part;
}

void check_ports_shown(const YamlValue& root, const Datasheet& sheet, const std::vector<ViewPart>& parts) {
  std::set<std::string> shown;
  for (const ViewPart& part : parts) shown.insert(part.ports.begin(), part.ports.end());
  std::vector<std::string> missing;
  for (const Port& port : sheet.ports)
    if (shown.count(port.name) == 0) missing.push_back(port.name);
  if (!missing.empty()) root.at("parts").fail(fmt::format("has no part with the port {}", joined(missing)));
}

}  // namespace

std::array<double, 2> place_on_canvas(const std::vector<ViewPart>& parts, const ViewPart& part) {
  std::array<double, 2> place{part.at[0], part.at[1]};
  for (int i = part.parent; i >= 0; i = parts[static_cast<std::size_t>(i)].parent) {
    place[0] += parts[static_cast<std::size_t>(i)].at[0];
    place[1] += parts[static_cast<std::size_t>(i)].at[1];
  }
  return place;
}

ViewLayout read_view_layout(const std::string& file, const Datasheet& sheet) {
  YamlValue root = YamlValue::load(file, "layout of a view", "rig: NAME");
  root.allow({"rig", "parts"}, {});
  root.set_branches(sheet.branches);
  if (root.at("rig").name() != sheet.rig)
    root.at("rig").fail(
        fmt::format("is '{}', but the datasheet beside it is of '{}'", root.at("rig").name(), sheet.rig));
  std::vector<std::string> ports;
  for (const Port& port : sheet.ports) ports.push_back(port.name);
  std::set<std::string> taken;
  ViewLayout layout;
  layout.file = file;
  for (const YamlValue& entry : YamlValue::expanded(root.at("parts").items())) {
    layout.parts.push_back(read_part(entry, sheet, layout.parts));
    if (!entry.has("ports")) continue;
    for (const YamlValue& item : entry.at("ports").items()) {
      const std::string name = item.text();
      if (std::find(ports.begin(), ports.end(), name) == ports.end())
        item.fail(fmt::format("is '{}', which is no port of the rig{}", name, did_you_mean(name, ports)));
      if (!taken.insert(name).second) item.fail(fmt::format("is '{}', which an earlier part shows", name));
      layout.parts.back().ports.push_back(name);
    }
  }
  check_ports_shown(root, sheet, layout.parts);
  return layout;
}

ViewLayout view_layout(const Datasheet& sheet) {
  const std::filesystem::path sheet_file(sheet.file);
  const std::filesystem::path file = sheet_file.parent_path() / "view.yaml";
  return sheet_file.filename() == "rig.yaml" && std::filesystem::exists(file) ? read_view_layout(file.string(), sheet)
                                                                              : generated_layout(sheet);
}

}  // namespace faultline
