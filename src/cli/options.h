// What options of several subcommands have in common.
//
// Files: a subcommand declares with each option whether its file is read or written. check_files() then looks at all of
// them before the subcommand begins, so that an answer never takes the place of a recording or a datasheet, whatever
// the names are. Numbers: NaN, infinity, text behind a number and numbers out of range are refused.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace faultline {

CLI::Option* add_input(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning);
CLI::Option* add_input(CLI::App& app, const std::string& name, std::vector<std::string>& files,
                       const std::string& meaning);
CLI::Option* add_output(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning);
// Text, for which - is standard output.
CLI::Option* add_text_output(CLI::App& app, const std::string& name, std::string& file, const std::string& meaning);

// InputError where an option's value is empty, a file is read as two things or twice, an output is an input (also by a
// link, or one of the program's own datasheets), two outputs are one file, or an output cannot be written. To be called
// when all options are read; nothing is written.
void check_files(const CLI::App& app);

CLI::Validator number_between(double low, double high);
CLI::Validator whole_number(std::uint64_t low, std::uint64_t high);

}  // namespace faultline
