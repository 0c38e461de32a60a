#include "cli/interrupt.h"

#include <csignal>

namespace faultline {
namespace {

volatile std::sig_atomic_t received = 0;

extern "C" void take_signal(int number) {
  received = number;
  std::signal(number, SIG_DFL);
}

}  // namespace

void watch_interrupts() {
  std::signal(SIGINT, take_signal);
  std::signal(SIGTERM, take_signal);
}

void check_interrupt() {
  if (received != 0) throw Interrupted(received);
}

}  // namespace faultline
