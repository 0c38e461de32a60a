// Where the driver's LCM messages come from, read in a thread of its own so that ROS callbacks never wait for it.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>

namespace faultline {

// The url with a receive buffer for UDP, unless it has one: 4 MiB, or `allowed` bytes where the system allows less (0:
// unknown, no change). The system's default holds about 280 small datagrams, which a busy machine overruns when it lets
// the driver wait for 0.3 s. Empty: LCM's default url.
std::string with_receive_buffer(const std::string& url, long allowed);

class LcmSource {
 public:
  using Take = std::function<void(const std::string& channel, const void* data, int size, double arrival)>;
  using Idle = std::function<void(double now)>;

  ~LcmSource();  // stops and joins

  // Listens to NAME.sample and to all descriptions on an LCM network, of which there is one a second: a rig that goes
  // by another name than was thought is found by its description. Throws InputError if it cannot be opened. `idle` is
  // called when nothing came for 0.1 s.
  void listen(const std::string& url, const std::string& name, Take take, Idle idle);
  // Plays a log, `rate` times as fast as it was recorded. Throws InputError if it is not an LCM log.
  void play(const std::string& path, double rate, Take take, Idle idle);

  bool ended() const { return ended_; }
  // Of a log that was played, after it ended: what was wrong with it, or why nothing came out of it; empty if nothing.
  const std::string& trouble() const { return trouble_; }

 private:
  std::thread thread_;
  std::atomic<bool> stop_{false}, ended_{false};
  std::string trouble_;
};

}  // namespace faultline
