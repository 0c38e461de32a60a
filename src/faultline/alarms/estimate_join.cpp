#include "faultline/alarms/estimate_join.h"

#include <algorithm>

#include "faultline/estimators/estimator.h"

namespace faultline {

std::vector<bool> occasional_stages(const Datasheet& sheet) {
  std::vector<bool> occasional;
  for (const StageSpec& spec : sheet.estimators)
    occasional.push_back(!occasional.empty() && estimator_type(spec).occasional);
  return occasional;
}

EstimateJoin::EstimateJoin(std::vector<bool> occasional)
    : occasional_(std::move(occasional)), last_(occasional_.size()) {}

bool EstimateJoin::add(std::size_t stage, Estimate estimate, std::vector<Estimate>& set) {
  if (occasional_[stage]) {
    last_[stage] = std::move(estimate);
    return false;
  }
  auto found = std::find_if(waiting_.rbegin(), waiting_.rend(), [&](const Set& s) {
    return s.sequence == estimate.sequence && s.time == estimate.time && !s.there[stage];
  });
  if (found == waiting_.rend()) {
    Set fresh{estimate.sequence, estimate.time, std::vector<Estimate>(last_.size()), occasional_};
    waiting_.push_back(std::move(fresh));
    found = waiting_.rbegin();
  }
  found->estimates[stage] = std::move(estimate);
  found->there[stage] = true;
  const auto regular =
      static_cast<std::size_t>(std::find(occasional_.begin(), occasional_.end(), false) - occasional_.begin());
  // What was said until now, and not what their node, which may be ahead of others, says until all are there.
  for (std::size_t i = 0; stage == regular && i < last_.size(); ++i)
    if (occasional_[i]) found->estimates[i] = last_[i];
  if (!std::all_of(found->there.begin(), found->there.end(), [](bool there) { return there; })) {
    if (waiting_.size() > kMostWaiting) {
      waiting_.pop_front();
      ++dropped_;
    }
    return false;
  }
  set = std::move(found->estimates);
  for (std::size_t i = 0; i < last_.size(); ++i) {
    if (!occasional_[i]) continue;
    if (set[i].channel_status.empty()) continue;  // it has not spoken yet
    // As the stage itself writes them: of this sample, on which it had nothing to say.
    set[i].restarted = set[i].restarted && set[i].sequence == set[regular].sequence && set[i].time == set[regular].time;
    set[i].time = set[regular].time;
    set[i].sequence = set[regular].sequence;
    set[i].channel_status = set[regular].channel_status;
  }
  const auto until = found.base();  // all that came before will not be completed any more
  dropped_ += static_cast<std::uint64_t>(std::distance(waiting_.begin(), until)) - 1;
  waiting_.erase(waiting_.begin(), until);
  return true;
}

}  // namespace faultline
