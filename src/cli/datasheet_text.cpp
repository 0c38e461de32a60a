#include "cli/datasheet_text.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <regex>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "cli/output_file.h"
#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// Puts a text in place of a scalar. False: it does not stand where the parser says.
bool replace_scalar(std::string& text, const YAML::Node& old, const std::string& by) {
  const auto begin = static_cast<std::size_t>(old.Mark().pos);
  if (!old.IsScalar() || text.compare(begin, old.Scalar().size(), old.Scalar()) != 0) return false;
  text.replace(begin, old.Scalar().size(), by);
  return true;
}

// A number of an entry that stands for one per branch. One that all share becomes one of each.
bool set_of_branch(const Datasheet& sheet, std::string& text, const std::string& parameter, const std::string& key,
                   const std::string& value) {
  const YAML::Node all = YAML::Load(text);
  for (const YAML::Node& entry : all["parameters"])
    for (const std::string& branch : sheet.branches) {
      if (!entry["name"] || !entry[key] || with_branch(entry["name"].Scalar(), branch) != parameter) continue;
      const YAML::Node old = entry[key];
      if (old.IsMap()) return old[branch] && replace_scalar(text, old[branch], value);
      std::string each;
      for (const std::string& other : sheet.branches)
        each += fmt::format("{}{}: {}", each.empty() ? "{" : ", ", other, other == branch ? value : old.Scalar());
      return replace_scalar(text, old, each + "}");
    }
  return false;
}

}  // namespace

std::string datasheet_text(const Datasheet& sheet) {
  std::string text = read_text(sheet.file);
  if (!sheet.stages_file.empty()) text += "\n" + read_text(sheet.stages_file);
  // Files that stages name stand beside the sheet they were read from, and a copy may lie anywhere.
  const std::string& named_in = sheet.stages_file.empty() ? sheet.file : sheet.stages_file;
  const std::string folder = std::filesystem::path(resolved(named_in)).parent_path().string();
  return std::regex_replace(text, std::regex("(\\n *weights: *)([^/\"'\\s#][^\\n#]*)"), "$1" + folder + "/$2");
}

void set_parameter(const Datasheet& sheet, std::string& text, const std::string& parameter, const std::string& key,
                   double value) {
  // name: X ... key: NUMBER, on one line or the lines of one entry.
  const std::regex entry("(name: *" + parameter + "\\b[^}]*?\\b" + key + ": *)([-+0-9.eE]+)");
  std::smatch match;
  const std::string number = fmt::format("{:.6e}", value);
  if (std::regex_search(text, match, entry))
    text = match.prefix().str() + match[1].str() + number + match.suffix().str();
  else if (!set_of_branch(sheet, text, parameter, key, number))
    throw InputError(
        fmt::format("{}: parameter {} is not written as 'name: {}, ..., {}: NUMBER'; edit it by hand to {:.6g}",
                    sheet.file, parameter, parameter, key, value));
}

void set_stage_setting(const Datasheet& sheet, std::string& text, const std::string& stage, const std::string& key,
                       const std::string& value) {
  const YAML::Node all = YAML::Load(text);
  for (const char* group : {"estimators", "detectors", "isolators"})
    for (const YAML::Node& entry : all[group]) {
      if (!entry["name"] || entry["name"].Scalar() != stage || !entry[key]) continue;
      const YAML::Node old = entry[key];
      const auto begin = static_cast<std::size_t>(old.Mark().pos);
      std::size_t size = 0;
      if (old.IsScalar() && text.compare(begin, old.Scalar().size(), old.Scalar()) == 0) {
        size = old.Scalar().size();
      } else if (old.IsSequence() && text.compare(begin, 1, "[") == 0) {
        size = text.find(']', begin) - begin + 1;
      } else {
        break;
      }
      text.replace(begin, size, value);
      return;
    }
  throw InputError(fmt::format("{}: stage {} has no '{}: NUMBER' or '{}: [...]' of its own; edit it by hand to {}",
                               sheet.stages_file.empty() ? sheet.file : sheet.stages_file, stage, key, key, value));
}

void write_datasheet(const std::string& text, const std::string& file) {
  OutputFile output(file);
  {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(output.written().c_str(), "wb"),
                                                                 std::fclose);
    if (!stream || std::fwrite(text.data(), 1, text.size(), stream.get()) != text.size() ||
        std::fflush(stream.get()) != 0)
      throw InputError(fmt::format("{}: writing failed ({}); nothing is kept", file, std::strerror(errno)));
  }
  try {
    read_datasheet(output.written());
  } catch (const InputError& error) {
    std::string why = error.what();
    const std::size_t place = why.find(output.written());
    if (place != std::string::npos) why.replace(place, output.written().size(), file);
    throw InputError(fmt::format("{}; nothing is kept; edit the datasheet by hand", why));
  }
  output.commit();
}

}  // namespace faultline
