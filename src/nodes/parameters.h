// Private parameters of a node, read strictly: a key that nobody asked for, a missing one, a wrong type or a value out
// of range is an InputError of one line that names the key, the node and what is allowed. Nothing is repaired silently.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include <XmlRpcValue.h>

namespace faultline {

class Parameters {
 public:
  Parameters();                                              // those of this process's node
  Parameters(std::string node, XmlRpc::XmlRpcValue values);  // for tests: a struct of values, or an empty value

  std::string word(const std::string& key);                               // must be given
  std::string word(const std::string& key, const std::string& fallback);  // any text
  std::string choice(const std::string& key, const std::string& fallback, const std::vector<std::string>& allowed);
  double number(const std::string& key, double fallback, double minimum, double maximum);
  std::int64_t integer(const std::string& key, std::int64_t fallback, std::int64_t minimum, std::int64_t maximum);
  bool flag(const std::string& key, bool fallback);
  std::vector<std::string> words(const std::string& key);  // a list, or one text with ';' between; absent: none
  std::string bytes(const std::string& key);               // binary data; absent: none
  bool has(const std::string& key) const;

  void check_used() const;  // InputError if a key was given that nobody asked for

 private:
  const XmlRpc::XmlRpcValue* find(const std::string& key);
  [[noreturn]] void refuse(const std::string& key, const std::string& what) const;

  std::string node_;
  XmlRpc::XmlRpcValue values_;
  std::set<std::string> asked_;
};

}  // namespace faultline
