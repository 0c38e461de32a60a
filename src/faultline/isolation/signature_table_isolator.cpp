// Isolation by a signature table: names the fault, or the two, whose signature the step of estimated parameters has
// (parameter_change.h finds the step, signature_table.h explains it, ranking_finding.h tells it).
//
// 1. Over the first `learn` s in which the parameters agree with one level, those of the healthy rig: the reference.
//    What changes before then is no fault and no reference.
// 2. A step is there from the likelihood ratio `threshold` (chi-squared; from healthy recordings) on. While it is young
//    its time and size are sought anew with every block.
// 3. After `hold` s its level becomes the reference for what else may change: a second step is judged by its own change
//    and told in the place of the second fault, unless two faults at once explained the first. A third is not sought.
//    Where the parameters return to those of the healthy rig both end.
// Ambiguity is told as such: rivals within `rival` of the evidence, unknown beyond `most_rivals`; unknown too where
// neither one nor two signatures fit. A fault that moves no parameter of the stage is none of the table's: what an
// observer of the other part says stands then.
// Settings: stage, parameters (states of the stage, with commas), learn, memory, block, window, least (shortest time
// since a step), inflation, shown, scatter, floor, threshold, hold; those of signature_table.h and ranking_finding.h.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/isolation/isolator.h"
#include "faultline/isolation/parameter_change.h"
#include "faultline/isolation/ranking_finding.h"
#include "faultline/isolation/signature_table.h"
#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

constexpr const char* kType = "signature_table";
constexpr int kReferenceVersion = 1;  // theta, then its covariance row after row

ParameterChangeOptions change_options(const Datasheet& sheet, const Settings& s, std::size_t parameters) {
  ParameterChangeOptions o;
  o.period_s = sheet.sample_period;
  o.memory_s = s.number("memory", o.period_s, 1e6);
  o.block_s = s.number("block", o.period_s, 1e6);
  o.window_s = s.number("window", o.block_s, 1e6);
  o.least_s = s.number("least", 0, o.window_s);
  o.inflation = s.list("inflation", parameters, 1e-3, 1e6);
  o.shown = s.list("shown", parameters, 1e-6, 1e6);
  o.scatter = s.number("scatter", 1, 1e6);
  o.relative_error = s.number("relative_error", 0, 1);
  o.floor = s.list("floor", parameters, 0, 10);
  return o;
}

class SignatureTableIsolator : public Isolator {
 public:
  SignatureTableIsolator(const Datasheet& sheet, const StageSpec& spec)
      : where_(spec.settings.where()),
        names_(split_words(spec.settings.word("parameters"))),
        options_(change_options(sheet, spec.settings, names_.size())),
        learn_(spec.settings.number("learn", options_.block_s, options_.window_s)),
        threshold_(spec.settings.number("threshold", 0, 1e9)),
        hold_(spec.settings.number("hold", options_.least_s, options_.window_s)),
        table_(sheet, spec.settings, static_cast<int>(names_.size())),
        answer_(sheet, spec.settings),
        change_(static_cast<int>(names_.size()), options_) {
    spec.settings.word_or("stage", "");
  }

  void reset() override { started_ = false; }
  bool overrules() const override { return !answer_.second(); }

  void process(const Estimate& estimate, const std::vector<bool>&, Finding& finding) override {
    const std::size_t n = names_.size();
    if (estimate.channel_status.empty()) return;  // the stage has not spoken yet
    if (estimate.state.size() != n || estimate.covariance.size() != n * n)
      throw InputError(fmt::format("{}: 'parameters' has {} names, its stage estimates {} with a covariance", where_, n,
                                   estimate.state.size()));
    if (!started_) {
      started_ = true;
      healthy_ = restored_;
      begin();
      answer_.reset();
      finding = Finding();
    }
    // What it knows of the rig outlasts a gap in the data; what it was looking at does not.
    if (estimate.restarted) change_.reset();
    if (!change_.add(estimate.state.data(), estimate.covariance.data(), estimate.observed > 0)) return;
    const auto ranking = std::make_shared<Ranking>();
    ranking->threshold = threshold_;
    ranking->judged_until = estimate.time;
    judge(estimate.time, *ranking);
    answer_.tell(ranking, false, finding);
    if (unexplained_ && !answer_.second()) {
      finding = Finding();
      finding.active = true;
      finding.since = ranking->since;
      finding.confidence = 0.5;
      finding.text = fmt::format("The parameters have changed as neither one fault nor two change them (nearest: {})",
                                 first_.answer.nearest);
    }
  }

