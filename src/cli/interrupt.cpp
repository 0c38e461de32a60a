#include "cli/interrupt.h"

#include <atomic>
#include <climits>
#include <csignal>
#include <cstring>

#include <unistd.h>

namespace faultline {
namespace {

// All that the handler touches: it may do only what POSIX calls async-signal-safe, which leaves no containers.
constexpr int kSlots = 32;
struct Slot {
  std::atomic<bool> used{false};
  char path[PATH_MAX] = {};
};
Slot slots[kSlots];
std::atomic<pid_t> child_process{0};
std::atomic<bool> ending{false};
char farewell[512] = {};

extern "C" void end_program(int number) {
  if (ending.exchange(true)) return;  // another thread is at it
  if (const pid_t child = child_process.load(); child > 0) ::kill(child, SIGTERM);
  for (int pass = 0; pass < 2; ++pass)  // a folder goes when what is in it has gone
    for (Slot& slot : slots)
      if (slot.used.load() && ::unlink(slot.path) != 0) ::rmdir(slot.path);
  if (number != SIGPIPE && ::write(STDERR_FILENO, farewell, std::strlen(farewell)) < 0) {
  }  // nobody is there to be told
  ::_exit(128 + number);
}

}  // namespace

void watch_interrupts(const std::string& name) { watch_interrupts(name, "nothing unfinished is left behind"); }

void watch_interrupts(const std::string& name, const std::string& left_behind) {
  std::string text = ::isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "";  // over a progress line
  text += "faultline" + (name.empty() ? name : " " + name) + ": interrupted; " + left_behind + "\n";
  std::strncpy(farewell, text.c_str(), sizeof farewell - 1);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) {
    struct sigaction before = {}, now = {};
    ::sigaction(number, nullptr, &before);
    if (before.sa_handler == SIG_IGN) continue;
    now.sa_handler = end_program;
    ::sigfillset(&now.sa_mask);
    ::sigaction(number, &now, nullptr);
  }
  std::signal(SIGXFSZ, SIG_IGN);  // a file that grows too large is a failed write, which is told
}

Unfinished::Unfinished(const std::string& path) : slot_(-1) {
  if (path.size() >= sizeof slots[0].path) return;
  for (int i = 0; i < kSlots; ++i) {
    if (slots[i].used.load()) continue;
    std::memcpy(slots[i].path, path.c_str(), path.size() + 1);
    slots[i].used.store(true);
    slot_ = i;
    return;
  }
}

Unfinished::~Unfinished() {
  if (slot_ >= 0) slots[slot_].used.store(false);
}

void watch_child(pid_t child) { child_process.store(child); }

}  // namespace faultline
