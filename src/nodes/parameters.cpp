#include "nodes/parameters.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

using XmlRpc::XmlRpcValue;

std::string shown(XmlRpcValue value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeString:
      return fmt::format("'{}'", static_cast<std::string&>(value));
    case XmlRpcValue::TypeInt:
      return fmt::format("{}", static_cast<int&>(value));
    case XmlRpcValue::TypeDouble:
      return fmt::format("{}", static_cast<double&>(value));
    case XmlRpcValue::TypeBoolean:
      return static_cast<bool&>(value) ? "true" : "false";
    case XmlRpcValue::TypeArray:
      return "a list";
    case XmlRpcValue::TypeStruct:
      return "a group of keys";
    default:
      return "something else";
  }
}

XmlRpcValue read_own() {
  XmlRpcValue values;
  ros::param::get(ros::this_node::getName(), values);
  return values;
}

}  // namespace

Parameters::Parameters() : Parameters(ros::this_node::getName(), read_own()) {}

Parameters::Parameters(std::string node, XmlRpcValue values) : node_(std::move(node)), values_(values) {
  if (values_.valid() && values_.getType() != XmlRpcValue::TypeStruct)
    throw InputError(fmt::format("{}: the node's parameters are {}, not keys with values", node_, shown(values_)));
  asked_.insert("diagnostic_period");  // read by diagnostic_updater
}

void Parameters::refuse(const std::string& key, const std::string& what) const {
  throw InputError(fmt::format("{}: parameter ~{} {}", node_, key, what));
}

const XmlRpcValue* Parameters::find(const std::string& key) {
  asked_.insert(key);
  if (!has(key)) return nullptr;
  return &values_[key];
}

bool Parameters::has(const std::string& key) const { return values_.valid() && values_.hasMember(key); }

std::string Parameters::word(const std::string& key) {
  const XmlRpcValue* value = find(key);
  if (value == nullptr) refuse(key, "is missing; it must be given");
  XmlRpcValue copy = *value;
  if (copy.getType() != XmlRpcValue::TypeString) refuse(key, fmt::format("is {}; text is allowed", shown(copy)));
  return static_cast<std::string&>(copy);
}

std::string Parameters::word(const std::string& key, const std::string& fallback) {
  return find(key) == nullptr ? fallback : word(key);
}

std::string Parameters::choice(const std::string& key, const std::string& fallback,
                               const std::vector<std::string>& allowed) {
  const std::string value = word(key, fallback);
  if (std::find(allowed.begin(), allowed.end(), value) == allowed.end())
    refuse(key, fmt::format("is '{}'; allowed: {}", value, fmt::join(allowed, ", ")));
  return value;
}

double Parameters::number(const std::string& key, double fallback, double minimum, double maximum) {
  const XmlRpcValue* value = find(key);
  if (value == nullptr) return fallback;
  XmlRpcValue copy = *value;
  double result = 0;
  if (copy.getType() == XmlRpcValue::TypeDouble)
    result = static_cast<double&>(copy);
  else if (copy.getType() == XmlRpcValue::TypeInt)
    result = static_cast<int&>(copy);
  else
    refuse(key, fmt::format("is {}; a number from {} to {} is allowed", shown(copy), minimum, maximum));
  if (!(result >= minimum && result <= maximum))
    refuse(key, fmt::format("is {}; {} to {} is allowed", result, minimum, maximum));
  return result;
}

std::int64_t Parameters::integer(const std::string& key, std::int64_t fallback, std::int64_t minimum,
                                 std::int64_t maximum) {
  const XmlRpcValue* value = find(key);
  if (value == nullptr) return fallback;
  XmlRpcValue copy = *value;
  if (copy.getType() != XmlRpcValue::TypeInt)
    refuse(key, fmt::format("is {}; a whole number from {} to {} is allowed", shown(copy), minimum, maximum));
  const std::int64_t result = static_cast<int&>(copy);
  if (result < minimum || result > maximum)
    refuse(key, fmt::format("is {}; {} to {} is allowed", result, minimum, maximum));
  return result;
}

bool Parameters::flag(const std::string& key, bool fallback) {
  const XmlRpcValue* value = find(key);
  if (value == nullptr) return fallback;
  XmlRpcValue copy = *value;
  if (copy.getType() != XmlRpcValue::TypeBoolean)
    refuse(key, fmt::format("is {}; true or false is allowed", shown(copy)));
  return static_cast<bool&>(copy);
}

std::vector<std::string> Parameters::words(const std::string& key) {
  std::vector<std::string> result;
  const XmlRpcValue* value = find(key);
  if (value == nullptr) return result;
  XmlRpcValue copy = *value;
  if (copy.getType() == XmlRpcValue::TypeArray) {
    for (int i = 0; i < copy.size(); ++i) {
      if (copy[i].getType() != XmlRpcValue::TypeString)
        refuse(key, fmt::format("holds {} at place {}; a list of texts is allowed", shown(copy[i]), i + 1));
      result.push_back(static_cast<std::string&>(copy[i]));
    }
    return result;
  }
  const std::string text = word(key);
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(';', begin), text.size());
    const std::size_t first = text.find_first_not_of(" \t\n", begin);
    if (first < end) result.push_back(text.substr(first, text.find_last_not_of(" \t\n", end - 1) - first + 1));
    begin = end + 1;
  }
  return result;
}

std::string Parameters::bytes(const std::string& key) {
  const XmlRpcValue* value = find(key);
  if (value == nullptr) return "";
  XmlRpcValue copy = *value;
  if (copy.getType() != XmlRpcValue::TypeBase64)
    refuse(key, fmt::format("is {}; binary data are allowed, which the node itself writes", shown(copy)));
  const XmlRpcValue::BinaryData& data = copy;
  return std::string(data.begin(), data.end());
}

void Parameters::check_used() const {
  if (!values_.valid()) return;
  std::vector<std::string> allowed(asked_.begin(), asked_.end());
  XmlRpcValue copy = values_;
  for (auto& entry : copy)
    if (asked_.count(entry.first) == 0)
      refuse(entry.first, fmt::format("is unknown; allowed: {}", fmt::join(allowed, ", ")));
}

}  // namespace faultline
