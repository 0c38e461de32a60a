#include "nodes/gap_publisher.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <exception>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ros/ros.h>

#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/normal_gap.h"
#include "faultline/numerics/usable_cores.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kError = 3;   // times the normal limit, from which leaving it is an error and not a warning
constexpr int kNiceness = 10;  // of the worker: the diagnosis beside it comes first

double thread_seconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

faultline_msgs::Gap to_message(const LiveGapState& state, const std::string& rig) {
  faultline_msgs::Gap message;
  message.header.stamp = to_stamp(state.time);
  message.header.frame_id = rig;
  message.rig = rig;
  for (const LiveChannelGap& channel : state.channels) {
    message.channels.push_back(channel.channel);
    message.units.push_back(channel.unit);
    message.rms.push_back(channel.rms);
    message.noise.push_back(channel.noise);
    message.excess.push_back(channel.excess);
    message.smoothed.push_back(channel.smoothed);
    message.normal.push_back(channel.normal);
    message.out.push_back(channel.left);
  }
  message.segments = static_cast<std::uint32_t>(state.segments);
  message.judged = state.judged;
  message.left_normal = state.left;
  message.since = to_stamp(state.since);
  message.worst = state.worst;
  for (const LiveRegion& region : state.regions) {
    message.regions.push_back(region.name);
    message.region_enrichment.push_back(region.enrichment);
    message.region_share.push_back(region.share);
  }
  message.port = state.place.port;
  message.component = state.place.component;
  message.effect = state.place.effect;
  message.share = state.place.share;
  message.inseparable = state.place.inseparable;
  message.text = state.text;
  return message;
}

GapPublisher::GapPublisher(const Datasheet& sheet)
    : sheet_(sheet),
      input_(sheet, [this](const Sample& sample) { take(sample); }),
      health_(sheet.rig, "input", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }),
      gap_health_(sheet.rig, "gap", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell_gap(status); }) {
  gaps_ = node_.advertise<faultline_msgs::Gap>("gap", 100, true);
  if (sheet.normal_gap.empty())
    learning_ = true;
  else
    gap_.emplace(sheet, LiveGapSettings());
  worker_ = std::thread([this] { work(); });
}

GapPublisher::~GapPublisher() {
  {
    const std::lock_guard<std::mutex> lock(guard_);
    stop_ = true;
  }
  arrived_.notify_one();
  worker_.join();
}

void GapPublisher::start() { input_.start(); }

void GapPublisher::take(const Sample& sample) {
  {
    const std::lock_guard<std::mutex> lock(guard_);
    if (queue_.size() >= kQueue) {
      const auto half = static_cast<std::ptrdiff_t>(kQueue / 2);
      queue_.erase(queue_.begin(), queue_.begin() + half);
      dropped_ += static_cast<std::uint64_t>(half);
    }
    queue_.push_back(sample);
    if (queue_.size() < 50) return;  // the worker is woken a few times a second
  }
  arrived_.notify_one();
}

void GapPublisher::work() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)),
              kNiceness);  // of this thread alone; no matter if it fails
  if (!gap_ && !learn()) return;
  std::deque<Sample> taken;
  while (true) {
    {
      std::unique_lock<std::mutex> lock(guard_);
      arrived_.wait_for(lock, std::chrono::milliseconds(100), [this] { return stop_ || queue_.size() >= 50; });
      if (stop_) return;
      taken.swap(queue_);
    }
    for (const Sample& sample : taken) {
      judge(sample);
      const std::lock_guard<std::mutex> lock(guard_);
      if (stop_) return;
    }
    taken.clear();
  }
}

