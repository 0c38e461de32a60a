// Reads an LCM log (lcm-logger's format) event by event and knows at the end whether it was whole. LCM's own reader
// gives the same answer for the end of a log and for one that was cut off; here the place of the last whole event tells
// them apart.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace lcm {
class LogFile;
}

namespace faultline {

struct LcmEvent {
  double arrival = 0;  // s, when the logger received it
  std::string channel;
  std::vector<unsigned char> data;
};

class LcmLog {
 public:
  explicit LcmLog(const std::string& path);  // throws InputError where there is no such file, or it holds no event
  ~LcmLog();

  bool next(LcmEvent& event);  // false at the end
  // After the end: one line that says where the log is cut off or damaged; empty where it is whole.
  std::string trouble() const;

 private:
  std::string path_;
  std::unique_ptr<lcm::LogFile> file_;
  std::uintmax_t size_ = 0, whole_ = 0;  // bytes: of the file, up to the end of the last whole event
  std::uintmax_t skipped_ = 0;           // bytes that belong to no event
  std::uint64_t events_ = 0;
};

}  // namespace faultline
