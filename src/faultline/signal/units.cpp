#include "faultline/signal/units.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <map>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kLargestPower = 9;
constexpr int kDeepest = 20;  // nested brackets

struct Symbol {
  Unit unit;
  bool prefixed;  // takes SI prefixes
};

//                                     m  kg   s   A  K rad
const std::map<std::string, Symbol>& symbols() {
  static const std::map<std::string, Symbol> table = {
      {"m", {{{1, 0, 0, 0, 0, 0}, 1, 0}, true}},
      {"g", {{{0, 1, 0, 0, 0, 0}, 1e-3, 0}, true}},
      {"s", {{{0, 0, 1, 0, 0, 0}, 1, 0}, true}},
      {"A", {{{0, 0, 0, 1, 0, 0}, 1, 0}, true}},
      {"K", {{{0, 0, 0, 0, 1, 0}, 1, 0}, true}},
      {"rad", {{{0, 0, 0, 0, 0, 1}, 1, 0}, true}},
      {"N", {{{1, 1, -2, 0, 0, 0}, 1, 0}, true}},
      {"Pa", {{{-1, 1, -2, 0, 0, 0}, 1, 0}, true}},
      {"J", {{{2, 1, -2, 0, 0, 0}, 1, 0}, true}},
      {"W", {{{2, 1, -3, 0, 0, 0}, 1, 0}, true}},
      {"V", {{{2, 1, -3, -1, 0, 0}, 1, 0}, true}},
      {"Hz", {{{0, 0, -1, 0, 0, 0}, 1, 0}, true}},
      {"l", {{{3, 0, 0, 0, 0, 0}, 1e-3, 0}, true}},
      {"L", {{{3, 0, 0, 0, 0, 0}, 1e-3, 0}, true}},
      {"bar", {{{-1, 1, -2, 0, 0, 0}, 1e5, 0}, true}},
      {"t", {{{0, 1, 0, 0, 0, 0}, 1e3, 0}, false}},
      {"min", {{{0, 0, 1, 0, 0, 0}, 60, 0}, false}},
      {"h", {{{0, 0, 1, 0, 0, 0}, 3600, 0}, false}},
      {"deg", {{{0, 0, 0, 0, 0, 1}, kPi / 180, 0}, false}},
      {"rev", {{{0, 0, 0, 0, 0, 1}, 2 * kPi, 0}, false}},
      {"rpm", {{{0, 0, -1, 0, 0, 1}, kPi / 30, 0}, false}},
      {"degC", {{{0, 0, 0, 0, 1, 0}, 1, 273.15}, false}},
      {"degF", {{{0, 0, 0, 0, 1, 0}, 5.0 / 9, 459.67 * 5 / 9}, false}},
      {"atm", {{{-1, 1, -2, 0, 0, 0}, 101325, 0}, false}},
      {"psi", {{{-1, 1, -2, 0, 0, 0}, 6894.757293168361, 0}, false}},
      {"lbf", {{{1, 1, -2, 0, 0, 0}, 4.4482216152605, 0}, false}},
      {"inch", {{{1, 0, 0, 0, 0, 0}, 0.0254, 0}, false}},
      {"ft", {{{1, 0, 0, 0, 0, 0}, 0.3048, 0}, false}},
      {"gal", {{{3, 0, 0, 0, 0, 0}, 3.785411784e-3, 0}, false}},
      {"gpm", {{{3, 0, -1, 0, 0, 0}, 3.785411784e-3 / 60, 0}, false}},
      {"lpm", {{{3, 0, -1, 0, 0, 0}, 1e-3 / 60, 0}, false}},
      {"%", {{{0, 0, 0, 0, 0, 0}, 1e-2, 0}, false}},
  };
  return table;
}

const std::map<std::string, double>& prefixes() {
  static const std::map<std::string, double> table = {{"n", 1e-9}, {"u", 1e-6}, {"\xC2\xB5", 1e-6}, {"m", 1e-3},
                                                      {"c", 1e-2}, {"d", 1e-1}, {"h", 1e2},         {"k", 1e3},
                                                      {"M", 1e6},  {"G", 1e9}};
  return table;
}

// Recursive descent: product := power {(' ' | '*' | '/') power};
// power := ('(' product ')' | 'sqrt(' product ')' | symbol | '1') ['^' number]
class Parser {
 public:
  explicit Parser(const std::string& text) : text_(text) {}

