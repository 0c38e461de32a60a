// Isolation by responses: names the fault whose effect on the rig's model explains what is measured
// (estimators/fault_responses.h does the work in a stage of its own; ranking_finding.h tells its answer). Where it has
// an answer, it stands against the detectors' (isolator.h).
// Settings: stage, those of ranking_finding.h. Throws InputError where the stage gives no ranking.
#include "faultline/isolation/isolator.h"
#include "faultline/isolation/ranking_finding.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

class ResponseIsolator : public Isolator {
 public:
  ResponseIsolator(const Datasheet& sheet, const StageSpec& spec)
      : where_(spec.settings.where()), answer_(sheet, spec.settings) {
    spec.settings.word_or("stage", "");
  }

  void reset() override { answer_.reset(); }
  bool overrules() const override { return !answer_.second(); }
  bool weighs_every_effect() const override { return true; }
  bool rests_on_all_channels() const override { return true; }
  bool finds_all_explained() const override { return !answer_.second() && answer_.all_explained(); }
  double judged_until() const override { return answer_.judged_until(); }
  bool could_see() const override { return answer_.could_see(); }
  double undecided_since() const override { return answer_.undecided_since(); }
  bool suspects(const Finding& finding) const override { return answer_.suspects(finding); }

  void process(const Estimate& estimate, const std::vector<bool>&, Finding& finding) override {
    if (estimate.ranking) return answer_.tell(estimate.ranking, estimate.restarted, finding);
    // An estimate without channels is that of a stage that has not spoken yet.
    if (!estimate.channel_status.empty())
      throw InputError(where_ +
                       ": this isolator reads a ranking, which its stage does not give; name one as 'stage' that does");
  }

 private:
  std::string where_;
  RankingFinding answer_;
};

FAULTLINE_ISOLATOR(response, {"response", make_isolator_of<ResponseIsolator>});

}  // namespace
}  // namespace faultline
