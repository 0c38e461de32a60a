// The responses of a rig's model to faults (fault_responses.h) inside a stage: every sample is taken, and what was
// found last is told until the next judgement. While what was found is not confirmed, stretches follow one another
// without a pause, but for the first few. A judgement comes `latency` s after a stretch ended, whenever it is ready: a
// thread of its own works it out, so that samples are not held up, and live and offline say the same at the same
// sample. Its estimates hold a ranking only.
// Settings: segment [s], segments, every [s], early_every [s, every], recent, memory, inflation, threshold, confirmed,
// explained (response_settings.h); latency [s, half of every].
#include "faultline/estimators/response_core.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <memory>

#include "faultline/estimators/estimator.h"
#include "faultline/estimators/stretch_collector.h"
#include "faultline/numerics/usable_cores.h"

namespace faultline {
namespace {

constexpr const char* kFamily = "response";
constexpr std::size_t kRankedFirst = 6, kRankedSecond = 3;  // hypotheses that are told

class ResponseEstimator : public Estimator {
 public:
  ResponseEstimator(const Datasheet& sheet, const StageSpec& spec)
      : settings_(response_settings(sheet, spec)),
        latency_(spec.settings.number_or("latency", 0.5 * settings_.every_s, 0, 1e6)),
        collector_(sheet, settings_, latency_),
        responses_(sheet, settings_) {
    for (const Channel& channel : sheet.channels) {
      drives_.push_back(channel.role == Role::command || channel.role == Role::input);
      needed_.push_back(channel.role != Role::setpoint && !channel.ground_truth);
    }
    values_.resize(sheet.channels.size());
  }

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override { return {}; }

  ~ResponseEstimator() override {
    if (work_.valid()) work_.wait();
  }

  void begin(const double*) override {
    if (work_.valid()) work_.get();
    collector_.reset();
    responses_.reset();
    time_ = judged_ = 0;
    take_over();
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int) override {
    bool good = true;
    for (std::size_t c = 0; c < needed_.size(); ++c) {
      const bool fit = !needed_[c] || status[c] == ChannelStatus::good;
      good = good && (fit || !drives_[c]);
      values_[c] = fit ? channels[c] : std::nan("");
    }
    time_ += dt;
    news_ = false;
    if (work_.valid() && time_ >= ended_ + latency_) finish();
    if (std::shared_ptr<const Recording> stretch = collector_.add(time_, values_.data(), good)) {
      finish();
      ended_ = time_;
      work_ = std::async(std::launch::async, [this, stretch] { responses_.judge(*stretch); });
    }
    return true;
  }

  // Stretches stand for themselves and have no gaps: one costs the stretch that was begun. As long as earlier stretches
  // speak for the rig.
  double bridges() const override { return settings_.memory_stretches * settings_.every_s; }

  bool news() const override { return news_; }

  void write(const double*, bool begun, Estimate& estimate) const override {
    estimate.state.clear();
    estimate.covariance.clear();
    estimate.innovation.clear();
    estimate.innovation_std.clear();
    estimate.quantities.clear();
    estimate.normalised_innovation = 0;
    estimate.observed = begun ? 0 : 1;
    // Here only now and then; readers may keep it, so it is never written again.
    auto ranking = std::make_shared<Ranking>(ranking_);
    ranking->since = estimate.time - (ranking_.first.empty() && !lost_ ? 0 : time_ - ranking_.since);
    ranking->judged_until = estimate.time - (time_ - judged_);
    estimate.ranking = std::move(ranking);
  }

 private:
  void finish() {
    if (!work_.valid()) return;
    work_.get();
    judged_ = ended_;
    news_ = true;
    if (responses_.undecided()) judged_ = std::min(judged_, responses_.since());
    collector_.judged(responses_.hurries());
    take_over();
  }

  // What was worked out; the worker may then go on with the next stretch.
  void take_over() {
    ranking_.since = responses_.since();
    lost_ = responses_.lost();
    ranking_.threshold = settings_.threshold_evidence;
    ranking_.evidence = responses_.evidence();
    ranking_.shows = responses_.shows();
    ranking_.first = named(responses_.first(), kRankedFirst);
    ranking_.suspected = named(responses_.suspected(), kRankedFirst);
    ranking_.doubt = responses_.doubt();
    ranking_.stuck = responses_.stuck();
    ranking_.second = named(responses_.second(), kRankedSecond);
  }

  std::vector<RankedHypothesis> named(const std::vector<RankedFault>& ranked, std::size_t most) const {
    std::vector<RankedHypothesis> result;
    for (std::size_t k = 0; k < ranked.size() && k < most; ++k) {
      const FaultHypothesis& h = responses_.hypotheses()[ranked[k].hypothesis];
      RankedHypothesis one;
      one.effect = h.effect;
      one.port = h.port;
      one.kind = h.kind;
      one.size_name = h.size_name;
      one.size_unit = h.size_unit;
      one.order = static_cast<std::uint32_t>(ranked[k].hypothesis);
      one.none = h.none;
      one.full = h.full.parameters[h.parameter];
      one.lowest = h.lowest;
      one.amplitude = ranked[k].amplitude;
      one.std = ranked[k].std;
      one.evidence = ranked[k].evidence;
      result.push_back(std::move(one));
    }
    return result;
  }

  ResponseSettings settings_;
  double latency_;
  StretchCollector collector_;
  FaultResponses responses_;  // the worker's while work_ is valid, but for hypotheses()
  std::future<void> work_;
  bool news_ = false, lost_ = false;
  double time_ = 0, judged_ = 0, ended_ = 0;  // s since the stage began
  std::vector<bool> needed_, drives_;         // the model: commands and inputs
  std::vector<double> values_;
  Ranking ranking_;  // as found last; `since` in s since the stage began
};

FAULTLINE_ESTIMATOR(fault_response, {"fault_response", kFamily, true, make_estimator_of<ResponseEstimator>});

}  // namespace

ResponseSettings response_settings(const Datasheet& sheet, const StageSpec& spec) {
  ResponseSettings s = read_response_settings(spec.settings, sheet);
  s.refined_hypotheses = kRankedFirst;
  // On one core a second thread would only lead once more what goes beside one another.
  s.jobs = std::min(2, usable_cores());
  return s;
}

ResponseSettings response_settings(const Datasheet& sheet) {
  for (const StageSpec& stage : sheet.estimators)
    if (estimator_type(stage).family == kFamily) return response_settings(sheet, stage);
  return read_response_settings(Settings(), sheet);
}

}  // namespace faultline
