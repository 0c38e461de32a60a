// The program `faultline`: finds the subcommand, runs it, and turns every failure into one line on stderr.
// Exit status: 0 the job ran, 2 bad usage or bad input, 130 Ctrl-C, 1 a fault of the program itself.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include "cli/interrupt.h"
#include "cli/subcommand.h"
#include "faultline/signal/error.h"

namespace {

int complain(const std::string& subcommand, std::string message, int status) {
  for (char& c : message)
    if (c == '\n' || c == '\r') c = ' ';
  std::fprintf(stderr, "faultline%s%s: %s\n", subcommand.empty() ? "" : " ", subcommand.c_str(), message.c_str());
  return status;
}

}  // namespace

int main(int count, char** arguments) {
  using namespace faultline;
  watch_interrupts();
  CLI::App app("faultline: fault diagnosis and sim-to-real gap diagnosis for fluid-power test rigs", "faultline");
  app.require_subcommand(1);
  app.footer("Example: faultline rigs --json rigs.json");
  std::string known;
  for (const Subcommand& subcommand : subcommands()) {
    CLI::App* sub = app.add_subcommand(subcommand.name, subcommand.meaning);
    sub->footer("Example: " + subcommand.example);
    subcommand.add(*sub);
    known += (known.empty() ? "" : ", ") + subcommand.name;
  }

  const std::string first = count > 1 ? arguments[1] : "";
  const bool is_known =
      std::any_of(subcommands().begin(), subcommands().end(), [&](const Subcommand& s) { return s.name == first; });
  const std::string name = is_known ? first : "";
  if (first.empty()) return complain("", "a subcommand is missing; there are " + known + "; see faultline --help", 2);
  if (!is_known && first[0] != '-')
    return complain("", "there is no subcommand '" + first + "'; there are " + known, 2);
  try {
    app.parse(count, arguments);
    if (std::fflush(stdout) != 0) return complain(name, "standard output cannot be written", 2);
    return 0;
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return complain(name, std::string(error.what()) + "; see faultline " + (name.empty() ? "" : name + " ") + "--help",
                    2);
  } catch (const InputError& error) {
    return complain(name, error.what(), 2);
  } catch (const Interrupted& interrupted) {
    return complain(name, "interrupted; nothing unfinished is left behind", 128 + interrupted.signal);
  } catch (const std::exception& error) {
    return complain(name, std::string("unexpected: ") + error.what(), 1);
  }
}
