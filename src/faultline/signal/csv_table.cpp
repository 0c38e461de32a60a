#include "faultline/signal/csv_table.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr std::size_t kLooked = 1000;  // rows that tell the separator and the decimal sign
constexpr std::size_t kShownText = 40;
constexpr std::size_t kEncodingLooked = 4096;  // bytes
constexpr std::size_t kLongestNumber = 64;     // characters

bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// Whether the text is a number whose sign between whole and fraction is `decimal`, with that sign in it.
bool fraction_with(char decimal, const char* begin, const char* end) {
  if (begin < end && (*begin == '-' || *begin == '+')) ++begin;
  std::size_t digits = 0, signs = 0;
  for (; begin < end && *begin != 'e' && *begin != 'E'; ++begin) {
    if (*begin >= '0' && *begin <= '9')
      ++digits;
    else if (*begin == decimal)
      ++signs;
    else
      return false;
  }
  return digits > 0 && signs == 1;
}

}  // namespace

void CsvTable::fail(const std::string& message) const {
  throw InputError(fmt::format("{}:{}: {}", file_, line_, message));
}

CsvTable::CsvTable(const std::string& text, const std::string& file, const CsvDialect& dialect)
    : file_(file), dialect_(dialect), at_(text.c_str()), end_(at_ + text.size()) {
  check_encoding();
  if (end_ - at_ >= 3 && std::memcmp(at_, "\xEF\xBB\xBF", 3) == 0) at_ += 3;
  const char* begin = nullptr;
  const char* end = nullptr;
  const auto skip_to = [&](int wanted) {
    while (static_cast<int>(line_) + 1 < wanted && at_ < end_) {
      const void* found = std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_));
      at_ = found ? static_cast<const char*>(found) + 1 : end_;
      ++line_;
    }
  };
  if (dialect_.names_line > 0) skip_to(dialect_.names_line);
  if (dialect_.names_line != 0) {
    const bool named = next_line(begin, end);
    if (!named && dialect_.names_line > 0 && line_ > 0)
      throw InputError(
          fmt::format("{}: no names in line {} (names_line of the mapping) or below; the file has {} lines", file_,
                      dialect_.names_line, line_));
    if (!named)
      throw InputError(
          fmt::format("{}: the file is empty; the first line must name the columns, as in t,channel,...", file_));
    const std::size_t names_line = line_;
    see_dialect(begin, end);
    take(begin, end);
    for (const Cell& cell : cells_) names_.push_back(unquoted(cell));
    line_ = names_line;
  }
  if (dialect_.data_line > 0) skip_to(dialect_.data_line);
  if (dialect_.names_line == 0) {
    const char* const data = at_;
    const std::size_t before = line_;
    if (!next_line(begin, end)) throw InputError(fmt::format("{}: the file is empty", file_));
    at_ = data;
    line_ = before;
    see_dialect(begin, end);
    take(begin, end);
    for (std::size_t i = 0; i < cells_.size(); ++i) names_.push_back(std::to_string(i + 1));
  }
  if (names_.size() > 1 && names_.back().empty()) names_.pop_back();
}

// Encodings of text of which a byte is not a character, and lines that nothing here ends.
void CsvTable::check_encoding() const {
  const std::string_view text(at_, static_cast<std::size_t>(end_ - at_));
  const std::string_view head = text.substr(0, kEncodingLooked);
  if (head.substr(0, 2) == "\xFF\xFE" || head.substr(0, 2) == "\xFE\xFF" || head.find('\0') != head.npos)
    throw InputError(fmt::format("{}: the file is not text in UTF-8 (UTF-16, or no text); save it as UTF-8", file_));
  if (text.find('\r') != text.npos && text.find('\n') == text.npos)
    throw InputError(
        fmt::format("{}: its lines end with a carriage return alone; save it with line feeds (tr '\\r' '\\n')", file_));
}

// The next line that is neither empty nor a comment, trimmed.
bool CsvTable::next_line(const char*& begin, const char*& end) {
  while (at_ < end_) {
    ++line_;
    const void* found = std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_));
    begin = at_;
    end = found ? static_cast<const char*>(found) : end_;
    at_ = found ? end + 1 : end_;
    if (end > begin && end[-1] == '\r') --end;
    const char* first = begin;
    while (first < end && blank(*first)) ++first;
    if (first < end && *first != dialect_.comment) return true;
  }
  return false;
}

// What is wrong with the line; null: nothing.
const char* CsvTable::split(const char* begin, const char* end, char separator, std::vector<Cell>& cells) {
  cells.clear();
  for (;;) {
    while (begin < end && blank(*begin) && *begin != separator) ++begin;
    Cell cell{begin, end, false};
    const char* stop = nullptr;
    if (begin < end && *begin == '"') {
      const char* close = begin + 1;
      while (close < end && (*close != '"' || (close + 1 < end && close[1] == '"'))) close += *close == '"' ? 2 : 1;
      if (close >= end) return "a quote is opened and not closed in its line; close it, or remove it";
      cell = {begin + 1, close, true};
      stop = close + 1;
      while (stop < end && blank(*stop) && *stop != separator) ++stop;
      if (stop < end && *stop != separator)
        return "text follows a closing quote; write a quote inside quotes twice, as in \"5\"\" pipe\"";
      if (stop == end) stop = nullptr;
    } else {
      stop = std::find(begin, end, separator);
      cell.end = stop;
      if (stop == end) stop = nullptr;
      while (cell.end > cell.begin && blank(cell.end[-1])) --cell.end;
    }
    cells.push_back(cell);
    if (!stop) return nullptr;
    begin = stop + 1;
  }
}