  std::optional<Reference> reference() const override {
    if (!started_ || healthy_.theta.size() == 0) return {};
    Reference r{kType, kReferenceVersion, reference_names(), {}};
    r.numbers.assign(healthy_.theta.data(), healthy_.theta.data() + healthy_.theta.size());
    r.numbers.insert(r.numbers.end(), healthy_.covariance.data(),
                     healthy_.covariance.data() + healthy_.covariance.size());
    return r;
  }
  void restore(const Reference& reference) override {
    check_reference(reference, kType, kReferenceVersion, reference_names());
    const auto n = static_cast<Eigen::Index>(names_.size());
    restored_.theta = Eigen::Map<const Eigen::VectorXd>(reference.numbers.data(), n);
    restored_.covariance = Eigen::Map<const Eigen::MatrixXd>(reference.numbers.data() + n, n, n);
  }

 private:
  struct Event {
    bool there = false;
    double since = 0;  // s
    SignatureTable::Answer answer;
  };

  void begin() {
    first_ = second_ = Event();
    unexplained_ = false;
    held_ = ParameterLevel();
    change_.reset();
  }

  std::vector<std::string> reference_names() const {
    std::vector<std::string> names = names_;
    for (const std::string& a : names_)
      for (const std::string& b : names_) names.push_back(a + "*" + b);
    return names;
  }

  void judge(double time, Ranking& ranking) {
    if (healthy_.theta.size() == 0) {
      if (change_.seconds() < learn_ || !change_.agrees(learn_)) return;
      healthy_ = change_.level(learn_);
      change_.reset();
      return;
    }
    const bool held = held_.theta.size() > 0;
    const ParameterStep step = change_.step_from(held ? held_ : healthy_);
    const bool there = step.chi2 > threshold_;
    ranking.evidence = step.chi2;
    if (held && there && change_.step_from(healthy_, step.age).chi2 <= threshold_) {
      begin();
    } else if (held) {
      second_.there = there && first_.answer.second.empty();
      if (second_.there) {
        second_.since = time - step.age;
        second_.answer = table_.explain(step.change, step.covariance);
      }
    } else {
      first_.there = there;
      unexplained_ = false;
      if (there) {
        first_.since = time - step.age;
        first_.answer = table_.explain(step.change, step.covariance);
        // While it is young, what still rests on samples from before the step may look like anything.
        unexplained_ = !first_.answer.explained && step.age >= hold_;
        if (step.age >= hold_ && first_.answer.explained) {
          held_ = change_.level(step.age);
          change_.reset();
        }
      }
    }
    ranking.since = answer_.second() && second_.there ? second_.since : first_.there ? first_.since : time;
    if (!first_.there) return;
    ranking.first = first_.answer.first;
    ranking.second = second_.there ? second_.answer.first : first_.answer.second;
  }

  std::string where_;
  std::vector<std::string> names_;
  ParameterChangeOptions options_;
  double learn_, threshold_, hold_;
  SignatureTable table_;
  RankingFinding answer_;
  ParameterChange change_;
  bool started_ = false, unexplained_ = false;
  ParameterLevel restored_, healthy_, held_;  // empty: none
  Event first_, second_;
};

FAULTLINE_ISOLATOR(signature_table, {"signature_table", make_isolator_of<SignatureTableIsolator>});

}  // namespace
}  // namespace faultline
