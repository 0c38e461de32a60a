#include "nodes/lcm_source.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <lcm/lcm-cpp.hpp>

#include "faultline/signal/error.h"
#include "nodes/lcm_log.h"
#include "nodes/lcm_name.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr int kIdle = 100;                                         // ms
constexpr long kReceiveBuffer = 4194304;                           // bytes
constexpr char kDefaultUrl[] = "udpm://239.255.76.67:7667?ttl=0";  // LCM's own

struct Handler {
  LcmSource::Take take;
  void handle(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    take(channel, buffer->data, static_cast<int>(buffer->data_size), steady_seconds());
  }
};

// As a regular expression that means nothing but the text itself.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '.') result += '\\';
    result += c;
  }
  return result;
}

}  // namespace

std::string with_receive_buffer(const std::string& url, long allowed) {
  std::string whole = url;
  if (whole.empty()) {
    const char* chosen = std::getenv("LCM_DEFAULT_URL");
    whole = chosen && *chosen ? chosen : kDefaultUrl;
  }
  if (whole.rfind("udpm:", 0) != 0 || whole.find("recv_buf_size=") != std::string::npos || allowed <= 0) return whole;
  return fmt::format("{}{}recv_buf_size={}", whole, whole.find('?') == std::string::npos ? "?" : "&",
                     std::min(allowed, kReceiveBuffer));
}

LcmSource::~LcmSource() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void LcmSource::listen(const std::string& url, const std::string& name, Take take, Idle idle) {
  long allowed = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> allowed;  // stays 0 where there is none
  auto link = std::make_shared<lcm::LCM>(with_receive_buffer(url, allowed));
  if (!link->good())
    throw InputError(
        fmt::format("parameter ~lcm_url: LCM cannot open '{}'; udpm://ADDRESS:PORT?ttl=N, file://PATH or memq:// is "
                    "allowed, and udpm needs a multicast route",
                    url));
  auto handler = std::make_shared<Handler>(Handler{std::move(take)});
  for (const std::string& pattern : {escaped(lcm_channel(name, "sample")), std::string(".*\\.description")})
    link->subscribe(pattern, &Handler::handle, handler.get())->setQueueCapacity(static_cast<int>(kQueue));
  thread_ = std::thread([this, link, handler, idle = std::move(idle)] {
    while (!stop_) {
      const int handled = link->handleTimeout(kIdle);
      if (handled < 0) {
        trouble_ = "the LCM link ended";
        break;
      }
      if (handled == 0) idle(steady_seconds());
    }
    ended_ = true;
  });
}

void LcmSource::play(const std::string& path, double rate, Take take, Idle idle) {
  auto log = std::make_shared<LcmLog>(path);
  thread_ = std::thread([this, log, rate, take = std::move(take), idle = std::move(idle)] {
    LcmEvent event;
    double log_time = 0, wall_time = 0, last = 0;
    bool running = false;
    while (!stop_ && log->next(event)) {
      // The log's clock may have been set while it was written: it is followed forwards only, and never over more than
      // a day.
      if (!running || event.arrival < last || event.arrival > last + 86400) {
        running = true;
        log_time = event.arrival;
        wall_time = steady_seconds();
      }
      last = event.arrival;
      const double due = wall_time + (event.arrival - log_time) / rate;
      for (double left = due - steady_seconds(); left > 0 && !stop_; left = due - steady_seconds())
        std::this_thread::sleep_for(std::chrono::duration<double>(std::min(left, 0.1)));
      take(event.channel, event.data.data(), static_cast<int>(event.data.size()), event.arrival);
    }
    idle(last + 1e9);  // whatever still waits for a description need not wait longer
    trouble_ = log->trouble();
    ended_ = true;
  });
}

}  // namespace faultline