bool GapPublisher::learn() {
  ROS_INFO("%s: the datasheet has no normal_gap; learning it from %zu simulations within the tolerances",
           sheet_.rig.c_str(), normal_gap_simulations(sheet_));
  const auto progress = [this](std::size_t done) {
    const std::lock_guard<std::mutex> lock(guard_);
    learnt_ = std::max(learnt_, done);
    return !stop_;
  };
  try {
    const int jobs = usable_cores();
    Datasheet sheet = sheet_;
    sheet.normal_gap = simulated_normal_gap(sheet_, LiveGapSettings(), jobs, progress);
    gap_.emplace(sheet, LiveGapSettings());
  } catch (const std::exception& error) {
    const std::lock_guard<std::mutex> lock(guard_);
    refusal_ = error.what();
    ros::requestShutdown();
    return false;
  }
  const std::lock_guard<std::mutex> lock(guard_);
  learning_ = false;
  return !stop_;
}

void GapPublisher::judge(const Sample& sample) {
  std::string failure;
  bool complete = false;
  try {
    complete = gap_->process(sample);
  } catch (const std::exception& error) {
    failure = error.what();
    gap_->reset();
  }
  const std::lock_guard<std::mutex> lock(guard_);
  counts_ = gap_->counts();
  if (!failure.empty()) failure_ = failure;
  if (!complete) {
    if (gap_->state().channels.empty()) state_ = LiveGapState();  // begun anew
    return;
  }
  failure_.clear();
  state_ = gap_->state();
  work_seconds_ = thread_seconds();
  gaps_.publish(to_message(state_, sheet_.rig));
}

std::string GapPublisher::refusal() {
  const std::lock_guard<std::mutex> lock(guard_);
  return refusal_;
}

void GapPublisher::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  input_.tell(status);
  const std::lock_guard<std::mutex> lock(guard_);
  status.add("waiting for the worker", queue_.size());
  status.add("dropped before the worker", dropped_);
  status.add("segments", counts_.segments);
  status.add("cuts", counts_.cuts);
  status.add("restarts of the gap", counts_.restarts);
  status.add("places sought", counts_.located);
  status.add("processor seconds of the worker", fmt::format("{:.2f}", work_seconds_));
  if (dropped_ > told_dropped_)
    status.mergeSummary(DiagnosticStatus::WARN,
                        learning_ ? "learning the normal gap takes longer than samples can wait; some were dropped"
                                  : "the worker is too slow; samples were dropped and the gap was cut");
  told_dropped_ = dropped_;
  if (!failure_.empty()) status.mergeSummary(DiagnosticStatus::ERROR, failure_);
}

void GapPublisher::tell_gap(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(guard_);
  if (learning_) {
    status.summaryf(DiagnosticStatus::OK, "learning the normal gap from %zu simulations, %zu done",
                    normal_gap_simulations(sheet_), learnt_);
    return;
  }
  if (state_.channels.empty()) {
    status.summary(DiagnosticStatus::OK, "no segment yet");
    return;
  }
  status.summary(static_cast<unsigned char>(!state_.left            ? DiagnosticStatus::OK
                                            : state_.worst > kError ? DiagnosticStatus::ERROR
                                                                    : DiagnosticStatus::WARN),
                 state_.text);
  status.add("last sample [s]", fmt::format("{:.6f}", state_.time));
  if (state_.left) status.add("since [s]", fmt::format("{:.6f}", state_.since));
  for (const LiveChannelGap& channel : state_.channels)
    status.add(fmt::format("{}: excess (normal)", channel.channel),
               std::isnan(channel.normal) ? fmt::format("{:.3g} (not stated)", channel.smoothed)
                                          : fmt::format("{:.3g} ({:.3g})", channel.smoothed, channel.normal));
  for (const LiveRegion& region : state_.regions)
    status.add(region.name,
               fmt::format("{:.1f} times the mean, {:.0f} % of the samples", region.enrichment, 100 * region.share));
  if (!state_.place.port.empty()) {
    status.add("place", state_.place.port);
    status.add("effect that fits best there", state_.place.effect);
    status.add("explains [%]", fmt::format("{:.0f}", 100 * state_.place.share));
    status.add("not told apart from", fmt::format("{}", fmt::join(state_.place.inseparable, ", ")));
  }
}

}  // namespace faultline
