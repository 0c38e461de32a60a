// The responses of a rig's model to faults (fault_responses.h) inside a stage: every sample is taken, and what was found last is told
// until the next judgement. That comes `latency` s after a stretch ended, whenever it is ready: a thread of its own works it out, so that
// samples are not held up, and live and offline say the same at the same sample. Its estimates have no state: quantities only (response_core.h).
// Settings: segment, segments, every, recent, memory, inflation, threshold (response_settings.h); latency [half of every].
#include "faultline/estimators/response_core.h"

#include <algorithm>
#include <future>
#include <memory>

#include "faultline/estimators/fault_responses.h"
#include "faultline/estimators/stage_core.h"

namespace faultline {
namespace {

ResponseSettings settings_of(const StageSpec& spec, double period) {
  ResponseSettings s = read_response_settings(spec.settings, period);
  s.refined_hypotheses = kRankedFirst;
  s.jobs = 2;
  return s;
}

class ResponseCore : public StageCore {
 public:
  ResponseCore(const Datasheet& sheet, const StageSpec& spec)
      : responses_(sheet, settings_of(spec, sheet.sample_period)) {
    const double every = spec.settings.number_or("every", ResponseSettings().every_s, sheet.sample_period, 1e6);
    latency_ = spec.settings.number_or("latency", 0.5 * every, 0, 1e6);
    for (const Channel& channel : sheet.channels)
      needed_.push_back(channel.role != Role::setpoint && !channel.ground_truth);
    quantities_ = {{"evidence", "1", 0, 0}, {"since", "s", 0, 0}, {"judged", "s", 0, 0}};
    for (const bool second : {false, true})
      for (int k = 0; k < (second ? kRankedSecond : kRankedFirst); ++k) {
        quantities_.push_back({ranked_name(second, k, "hypothesis"), "1", -1, 0});
        quantities_.push_back({ranked_name(second, k, "amplitude"), "1", 0, 0});
        quantities_.push_back({ranked_name(second, k, "evidence"), "1", 0, 0});
      }
  }

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override { return {}; }

  ~ResponseCore() override {
    if (work_.valid()) work_.wait();
  }

  void begin(const double*) override {
    if (work_.valid()) work_.get();
    responses_.reset();
    time_ = judged_ = since_ = 0;
    tell();
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override {
    bool good = steps == 1;
    for (std::size_t c = 0; c < needed_.size(); ++c) good = good && (!needed_[c] || status[c] == ChannelStatus::good);
    time_ += dt;
    news_ = false;
    if (responses_.collect(time_, channels, good)) {
      finish();
      ended_ = time_;
      work_ = std::async(std::launch::async, [this, stretch = std::shared_ptr<Recording>(responses_.take())] {
        responses_.judge(*stretch);
      });
    }
    if (work_.valid() && time_ >= ended_ + latency_) finish();
    return true;
  }

  bool news() const override { return news_; }

  void write(const double*, bool begun, Estimate& estimate) const override {
    estimate.state.clear();
    estimate.covariance.clear();
    estimate.innovation.clear();
    estimate.innovation_std.clear();
    estimate.normalised_innovation = 0;
    estimate.observed = begun ? 0 : 1;
    if (estimate.quantities.size() != quantities_.size()) estimate.quantities = quantities_;
    for (std::size_t i = 0; i < quantities_.size(); ++i) {
      estimate.quantities[i].value = quantities_[i].value;
      estimate.quantities[i].std = quantities_[i].std;
    }
    // As ages, so that they need no clock of their own.
    estimate.quantities[1].value = quantities_[3].value < 0 ? 0 : time_ - since_;
    estimate.quantities[2].value = time_ - judged_;
  }

 private:
  // Takes over what was worked out.
  void finish() {
    if (!work_.valid()) return;
    work_.get();
    judged_ = ended_;
    news_ = true;
    tell();
  }

  void tell() {
    since_ = responses_.since();
    quantities_[0].value = responses_.evidence();
    std::size_t at = 3;
    for (const bool second : {false, true}) {
      const std::vector<RankedFault>& ranked = second ? responses_.second() : responses_.first();
      for (std::size_t k = 0; k < static_cast<std::size_t>(second ? kRankedSecond : kRankedFirst); ++k, at += 3) {
        const bool there = k < ranked.size();
        quantities_[at].value = there ? static_cast<double>(ranked[k].hypothesis) : -1;
        quantities_[at + 1].value = there ? ranked[k].amplitude : 0;
        quantities_[at + 1].std = there ? ranked[k].std : 0;
        quantities_[at + 2].value = there ? ranked[k].evidence : 0;
      }
    }
  }

  FaultResponses responses_;  // the worker's while work_ is valid, but for collect() and take()
  std::future<void> work_;
  double latency_;
  bool news_ = false;
  double time_ = 0, judged_ = 0, ended_ = 0, since_ = 0;  // s since the stage began
  std::vector<bool> needed_;
  std::vector<Quantity> quantities_;
};

}  // namespace

bool is_fault_response(const std::string& type) { return type == "fault_response"; }

std::unique_ptr<StageCore> make_response_core(const Datasheet& sheet, const StageSpec& spec) {
  return std::make_unique<ResponseCore>(sheet, spec);
}

}  // namespace faultline
