// A table as a data acquisition, a spreadsheet or a data set writes it: one line of names, one line per row.
//
// Cells are separated by ; tab or , and numbers have a decimal point or comma; which, is seen from the first lines
// unless the dialect says. A cell may stand in double quotes, "" in it is a quote. A byte-order mark, CRLF, empty lines
// and comment lines are skipped. A last empty name, and empty cells behind the last name, are left out.
//   separator   the first of ; tab , that stands equally often in the line of names and in every line looked at
//   decimals    a comma where cells such as 3,5 are seen and none such as 3.5; both: InputError, the dialect must say
// Fails with InputError that names file and line: a row with another number of cells than names, a quote that does not
// close in its line, and where number() is asked for, text that is no number. Cells that hold line ends are not read.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace faultline {

struct CsvDialect {
  char separator = '\0';  // '\0': seen from the file
  char decimal = '\0';    // '.' or ','; '\0': seen from the file
  char comment = '#';
  // Lines as an editor counts them, from 1. names 0: there is none, columns are called 1, 2, 3, ...; -1: the first line
  // that is neither empty nor a comment. data -1: the next such line.
  int names_line = -1;
  int data_line = -1;
};

class CsvTable {
 public:
  // `text` and `file`, its name for messages, must outlive the table.
  CsvTable(const std::string& text, const std::string& file, const CsvDialect& dialect);

  const std::vector<std::string>& names() const { return names_; }
  const CsvDialect& dialect() const { return dialect_; }  // as given, or as seen

  bool next();                                 // the next row; false at the end
  bool empty(std::size_t column) const;        // of the row
  std::string text(std::size_t column) const;  // without quotes
  // NaN where the cell is empty or holds nan or inf.
  double number(std::size_t column) const;
  std::string shown(std::size_t column) const;               // what a message can show of a cell
  [[noreturn]] void fail(const std::string& message) const;  // names file and line

 private:
  struct Cell {
    const char* begin;
    const char* end;
    bool quoted;
  };
  void check_encoding() const;
  bool next_line(const char*& begin, const char*& end);
  static const char* split(const char* begin, const char* end, char separator, std::vector<Cell>& cells);
  void take(const char* begin, const char* end);
  void see_dialect(const char* names_begin, const char* names_end);
  static std::string unquoted(const Cell& cell);

  const std::string& file_;
  CsvDialect dialect_;
  const char* at_;
  const char* end_;
  std::size_t line_ = 0;
  std::vector<std::string> names_;
  std::vector<Cell> cells_;
};

}  // namespace faultline