  Unit whole() {
    skip_spaces();
    if (place_ == text_.size()) fail("it is empty; write 1 for a plain number");
    const Unit unit = product(0);
    if (place_ != text_.size()) fail(fmt::format("'{}' is not expected", text_.substr(place_)));
    return unit;
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw InputError(fmt::format("unit '{}': {}; write it like m/s, kPa, l/min, degC or 1", text_, why));
  }
  void skip_spaces() {
    while (place_ < text_.size() && text_[place_] == ' ') ++place_;
  }
  char next() {
    skip_spaces();
    return place_ < text_.size() ? text_[place_] : '\0';
  }

  Unit product(int depth) {
    if (depth > kDeepest) fail("there are too many brackets");
    Unit result = power(depth);
    for (char c = next(); c != '\0' && c != ')'; c = next()) {
      if (c == '/' || c == '*') ++place_;
      const Unit factor = power(depth);
      if (result.offset != 0 || factor.offset != 0) fail("a temperature scale cannot be part of another unit; take K");
      result = times(result, factor, c == '/' ? -1 : 1);
    }
    return result;
  }

  Unit power(int depth) {
    Unit base;
    const char c = next();
    const bool root = text_.compare(place_, 5, "sqrt(") == 0;
    if (c == '(' || root) {
      place_ += root ? 5 : 1;
      base = product(depth + 1);
      if (next() != ')') fail("a bracket is not closed");
      ++place_;
      if (root && base.offset != 0) fail("a temperature scale cannot be part of another unit; take K");
      if (root) base = times(Unit(), base, 0.5);
    } else {
      base = symbol();
    }
    if (next() != '^') return base;
    ++place_;
    if (base.offset != 0) fail("a temperature scale cannot be part of another unit; take K");
    const char* begin = text_.c_str() + place_;
    const bool number = std::isdigit(static_cast<unsigned char>(*begin)) ||
                        (*begin == '-' && std::isdigit(static_cast<unsigned char>(begin[1])));
    char* end = nullptr;
    const double exponent = number ? std::strtod(begin, &end) : 0;
    if (!number || std::abs(exponent) > kLargestPower) fail("a power must be a number up to 9");
    place_ += static_cast<std::size_t>(end - begin);
    return times(Unit(), base, exponent);
  }

  Unit symbol() {
    const std::size_t begin = place_;
    while (place_ < text_.size() && std::string("/*^() ").find(text_[place_]) == std::string::npos) ++place_;
    std::string name = text_.substr(begin, place_ - begin);
    if (name.empty()) fail("a symbol is missing");
    if (name == "1" || name == "-") return Unit();
    if (name == "\xC2\xB0") name = "deg";
    if (name ==
        "\xC2\xB0"
        "C")
      name = "degC";
    const auto found = symbols().find(name);
    if (found != symbols().end()) return found->second.unit;
    for (const auto& prefix : prefixes()) {
      if (name.compare(0, prefix.first.size(), prefix.first) != 0) continue;
      const auto rest = symbols().find(name.substr(prefix.first.size()));
      if (rest == symbols().end() || !rest->second.prefixed) continue;
      Unit unit = rest->second.unit;
      unit.scale *= prefix.second;
      return unit;
    }
    std::string known;
    for (const auto& entry : symbols()) known += (known.empty() ? "" : " ") + entry.first;
    fail(fmt::format("'{}' is not known; known are {} and the usual prefixes", name, known));
  }

  static Unit times(const Unit& a, const Unit& b, double exponent) {
    Unit result;
    for (std::size_t i = 0; i < a.dimension.size(); ++i)
      result.dimension[i] = a.dimension[i] + exponent * b.dimension[i];
    if (exponent == 1 || exponent == -1) {
      result.scale = exponent == 1 ? a.scale * b.scale : a.scale / b.scale;
      if (exponent == 1 && a.scale == 1) result.offset = b.offset;
    } else {
      result.scale = a.scale * std::pow(b.scale, exponent);
    }
    return result;
  }

  const std::string& text_;
  std::size_t place_ = 0;
};

}  // namespace

Unit parse_unit(const std::string& text) { return Parser(text).whole(); }

bool is_si(const Unit& unit) { return unit.offset == 0 && std::abs(unit.scale - 1) < 1e-12; }

Conversion conversion(const std::string& from, const std::string& to) {
  if (from == to) return {};
  const Unit a = parse_unit(from), b = parse_unit(to);
  if (a.dimension != b.dimension)
    throw InputError(fmt::format("unit '{}' cannot be converted to '{}': they measure different things", from, to));
  return {a.scale / b.scale, (a.offset - b.offset) / b.scale};
}

}  // namespace faultline
