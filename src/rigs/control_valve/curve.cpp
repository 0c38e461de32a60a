#include "rigs/control_valve/curve.h"

#include <algorithm>
#include <functional>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

const std::vector<double>& column(const Datasheet& sheet, const std::string& table, const std::string& name) {
  for (const Lookup& lookup : sheet.tables) {
    if (lookup.name != table) continue;
    const auto found = lookup.columns.find(name);
    if (found != lookup.columns.end()) return found->second;
  }
  throw InputError(fmt::format("{}: 'tables' lacks the column '{}' of '{}', which the equations of {} ask for",
                               sheet.file, name, table, sheet.rig));
}

}  // namespace

Curve::Curve(const Datasheet& sheet, const std::string& table, const std::string& x, const std::string& y)
    : x_(column(sheet, table, x)), y_(column(sheet, table, y)), slope_(x_.size()) {
  if (x_.size() < 2 || x_.size() != y_.size() ||
      std::adjacent_find(x_.begin(), x_.end(), std::greater_equal<>()) != x_.end())
    throw InputError(fmt::format("{}: 'tables.{}': '{}' must rise, with as many values as '{}', two at least",
                                 sheet.file, table, x, y));
  for (std::size_t i = 0; i + 1 < x_.size(); ++i) slope_[i] = (y_[i + 1] - y_[i]) / (x_[i + 1] - x_[i]);
}

}  // namespace faultline
