#include "nodes/field_reader.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "nodes/python_script.h"

extern char** environ;

namespace faultline {
namespace {

constexpr std::int64_t kEpoch = 946684800'000'000'000;  // ns, 2000-01-01T00:00:00Z after 1970
constexpr std::size_t kRecord = 24;                     // bytes
constexpr std::size_t kBlock = 1 << 18;                 // bytes
constexpr std::int64_t kLongestText = 1 << 20;          // bytes
constexpr std::int64_t kError = -1, kEnd = -2, kNote = -3;

std::int64_t whole_number(const char* bytes) {
  std::int64_t number = 0;
  std::memcpy(&number, bytes, sizeof number);
  return number;
}

}  // namespace

double seconds_of_stamp(std::int64_t stamp) { return static_cast<double>(stamp - kEpoch) * 1e-9; }

std::int64_t stamp_of_seconds(double seconds) { return kEpoch + std::llround(seconds * 1e9); }

FieldReader::FieldReader(const std::string& script, const std::string& request, std::size_t fields)
    : script_(find_script(script)), fields_(fields) {
  // A socket, because a pipe whose reader is gone would end this process.
  int in[2] = {-1, -1}, out[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, in) != 0 || ::pipe2(out, O_CLOEXEC) != 0) {
    const std::string why = std::strerror(errno);
    for (const int end : {in[0], in[1]})
      if (end >= 0) ::close(end);
    throw InputError(fmt::format("{}: no pipe for it ({})", script_, why));
  }
  in_ = in[0];
  out_ = out[0];
  std::vector<std::string> words = {python_interpreter(), script_};
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, in[1], STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  // A process group of its own: Ctrl-C is for this process, which then ends the script.
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  const int failure = ::posix_spawnp(&child_, pointers.front(), &actions, &attributes, pointers.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(in[1]);
  ::close(out[1]);
  if (failure != 0) {
    child_ = 0;
    ::close(in_);
    ::close(out_);
    throw InputError(fmt::format("{} cannot be run ({}); install python3 and python3-rosbag", words.front(),
                                 std::strerror(failure)));
  }
  const std::string line = request + "\n";
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t n = ::send(in_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) break;  // it is gone, and next() will tell
    sent += static_cast<std::size_t>(n);
  }
}

FieldReader::~FieldReader() {
  ::close(in_);
  ::close(out_);
  ::kill(child_, SIGTERM);
  while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) continue;
}

bool FieldReader::fill(int patience) {
  pollfd watched = {out_, POLLIN, 0};
  const int ready = ::poll(&watched, 1, patience);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return false;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
  const std::size_t before = buffer_.size();
  buffer_.resize(before + kBlock);
  const ssize_t n = ::read(out_, buffer_.data() + before, kBlock);
  buffer_.resize(before + static_cast<std::size_t>(n > 0 ? n : 0));
  if (n <= 0)
    throw InputError(fmt::format("{} ended without an answer; run it by hand to see why: {} {} < /dev/null", script_,
                                 python_interpreter(), script_));
  return true;
}

FieldRecord FieldReader::next(int patience) {
  FieldRecord record;
  while (buffer_.size() - at_ < kRecord)
    if (!fill(patience)) return record;
  const std::int64_t field = whole_number(buffer_.data() + at_), number = whole_number(buffer_.data() + at_ + 8);
  if (field >= 0 && static_cast<std::size_t>(field) < fields_) {
    record.kind = FieldRecord::Kind::value;
    record.field = static_cast<std::size_t>(field);
    record.stamp = number;
    std::memcpy(&record.value, buffer_.data() + at_ + 16, sizeof record.value);
    at_ += kRecord;
    return record;
  }
  if (field >= 0 || field < kNote || number < 0 || number > kLongestText)
    throw InputError(fmt::format("{}: its answer makes no sense; install faultline again", script_));
  const auto length = static_cast<std::size_t>(number);
  while (buffer_.size() - at_ < kRecord + length)
    if (!fill(patience)) return record;
  record.text.assign(buffer_.data() + at_ + kRecord, length);
  at_ += kRecord + length;
  if (field == kError) throw InputError(printable(record.text));
  record.kind = field == kEnd ? FieldRecord::Kind::end : FieldRecord::Kind::note;
  return record;
}

}  // namespace faultline