void CsvTable::take(const char* begin, const char* end) {
  if (const char* problem = split(begin, end, dialect_.separator, cells_)) fail(problem);
}

// Looks ahead from the line of names, which is just read, and goes back behind it.
void CsvTable::see_dialect(const char* names_begin, const char* names_end) {
  const char* const at = at_;
  const std::size_t line = line_;
  const char* begin = nullptr;
  const char* end = nullptr;
  std::vector<Cell> cells;
  if (dialect_.separator == '\0') {
    dialect_.separator = ',';
    for (const char candidate : {';', '\t', ','}) {
      const bool whole = split(names_begin, names_end, candidate, cells) == nullptr;
      const std::size_t count = cells.size();
      bool fits = whole && count > 1;
      // Between names and data may stand lines of units and the like, which `data_line` skips.
      for (std::size_t row = 0; fits && row < kLooked && next_line(begin, end); ++row) {
        if (static_cast<int>(line_) < dialect_.data_line) continue;
        fits = split(begin, end, candidate, cells) == nullptr && cells.size() >= count;
      }
      at_ = at;
      line_ = line;
      if (!fits) continue;
      dialect_.separator = candidate;
      break;
    }
    // None fits every row: the line of names decides, and the row that does not fit will be told.
    const auto often = [&](char c) { return std::count(names_begin, names_end, c); };
    if (dialect_.separator == ',' && often(',') == 0) dialect_.separator = often(';') > 0 ? ';' : '\t';
  }
  if (dialect_.decimal == '\0') {
    dialect_.decimal = '.';
    std::string point, comma;
    for (std::size_t row = 0; row < kLooked && next_line(begin, end); ++row) {
      if (static_cast<int>(line_) < dialect_.data_line) continue;
      if (split(begin, end, dialect_.separator, cells) != nullptr) continue;
      for (const Cell& cell : cells) {
        if (comma.empty() && fraction_with(',', cell.begin, cell.end)) comma = unquoted(cell);
        if (point.empty() && fraction_with('.', cell.begin, cell.end)) point = unquoted(cell);
      }
    }
    at_ = at;
    line_ = line;
    if (!comma.empty() && !point.empty())
      throw InputError(fmt::format(
          "{}: there are numbers such as {} and such as {}; say in a mapping which sign is the decimal one, "
          "as in csv: {{decimal: \",\"}}",
          file_, printable(point), printable(comma)));
    if (!comma.empty()) dialect_.decimal = ',';
  }
}

bool CsvTable::next() {
  const char* begin = nullptr;
  const char* end = nullptr;
  if (!next_line(begin, end)) return false;
  take(begin, end);
  while (cells_.size() > names_.size() && cells_.back().begin == cells_.back().end) cells_.pop_back();
  if (cells_.size() != names_.size())
    fail(fmt::format("the line has {} cells, the header has {}", cells_.size(), names_.size()));
  return true;
}

bool CsvTable::empty(std::size_t column) const { return cells_[column].begin == cells_[column].end; }

std::string CsvTable::unquoted(const Cell& cell) {
  std::string text(cell.begin, cell.end);
  if (cell.quoted)
    for (std::size_t at = text.find("\"\""); at != std::string::npos; at = text.find("\"\"", at + 1)) text.erase(at, 1);
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::string CsvTable::text(std::size_t column) const { return unquoted(cells_[column]); }

std::string CsvTable::shown(std::size_t column) const { return printable(text(column).substr(0, kShownText)); }

double CsvTable::number(std::size_t column) const {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  const Cell& cell = cells_[column];
  if (cell.begin == cell.end) return kMissing;
  char digits[kLongestNumber + 1];
  const auto size = static_cast<std::size_t>(cell.end - cell.begin);
  bool good = size <= kLongestNumber;
  bool decimals = false;
  for (std::size_t i = 0; good && i < size; ++i) {
    char c = cell.begin[i];
    good = c != 'x' && c != 'X' && c != '(';  // hexadecimal and nan(...) are not numbers here
    if (c == '.' || c == ',') {
      good = good && c == dialect_.decimal && !decimals;
      decimals = true;
      c = '.';
    }
    digits[i] = c;
  }
  double value = kMissing;
  if (good) {
    digits[size] = '\0';
    char* end = nullptr;
    value = std::strtod(digits, &end);
    good = end == digits + size;
  }
  if (!good) {
    const bool comma = dialect_.decimal == '.' && fraction_with(',', cell.begin, cell.end);
    fail(fmt::format("column '{}': '{}' is not a number{}", printable(names_[column].substr(0, kShownText)),
                     shown(column),
                     comma ? "; if it has a decimal comma, say csv: {decimal: \",\"} in a mapping" : ""));
  }
  return std::isfinite(value) ? value : kMissing;
}

}  // namespace faultline
