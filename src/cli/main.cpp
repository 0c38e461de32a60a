// The program `faultline`: finds the subcommand, runs it, and turns every failure into one line on stderr.
// Exit status: 0 the job ran, 2 bad usage, bad input or an output that cannot be written, 128 + signal interrupted, 1 a
// fault of the program itself.
#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <sstream>
#include <string>

#include "cli/interrupt.h"
#include "cli/options.h"
#include "cli/subcommand.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace {

// A program that is started without standard output would give its number to the first file that it opens, and print
// into that.
void open_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0 && ::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY) != stream)
      ::_exit(2);
}

// What one judgement frees the next asks for again, in a thread of its own. By default such blocks go back to the
// system each time, and threads that follow one another fill heaps of their own: a tenth of the time of `diagnose`.
void keep_freed_memory() {
  ::mallopt(M_ARENA_MAX, 1);
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);
  ::mallopt(M_TRIM_THRESHOLD, 256 << 20);
}

int complain(const std::string& subcommand, const std::string& message, int status) {
  std::fprintf(stderr, "faultline%s%s: %s\n", subcommand.empty() ? "" : " ", subcommand.c_str(),
               faultline::printable(message).c_str());
  return status;
}

int finish(const std::string& subcommand) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return 0;
  const std::string why = errno != 0 ? std::string(" (") + std::strerror(errno) + ")" : "";
  return complain(subcommand, "standard output cannot be written" + why, 2);
}

}  // namespace

int main(int count, char** arguments) {
  using namespace faultline;
  open_standard_streams();
  keep_freed_memory();
  CLI::App app("faultline: fault diagnosis and sim-to-real gap diagnosis for fluid-power test rigs", "faultline");
  app.require_subcommand(1);
  app.footer("Example: faultline rigs --json rigs.json");
  std::string known;
  for (const Subcommand& subcommand : subcommands()) {
    CLI::App* sub = app.add_subcommand(subcommand.name, subcommand.meaning);
    sub->footer("Example: " + subcommand.example);
    sub->callback([sub, job = subcommand.add(*sub)] {
      check_files(*sub);
      job();
    });
    known += (known.empty() ? "" : ", ") + subcommand.name;
  }

  const std::string first = count > 1 ? arguments[1] : "";
  const bool is_known =
      std::any_of(subcommands().begin(), subcommands().end(), [&](const Subcommand& s) { return s.name == first; });
  const std::string name = is_known ? first : "";
  watch_interrupts(name);
  if (first.empty()) return complain("", "a subcommand is missing; there are " + known + "; see faultline --help", 2);
  if (!is_known && first[0] != '-')
    return complain("", "there is no subcommand '" + first + "'; there are " + known, 2);
  try {
    app.parse(count, arguments);
    return finish(name);
  } catch (const CLI::Success& help) {
    std::ostringstream text;
    app.exit(help, text);
    std::fputs(text.str().c_str(), stdout);
    return finish(name);
  } catch (const CLI::ParseError& error) {
    return complain(name, std::string(error.what()) + "; see faultline " + (name.empty() ? "" : name + " ") + "--help",
                    2);
  } catch (const InputError& error) {
    return complain(name, error.what(), 2);
  } catch (const std::bad_alloc&) {
    return complain(name, "the memory is used up; give a shorter recording, or more memory", 2);
  } catch (const std::exception& error) {
    // A write to standard output that failed is the one exception that comes from there.
    if (std::ferror(stdout) != 0) return finish(name);
    return complain(name, std::string("unexpected: ") + error.what(), 1);
  }
}
