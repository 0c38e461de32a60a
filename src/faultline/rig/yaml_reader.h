// One value of a YAML file together with where it stands, so that every complaint can name the file, the line and the
// key. Reading is strict: a value of the wrong type, a key that is not known, missing or given twice, and a number that
// is not finite or out of range are InputErrors of one line.
//
// Entries whose name contains {b} stand for one entry per branch of the rig. expanded() makes them; in such an entry
// {b} in any text becomes the branch's name, and any number may be a mapping branch -> number.
#pragma once

#include <yaml-cpp/yaml.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace faultline {

class YamlValue {
 public:
  // The one document of a file, which must be a mapping. `kind`: what the file is, for messages; `example`: a line of
  // it.
  static YamlValue load(const std::string& file, const std::string& kind = "datasheet",
                        const std::string& example = "rig: NAME");

  void set_branches(std::vector<std::string> branches);  // of the whole file

  const std::string& key() const { return key_; }  // in the mapping that holds it; empty in a list
  std::string place() const;                       // FILE:LINE: 'path', for messages
  std::string file() const;
  [[noreturn]] void fail(const std::string& message) const;

  // The keys of this mapping: all of `required`, any of `optional`, no other, none twice.
  void allow(const std::vector<std::string>& required, const std::vector<std::string>& optional) const;
  bool has(const std::string& key) const;
  YamlValue at(const std::string& key) const;
  std::vector<YamlValue> entries() const;  // of a mapping, in the order of the file
  std::vector<YamlValue> items() const;    // of a list
  bool is_list() const { return node_.IsSequence(); }
  bool is_mapping() const { return node_.IsMap(); }
  bool is_number() const;  // an unquoted scalar that reads as one

  std::string text() const;
  std::string name() const;  // lower-case letters, digits and _, a letter first
  double number(double minimum = -kAny, double maximum = kAny) const;  // finite
  double bound() const;                                                // a number that may be infinite
  std::vector<double> numbers() const;                                 // a list
  bool truth() const;

  // Entries with their branches: runs of neighbours that are named after {b} come as a block for each branch in turn.
  // An entry is named by its key `name`, or by its own key where it has none.
  static std::vector<YamlValue> expanded(const std::vector<YamlValue>& values);

  static constexpr double kAny = std::numeric_limits<double>::max();

 private:
  struct File {
    std::string name;
    std::string kind;
    std::vector<std::string> branches;
  };
  YamlValue(std::shared_ptr<File> file, const YAML::Node& node, std::string path, std::string key, std::string branch);
  std::string label() const;
  std::string with_branch(std::string text) const;
  YamlValue child(const YAML::Node& node, const std::string& path, const std::string& key) const;

  std::shared_ptr<File> file_;
  YAML::Node node_;
  std::string path_, key_, branch_;
  int line_ = 0;
};

// "is not known" and the like end with what is: names joined with commas.
std::string joined(const std::vector<std::string>& names);
// A text of an entry that stands for one per branch, for this branch; as it is where that is empty.
std::string with_branch(std::string text, const std::string& branch);
// A name as name() demands it.
bool is_name(const std::string& text);

}  // namespace faultline
