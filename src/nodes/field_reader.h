// Numbers out of messages of any type, by a Python script of ours (scripts/message_fields.py): rosbag's and rospy's
// dynamic types know every message there is, and C++ has no such thing. The script is a child process; it gets a
// request in JSON and answers with records. It ends when this object does, or when this process does. Its standard
// error is closed: what it has to say comes as a record, in one line.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace faultline {

struct FieldRecord {
  enum class Kind { value, note, end, nothing } kind = Kind::nothing;  // nothing: the time ran out
  std::size_t field = 0;                                               // its place in the request's list of fields
  std::int64_t stamp = 0;                                              // ns since 1970
  double value = 0;
  std::string text;  // of a note
};

class FieldReader {
 public:
  // Starts scripts/`script` with `request`, one line. InputError where it is not there or does not start.
  FieldReader(const std::string& script, const std::string& request, std::size_t fields);
  ~FieldReader();
  FieldReader(const FieldReader&) = delete;
  FieldReader& operator=(const FieldReader&) = delete;

  pid_t child() const { return child_; }
  // The next record, after at most `patience` ms; -1: however long it takes. InputError: what the script refuses, or
  // that it ended without a word.
  FieldRecord next(int patience);

 private:
  bool fill(int patience);  // false: the time ran out; throws at the end of the stream

  std::string script_;
  std::size_t fields_;
  pid_t child_ = 0;
  int in_ = -1, out_ = -1;  // the script's standard input and output
  std::vector<char> buffer_;
  std::size_t at_ = 0;
};

// s since 2000-01-01T00:00:00Z, the zero of times in our bags, and back; good to 0.12 us.
double seconds_of_stamp(std::int64_t stamp);
std::int64_t stamp_of_seconds(double seconds);

}  // namespace faultline
