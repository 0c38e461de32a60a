// Ctrl-C and SIGTERM: long loops call check_interrupt(), which throws so that unfinished files are removed on the way out. A second
// Ctrl-C ends the program at once.
#pragma once

#include <exception>

namespace faultline {

struct Interrupted : std::exception {
  explicit Interrupted(int number) : signal(number) {}
  const char* what() const noexcept override { return "interrupted"; }
  int signal;
};

void watch_interrupts();
void check_interrupt();  // throws Interrupted

}  // namespace faultline
