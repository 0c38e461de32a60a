// Ctrl-C, SIGTERM and SIGHUP end the program at once, wherever it is: what it has begun to write is removed, one line
// on stderr says so, and the exit status is 128 + the signal. A reader of standard output that goes away (SIGPIPE) does
// the same in silence. A signal that was ignored when the program began (nohup, a background job of a script) stays
// ignored.
#pragma once

#include <string>

#include <sys/types.h>

namespace faultline {

// `name`: of the subcommand, for the line.
void watch_interrupts(const std::string& name);

// Another end of that line than "nothing unfinished is left behind".
void watch_interrupts(const std::string& name, const std::string& left_behind);

// A file or folder that is removed if the program is interrupted while this lives.
class Unfinished {
 public:
  explicit Unfinished(const std::string& path);
  ~Unfinished();
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

 private:
  int slot_;
};

// A child process that is asked to end (SIGTERM) if the program is interrupted; 0: there is none.
void watch_child(pid_t child);

}  // namespace faultline
