#include "faultline/rig/yaml_reader.h"

#include <fmt/format.h>
#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr const char* kBranch = "{b}";
constexpr std::uintmax_t kLargestFile = 4u << 20;  // bytes; a datasheet of many hundred channels has 0.2 MB

std::string kind_of(const YAML::Node& node) {
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list";
  if (!node.IsScalar()) return "empty";
  return "'" + node.Scalar() + "'";
}

std::string one_line(std::string text) {
  for (char& c : text)
    if (c == '\n' || c == '\r' || c == '\t') c = ' ';
  return text;
}

std::string read_file(const std::string& file, const std::string& kind) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error))
    throw InputError(fmt::format("{}: there is no such file; give the path of a readable YAML file", file));
  if (std::filesystem::file_size(file, error) > kLargestFile)
    throw InputError(fmt::format("{}: the file is larger than {} MB: that is no {}; give one that is", file,
                                 kLargestFile >> 20, kind));
  std::ifstream stream(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(stream), {});
  if (!stream) throw InputError(fmt::format("{}: the file cannot be read; check its permissions", file));
  const std::size_t bad = invalid_utf8(text);
  if (bad != std::string::npos)
    throw InputError(fmt::format("{}:{}: the line holds bytes that are not UTF-8; save the file as UTF-8 text", file,
                                 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(bad), '\n')));
  return text;
}

