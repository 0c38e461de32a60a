#include "nodes/lcm_log.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>
#include <lcm/lcm-cpp.hpp>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::uintmax_t kEventHead = 28;  // bytes: sync word, number, time, length of channel, length of data
constexpr unsigned char kSync[4] = {0xED, 0xA1, 0xDA, 0x01};

// Whether the file begins as every LCM log does; LCM's reader would search a foreign file to its end.
bool begins_like_a_log(const std::string& path) {
  unsigned char head[4] = {};
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) return false;
  const std::size_t read = std::fread(head, 1, sizeof head, file);
  std::fclose(file);
  return read == sizeof head && std::equal(head, head + 4, kSync);
}

}  // namespace

LcmLog::LcmLog(const std::string& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    throw InputError(path + ": no such file; give an LCM log as lcm-logger writes it");
  size_ = std::filesystem::file_size(path, error);
  if (size_ == 0) throw InputError(path + ": empty; an LCM log holds at least one event");
  if (!begins_like_a_log(path))
    throw InputError(path + ": not readable or not an LCM log; give a file that lcm-logger wrote");
  file_ = std::make_unique<lcm::LogFile>(path, "r");
  if (!file_->good()) throw InputError(path + ": cannot be opened for reading; check its permissions");
}

LcmLog::~LcmLog() = default;

bool LcmLog::next(LcmEvent& event) {
  const lcm::LogEvent* read = file_->readNextEvent();
  if (read == nullptr) return false;
  event.arrival = static_cast<double>(read->timestamp) * 1e-6;
  event.channel = read->channel;
  const unsigned char* data = static_cast<const unsigned char*>(read->data);
  event.data.assign(data, data + read->datalen);
  ++events_;
  const std::uintmax_t length = kEventHead + read->channel.size() + static_cast<std::uintmax_t>(read->datalen);
  const std::uintmax_t end = static_cast<std::uintmax_t>(std::ftell(file_->getFilePtr()));
  skipped_ += end - whole_ - length;
  whole_ = end;
  return true;
}

std::string LcmLog::trouble() const {
  if (whole_ < size_)
    return fmt::format(
        "{}: cut off or damaged after event {}: {} of {} bytes could be read; all events before are used", path_,
        events_, whole_, size_);
  if (skipped_ > 0)
    return fmt::format("{}: damaged inside: {} bytes belong to no event; the rest is used", path_, skipped_);
  return "";
}

}  // namespace faultline
