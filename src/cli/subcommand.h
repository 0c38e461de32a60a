// A subcommand of the program `faultline`: one file each, which adds itself with FAULTLINE_SUBCOMMAND. Its function adds options to
// the CLI11 app it gets and returns the job, which runs when they are read and its files are checked (options.h). The job throws
// InputError for bad input; main.cpp turns that into one line on stderr and exit status 2.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace faultline {

struct Subcommand {
  std::string name;
  std::string meaning;  // one line
  std::string example;  // shown below the options by --help
  std::function<void()> (*add)(CLI::App& app);
};

const std::vector<Subcommand>& subcommands();  // sorted by name
bool register_subcommand(Subcommand subcommand);

}  // namespace faultline

#define FAULTLINE_SUBCOMMAND(name, ...) \
  const bool registered_subcommand_##name = ::faultline::register_subcommand(__VA_ARGS__)