struct DocumentStart : YAML::EventHandler {
  YAML::Mark mark;
  void OnDocumentStart(const YAML::Mark& at) override { mark = at; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

// The parser takes what cannot begin a document, as a comma, for an empty document and stays in front of it: asked for
// all documents (YAML::LoadAll) it never ends. It is asked for two.
void refuse_what_follows(const std::string& file, const std::string& kind, const std::string& example,
                         const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  DocumentStart start;
  if (!parser.HandleNextDocument(start) || !parser.HandleNextDocument(start)) return;
  std::size_t begin = 0;
  for (int line = 0; line < start.mark.line; ++line) begin = text.find('\n', begin) + 1;
  if (text.compare(begin, 3, "---") == 0)
    throw InputError(fmt::format("{}:{}: a second document starts here; one file is one {}, remove the line '---'",
                                 file, start.mark.line + 1, kind));
  throw InputError(
      fmt::format("{}:{}: this is not valid YAML: what stands here belongs to no key; a {} is a mapping of keys "
                  "to values, as in '{}'",
                  file, start.mark.line + 1, kind, example));
}

std::string range_text(double minimum, double maximum) {
  if (maximum >= YamlValue::kAny) return fmt::format("{:g} or more", minimum);
  if (minimum <= -YamlValue::kAny) return fmt::format("{:g} or less", maximum);
  return fmt::format("{:g} to {:g}", minimum, maximum);
}

}  // namespace

std::string joined(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all.empty() ? "none" : all;
}

bool is_name(const std::string& text) {
  return !text.empty() && text.front() >= 'a' && text.front() <= 'z' &&
         text.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
}

YamlValue::YamlValue(std::shared_ptr<File> file, const YAML::Node& node, std::string path, std::string key,
                     std::string branch)
    : file_(std::move(file)),
      node_(node),
      path_(std::move(path)),
      key_(std::move(key)),
      branch_(std::move(branch)),
      line_(node.Mark().line + 1) {}

YamlValue YamlValue::load(const std::string& file, const std::string& kind, const std::string& example) {
  const std::string text = read_file(file, kind);
  YAML::Node document;
  try {
    document = YAML::Load(text);
    refuse_what_follows(file, kind, example, text);
  } catch (const YAML::Exception& e) {
    throw InputError(fmt::format("{}:{}: this is not valid YAML: {}; correct the syntax there", file, e.mark.line + 1,
                                 one_line(e.msg)));
  }
  if (document.IsNull())
    throw InputError(fmt::format("{}: the file is empty; a {} starts with '{}'", file, kind, example));
  YamlValue root(std::make_shared<File>(File{file, kind, {}}), document, "", "", "");
  if (!document.IsMap()) root.fail(fmt::format("must be a mapping of keys to values, as in '{}'", example));
  return root;
}

void YamlValue::set_branches(std::vector<std::string> branches) { file_->branches = std::move(branches); }

std::string YamlValue::file() const { return file_->name; }

std::string YamlValue::place() const {
  return fmt::format("{}:{}: {}", file_->name, line_, path_.empty() ? "the " + file_->kind : "'" + path_ + "'");
}

void YamlValue::fail(const std::string& message) const { throw InputError(place() + " " + message); }

YamlValue YamlValue::child(const YAML::Node& node, const std::string& path, const std::string& key) const {
  YamlValue value(file_, node, path, key, branch_);
  if (value.line_ <= 0) value.line_ = line_;  // an empty value has no place of its own
  return value;
}

void YamlValue::allow(const std::vector<std::string>& required, const std::vector<std::string>& optional) const {
  const auto in = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  for (const YamlValue& entry : entries()) {
    if (in(required, entry.key_) || in(optional, entry.key_)) continue;
    std::vector<std::string> all = required;
    all.insert(all.end(), optional.begin(), optional.end());
    throw InputError(fmt::format("{}:{}: key '{}' in {} is not known; allowed are {}", file_->name, entry.line_,
                                 entry.key_, path_.empty() ? "the " + file_->kind : "'" + path_ + "'", joined(all)));
  }
  for (const std::string& key : required)
    if (!has(key)) fail(fmt::format("lacks the key '{}'; required are {}", key, joined(required)));
}

bool YamlValue::has(const std::string& key) const { return node_.IsMap() && node_[key].IsDefined(); }

YamlValue YamlValue::at(const std::string& key) const {
  if (!node_.IsMap()) fail(fmt::format("must be a mapping, it is {}", kind_of(node_)));
  if (!has(key)) fail(fmt::format("lacks the key '{}'", key));
  YamlValue value = child(node_[key], path_.empty() ? key : path_ + "." + key, key);
  for (const auto& pair : node_)
    if (pair.first.IsScalar() && pair.first.Scalar() == key) value.line_ = pair.first.Mark().line + 1;
  return value;
}

std::vector<YamlValue> YamlValue::entries() const {
  if (!node_.IsMap()) fail(fmt::format("must be a mapping, it is {}", kind_of(node_)));
  std::vector<YamlValue> all;
  std::set<std::string> seen;
  for (const auto& pair : node_) {
    if (!pair.first.IsScalar()) fail("has a key that is not a word");
    const std::string& key = pair.first.Scalar();
    YamlValue value = child(pair.second, path_.empty() ? key : path_ + "." + key, key);
    value.line_ = pair.first.Mark().line + 1;
    if (!seen.insert(key).second) value.fail(fmt::format("is given twice; remove one of the two keys '{}'", key));
    all.push_back(value);
  }
  return all;
}

std::vector<YamlValue> YamlValue::items() const {
  if (!node_.IsSequence()) fail(fmt::format("must be a list, it is {}", kind_of(node_)));
  std::vector<YamlValue> all;
  for (std::size_t i = 0; i < node_.size(); ++i) all.push_back(child(node_[i], fmt::format("{}[{}]", path_, i), ""));
  return all;
}

std::string with_branch(std::string text, const std::string& branch) {
  if (branch.empty()) return text;
  const std::string mark = kBranch;
  for (auto at = text.find(mark); at != std::string::npos; at = text.find(mark, at + branch.size()))
    text.replace(at, mark.size(), branch);
  return text;
}

std::string YamlValue::with_branch(std::string text) const { return faultline::with_branch(std::move(text), branch_); }

std::string YamlValue::text() const {
  if (!node_.IsScalar() || node_.Scalar().empty()) fail(fmt::format("must be text, it is {}", kind_of(node_)));
  return with_branch(node_.Scalar());
}

std::string YamlValue::name() const {
  const std::string word = text();
  if (!is_name(word))
    fail(fmt::format("is '{}'; a name is made of lower-case letters, digits and _, a letter first", one_line(word)));
  return word;
}

bool YamlValue::is_number() const {
  double value = 0;
  // The tag of a quoted scalar is "!": that is text, whatever it looks like.
  return node_.IsScalar() && node_.Tag() != "!" && YAML::convert<double>::decode(node_, value);
}

double YamlValue::bound() const {
  if (node_.IsMap() && !branch_.empty()) {
    allow(file_->branches, {});
    return at(branch_).bound();
  }
  if (!is_number()) {
    const bool is_text = node_.IsScalar() && !node_.Scalar().empty();
    fail(fmt::format("must be a number, it is {}{}", one_line(kind_of(node_)), is_text ? ", which is text" : ""));
  }
  const double value = node_.as<double>();
  if (std::isnan(value)) fail("must be a number, it is NaN");
  return value;
}

double YamlValue::number(double minimum, double maximum) const {
  const double value = bound();
  if (std::isinf(value)) fail("must be a finite number, it is infinite");
  if (value < minimum || value > maximum)
    fail(fmt::format("is {:g}, which is out of range; allowed is {}", value, range_text(minimum, maximum)));
  return value;
}

std::vector<double> YamlValue::numbers() const {
  std::vector<double> all;
  for (const YamlValue& item : items()) all.push_back(item.number());
  return all;
}

bool YamlValue::truth() const {
  bool value = false;
  if (!node_.IsScalar() || !YAML::convert<bool>::decode(node_, value))
    fail(fmt::format("must be true or false, it is {}", one_line(kind_of(node_))));
  return value;
}

std::string YamlValue::label() const { return has("name") ? at("name").text() : key_; }

std::vector<YamlValue> YamlValue::expanded(const std::vector<YamlValue>& values) {
  const auto branched = [](const YamlValue& value) { return value.label().find(kBranch) != std::string::npos; };
  std::vector<YamlValue> all;
  for (auto first = values.begin(); first != values.end();) {
    if (!branched(*first)) {
      all.push_back(*first++);
      continue;
    }
    if (first->file_->branches.empty())
      first->fail(
          fmt::format("is named '{}', but the datasheet has no 'branches: [...]' for {}", first->label(), kBranch));
    auto last = first;
    while (last != values.end() && branched(*last)) ++last;
    for (const std::string& branch : first->file_->branches)
      for (auto value = first; value != last; ++value) {
        YamlValue copy = *value;
        copy.branch_ = branch;
        copy.key_ = copy.with_branch(copy.key_);
        all.push_back(copy);
      }
    first = last;
  }
  return all;
}

}  // namespace faultline
