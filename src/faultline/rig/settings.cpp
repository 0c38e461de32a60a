// Settings of rig/datasheet.h: named numbers, lists of numbers and words, and who asked for which.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

void check_range(const std::string& where, const std::string& key, double value, double minimum, double maximum) {
  if (!std::isfinite(value))
    throw InputError(fmt::format("{}: '{}' must be a finite number, it is {}", where, key, value));
  if (value < minimum || value > maximum)
    throw InputError(fmt::format("{}: '{}' is {:g}, which is out of range; allowed is {:g} to {:g}", where, key, value,
                                 minimum, maximum));
}

// With a point and a sign in front of an exponent, so that readers of YAML 1.1 take it for a number too.
std::string yaml_number(double value) {
  std::string text = fmt::format("{:.9g}", value);
  const auto exponent = text.find('e');
  if (exponent != std::string::npos && text.find('.') == std::string::npos) text.insert(exponent, ".0");
  return text;
}

}  // namespace

Settings::Settings(std::string where, std::map<std::string, double> numbers,
                   std::map<std::string, std::vector<double>> lists, std::map<std::string, std::string> words)
    : where_(std::move(where)), numbers_(std::move(numbers)), lists_(std::move(lists)), words_(std::move(words)) {}

double Settings::number(const std::string& key, double minimum, double maximum) const {
  const auto found = numbers_.find(key);
  if (found == numbers_.end()) {
    if (has(key)) throw InputError(fmt::format("{}: '{}' must be a number; it is text or a list", where_, key));
    throw InputError(
        fmt::format("{}: the setting '{}' is missing; give a number of {:g} to {:g}", where_, key, minimum, maximum));
  }
  used_[key] = true;
  check_range(where_, key, found->second, minimum, maximum);
  return found->second;
}

double Settings::number_or(const std::string& key, double fallback, double minimum, double maximum) const {
  return has(key) ? number(key, minimum, maximum) : fallback;
}

std::vector<double> Settings::list(const std::string& key, std::size_t size, double minimum, double maximum) const {
  const auto found = lists_.find(key);
  if (found == lists_.end()) {
    if (has(key)) throw InputError(fmt::format("{}: '{}' must be a list of numbers, as in [1, 2]", where_, key));
    throw InputError(fmt::format("{}: the setting '{}' is missing; give a list of numbers, as in [1, 2]", where_, key));
  }
  used_[key] = true;
  if (size > 0 && found->second.size() != size)
    throw InputError(fmt::format("{}: '{}' must have {} numbers, it has {}", where_, key, size, found->second.size()));
  for (const double value : found->second) check_range(where_, key, value, minimum, maximum);
  return found->second;
}

std::string Settings::word(const std::string& key) const {
  const auto found = words_.find(key);
  if (found == words_.end()) {
    if (has(key)) throw InputError(fmt::format("{}: '{}' must be a word; it is a number or a list", where_, key));
    throw InputError(fmt::format("{}: the setting '{}' is missing; give a word", where_, key));
  }
  used_[key] = true;
  return found->second;
}

std::string Settings::word_or(const std::string& key, const std::string& fallback) const {
  return has(key) ? word(key) : fallback;
}

bool Settings::has(const std::string& key) const {
  return numbers_.count(key) > 0 || lists_.count(key) > 0 || words_.count(key) > 0;
}

void Settings::check_used() const {
  std::string allowed;
  for (const auto& used : used_) allowed += (allowed.empty() ? "" : ", ") + used.first;
  const auto refuse = [&](const std::string& key) {
    if (used_.count(key) == 0)
      throw InputError(
          fmt::format("{}: key '{}' is not known; read here are {}", where_, key, allowed.empty() ? "none" : allowed));
  };
  for (const auto& entry : numbers_) refuse(entry.first);
  for (const auto& entry : lists_) refuse(entry.first);
  for (const auto& entry : words_) refuse(entry.first);
}

void Settings::set(const std::string& key, double value) {
  lists_.erase(key);
  words_.erase(key);
  numbers_[key] = value;
}

void Settings::set(const std::string& key, const std::vector<double>& values) {
  numbers_.erase(key);
  words_.erase(key);
  lists_[key] = values;
}

void Settings::set(const std::string& key, const std::string& word) {
  numbers_.erase(key);
  lists_.erase(key);
  words_[key] = word;
}

std::vector<std::string> Settings::texts() const {
  std::vector<std::string> result;
  for (const auto& [key, word] : words_) result.push_back(fmt::format("{}: \"{}\"", key, word));
  for (const auto& [key, number] : numbers_) result.push_back(key + ": " + yaml_number(number));
  for (const auto& [key, list] : lists_) {
    std::string numbers;
    for (const double number : list) numbers += (numbers.empty() ? "" : ", ") + yaml_number(number);
    result.push_back(fmt::format("{}: [{}]", key, numbers));
  }
  std::sort(result.begin(), result.end());
  return result;
}

}  // namespace faultline
