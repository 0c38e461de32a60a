// A subcommand of the program `faultline`: one file each, which adds itself with FAULTLINE_SUBCOMMAND. Its function
// adds options to the CLI11 app it gets and returns the job, which runs when they are read and its files are checked
// (options.h). The job throws InputError for bad input; main.cpp turns that into one line on stderr and exit status 2.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "faultline/signal/registry.h"

namespace faultline {

struct Subcommand {
  static constexpr const char* kKind = "subcommand";
  std::string name;
  std::string meaning;  // one line
  std::string example;  // shown below the options by --help
  std::function<void()> (*add)(CLI::App& app);
};

inline const Registry<Subcommand>::Types& subcommands() { return registry<Subcommand>().all(); }  // sorted by name

}  // namespace faultline

#define FAULTLINE_SUBCOMMAND(name, ...) FAULTLINE_REGISTER(Subcommand, name, __VA_ARGS__)
