// Balances and faults of the cooling circuit (balance_model.h). Source: Iannetti et al. (2015), equation (9), and
// config/cooling_circuit/rig.yaml.
//
// Per branch, with flows through feed q_f, tube q_12 and throttle q_t, of which the meter shows q (before a leak of
// the outlet hose):
//   q_12 = q + L_outlet,  q_f = q_12 + L_inlet,  q_t = q - L_drain,
//   L = rho k sqrt(P - P_d) for a leak of coefficient k
//   tube   ln q_12^0.875/sqrt(P_1 - P_2)        drain  ln q_t/sqrt(P_2 - P_d)     feed  ln q_f/sqrt(P_m - P_1)
//   heat   ln (T_2 - theta_T) q_12/(q theta_Q)  water  T_1/10 K                   valve ln sum q_f/(z sqrt(P_s - P_m))
// each less its reference; a clogged place divides its coefficient by 1 - fraction, an offset is taken off its channel.
// P_m = mean of P_1 + (q_f/k_f)^2 with the nominal k_f: a wrong feed moves it by a fifth, which the residuals take
// along. Equal by these balances, so always told together: what only the valve sees (droop, clogged valve, supply
// transmitter), and what only one heat balance sees (wall heat, outlet thermocouple). Laminar leaks, scale and lag of
// a sensor pass for their siblings here.
#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "faultline/isolation/balance_model.h"

namespace faultline {
namespace {

enum { kInlet, kOutlet, kFlow, kCold, kRise, kRow, kFeatures };  // per branch; then supply, valve
enum { kTube, kDrain, kFeed, kHeat, kWater, kResiduals };        // per branch; then the bench valve
enum Cause {
  kLeakInlet,
  kLeakOutlet,
  kLeakDrain,
  kClogFeed,
  kClogTube,
  kClogDrain,
  kOffsetInlet,
  kOffsetOutlet,
  kOffsetFlow,
  kOffsetCold,
  kOffsetWarm,
  kWallHeat,
  kDroop,
  kClogValve,
  kOffsetSupply,
  kFiringHeat,
  kWaterDrift,
  kViscosity
};

constexpr double kWaterScale = 10;      // K
constexpr double kPlay = 0.001;         // of the bench valve's opening
constexpr double kLeast = 1e-9;         // below this a flow or a drop is none
constexpr double kUsualPressure = 4e6;  // Pa, in cavity 2
constexpr double kLargestWarming = 60;  // K, of the incoming water, to both sides
constexpr double kLargestThinning = 3;  // of ln mu: water between 0 and 150 C

struct Branch {
  std::string name;
  int inlet, outlet, flow, cold, warm;
  double feed;
  double warming;  // s, with which cavity 2 warms at its nominal flow
};

struct Case {
  Cause cause;
  int branch;  // -1: all
};

class CoolingCircuit : public BalanceModel {
 public:
  CoolingCircuit(const Datasheet& sheet, const Settings&) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const std::string& name) {
      return nominal[static_cast<std::size_t>(sheet.parameter(name))];
    };
    density_ = value("density");
    drain_pressure_ = value("drain_pressure");
    drain_pressure_error_ =
        drain_pressure_ * sheet.parameters[static_cast<std::size_t>(sheet.parameter("drain_pressure"))].tolerance;
    supply_ = sheet.channel("supply_pressure");
    for (const std::string& b : sheet.branches) {
      const auto feed = static_cast<std::size_t>(sheet.parameter(b + "_feed_coefficient"));
      feed_error_ = std::max(feed_error_, sheet.parameters[feed].tolerance);
      const double flow = value(b + "_drain_coefficient") * std::sqrt(kUsualPressure);
      const double warming = density_ * value(b + "_b") * std::pow(value("sound_speed"), 2) / flow;
      branches_.push_back({b, sheet.channel(b + "_inlet_pressure"), sheet.channel(b + "_outlet_pressure"),
                           sheet.channel(b + "_mass_flow"), sheet.channel(b + "_inlet_temperature"),
                           sheet.channel(b + "_outlet_temperature"), nominal[feed], warming});
    }
    const auto noise = [&](int channel) {
      const Channel& c = sheet.channels[static_cast<std::size_t>(channel)];
      return std::sqrt(c.noise_std * c.noise_std + c.resolution * c.resolution / 12);
    };
    // theta_T and theta_Q are filtered: of the heat balance only T_2 scatters.
    for (const Branch& b : branches_)
      feature_noise_.insert(feature_noise_.end(),
                            {noise(b.inlet), noise(b.outlet), noise(b.flow), noise(b.cold), noise(b.warm), 0});
    feature_noise_.insert(feature_noise_.end(), {noise(supply_), 0});
    terms_.resize(branches_.size());
    untouched_.resize(branches_.size());
    for (Untouched& untouched : untouched_) untouched.features.fill(std::nan(""));
    make_hypotheses(sheet);
  }

  std::vector<std::string> features() const override {
    std::vector<std::string> names;
    for (const Branch& b : branches_)
      for (const char* feature :
           {"_inlet_pressure", "_outlet_pressure", "_mass_flow", "_inlet_temperature", "_heat_rise", "_heat_row"})
        names.push_back(b.name + feature);
    names.insert(names.end(), {"supply_pressure", "valve_opening"});
    return names;
  }

  std::vector<double> feature_noise() const override { return feature_noise_; }

  std::vector<std::string> residuals() const override {
    std::vector<std::string> names;
    for (const Branch& b : branches_)
      for (const char* kind : {"_tube", "_drain", "_feed", "_heat", "_water"}) names.push_back(b.name + kind);
    names.push_back("valve");
    return names;
  }
  std::vector<std::string> residual_kinds() const override {
    std::vector<std::string> kinds;
    for (std::size_t i = 0; i < branches_.size(); ++i)
      kinds.insert(kinds.end(), {"tube", "drain", "feed", "heat", "water"});
    kinds.push_back("valve");
    return kinds;
  }
  std::vector<std::vector<int>> residual_channels() const override {
    std::vector<std::vector<int>> result;
    std::vector<int> all = {supply_};
    for (const Branch& b : branches_) {
      result.push_back({b.inlet, b.outlet, b.flow});
      result.push_back({b.outlet, b.flow});
      result.push_back({});
      result.push_back({b.flow, b.cold, b.warm});
      result.push_back({b.cold});
      all.insert(all.end(), {b.inlet, b.flow});
    }
    // P_m comes from all branches.
    for (std::size_t i = 0; i < branches_.size(); ++i)
      result[kResiduals * i + kFeed].assign(all.begin() + 1, all.end());
    result.push_back(all);
    return result;
  }
  std::vector<Hypothesis> hypotheses() const override { return hypotheses_; }

  void reference(const double* features, double* reference) const override {
    std::vector<double> none(kResiduals * branches_.size() + 1, 0.0);
    residuals(features, none.data(), -1, 0, reference);
  }

  // The drain's back pressure and the feeds are known to their tolerance, the valve's opening to the play of its
  // positioner.
  void errors(const double* features, const double* learnt, double* error) const override {
    const std::size_t n = branches_.size();
    std::fill_n(error, kResiduals * n + 1, 0.0);
    const double* end = features + kFeatures * n;
    const double* end_learnt = learnt + kFeatures * n;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t outlet = kFeatures * i + kOutlet;
      error[kResiduals * i + kDrain] = std::abs(drain_error(features[outlet]) - drain_error(learnt[outlet]));
    }
    const double moved = std::abs(end[1] - end_learnt[1]) > kPlay ? kPlay / std::max(end[1], kPlay) : 0.0;
    const double feeds = valve_error(features) - valve_error(learnt);
    error[kResiduals * n] = std::hypot(moved, feeds);
  }

  void residuals(const double* f, const double* reference, int hypothesis, double size, double* r) const override {
    const Case h = hypothesis < 0 ? Case{kLeakInlet, -2} : cases_[static_cast<std::size_t>(hypothesis)];
    const double* end = f + kFeatures * branches_.size();
    double manifold = 0, total = 0;
    for (std::size_t i = 0; i < branches_.size(); ++i, f += kFeatures) {
      Terms& terms = terms_[i];
      if (size != 0 && (h.branch == static_cast<int>(i) || h.branch == -1)) {
        terms = terms_of(i, f, h, size);
      } else {
        // Hypothesis after hypothesis is tried on the same features, and most of them are about other branches.
        Untouched& untouched = untouched_[i];
        if (!std::equal(untouched.features.begin(), untouched.features.end(), f)) {
          std::copy_n(f, kFeatures, untouched.features.begin());
          untouched.terms = terms_of(i, f, {kLeakInlet, -2}, 0);
        }
        terms = untouched.terms;
      }
      manifold += terms.inlet + terms.drop * terms.drop;
      total += terms.feed;
    }
    manifold /= static_cast<double>(branches_.size());
    for (const Terms& terms : terms_) {
      const double root = std::sqrt(std::max(manifold - terms.inlet, kLeast));
      r[kTube] = terms.tube - reference[kTube];
      r[kDrain] = terms.drain - reference[kDrain];
      r[kFeed] = log_of_ratio(terms.feed, root * terms.open) - reference[kFeed];
      r[kHeat] = terms.heat - reference[kHeat];
      r[kWater] = terms.water - reference[kWater];
      r += kResiduals;
      reference += kResiduals;
    }
    double supply = end[0], open = end[1];
    if (h.branch == -1 && h.cause == kOffsetSupply) supply -= size;
    if (h.branch == -1 && h.cause == kDroop) supply -= size * total / density_;
    if (h.branch == -1 && h.cause == kClogValve) open *= 1 - size;
    *r = log_of_ratio(total, open * std::sqrt(std::max(supply - manifold, kLeast))) - *reference;
  }

 private:
  // What one branch says by itself.
  struct Terms {
    double tube, drain, heat, water;  // of the balances, without their references
    double feed, open, inlet, drop;   // flow and opening of the feed, P_1, root of the drop over the feed
  };
  struct Untouched {
    std::array<double, kFeatures> features;
    Terms terms;
  };

  Terms terms_of(std::size_t branch, const double* f, const Case& h, double size) const {
    const bool here = h.branch == static_cast<int>(branch);
    const bool everywhere = h.branch == -1;
    const auto of = [&](Cause cause) { return here && h.cause == cause ? size : 0.0; };
    const double p1 = f[kInlet] - of(kOffsetInlet), p2 = f[kOutlet] - of(kOffsetOutlet);
    const double q = f[kFlow] - of(kOffsetFlow);
    const double drop_out = std::max(p2 - drain_pressure_, kLeast);
    const double tube = q + density_ * of(kLeakOutlet) * std::sqrt(drop_out);
    const double feed = tube + density_ * of(kLeakInlet) * std::sqrt(std::max(p1 - drain_pressure_, kLeast));
    const double throttle = q - density_ * of(kLeakDrain) * std::sqrt(drop_out);
    const double root = std::sqrt(std::max(p1 - p2, kLeast));
    const double viscosity = everywhere && h.cause == kViscosity ? 0.125 * size : 0.0;
    const double heat = of(kWallHeat) + (everywhere && h.cause == kFiringHeat ? size : 0.0);
    const double cold = f[kCold] - of(kOffsetCold) - (everywhere && h.cause == kWaterDrift ? size : 0.0);
    Terms terms;
    terms.tube = 0.875 * log_of(tube) - log_of(root * (1 - of(kClogTube))) - viscosity;
    terms.drain = log_of_ratio(throttle, std::sqrt(drop_out) * (1 - of(kClogDrain)));
    terms.heat = log_of((f[kRise] - of(kOffsetWarm) + of(kOffsetCold)) / std::max(f[kRow] * f[kFlow], kLeast) * tube) -
                 std::log1p(heat);
    terms.water = cold / kWaterScale;
    terms.feed = feed;
    terms.open = 1 - of(kClogFeed);
    terms.inlet = p1;
    terms.drop = feed / (branches_[branch].feed * terms.open);
    return terms;
  }

  // One sigma of ln k_d by the drain pressure, and of ln k_v by all feeds together.
  double drain_error(double outlet) const {
    return 0.5 * drain_pressure_error_ / std::max(outlet - drain_pressure_, kLeast);
  }
  double valve_error(const double* features) const {
    double manifold = 0, drop = 0;
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const double feed = features[kFeatures * i + kFlow] / branches_[i].feed;
      drop += feed * feed;
      manifold += features[kFeatures * i + kInlet] + feed * feed;
    }
    const double n = static_cast<double>(branches_.size());
    const double over_valve = features[kFeatures * branches_.size()] - manifold / n;
    return feed_error_ / std::sqrt(n) * drop / n / std::max(over_valve, kLeast);
  }

  static double log_of(double value) { return std::log(std::max(value, kLeast)); }
  static double log_of_ratio(double value, double to) {
    return std::log(std::max(value, kLeast) / std::max(to, kLeast));
  }

  // What balances tell of the faults that the datasheet lists; the others they leave to the other stages.
  void make_hypotheses(const Datasheet& sheet) {
    const std::vector<FaultHypothesis> all = fault_hypotheses(sheet);
    const auto add = [&](Cause cause, int branch, const std::string& name, std::string text) -> Hypothesis* {
      std::optional<Hypothesis> found = listed(all, name, std::move(text));
      if (!found) return nullptr;
      cases_.push_back({cause, branch});
      hypotheses_.push_back(std::move(*found));
      return &hypotheses_.back();
    };
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const Branch& branch = branches_[i];
      const std::string& b = branch.name;
      const int at = static_cast<int>(i);
      const auto leak = [&](Cause cause, const char* place, const char* where) {
        add(cause, at, fmt::format("orifice_leakage@flow.{}_{}_ambient", b, place),
            fmt::format("Branch {}: leak {}", b, where));
      };
      leak(kLeakOutlet, "outlet", "from cavity 2, before the flow meter");
      leak(kLeakInlet, "inlet", "from cavity 1, before the cooling channel");
      leak(kLeakDrain, "drain", "from the outlet hose, after the flow meter");
      const auto clog = [&](Cause cause, const char* place, const char* where) {
        add(cause, at, fmt::format("clogging@restriction.{}_{}", b, place),
            fmt::format("Branch {}: {} clogged", b, where));
      };
      clog(kClogTube, "orifice", "cooling channel");
      clog(kClogFeed, "feed", "trim orifice");
      clog(kClogDrain, "drain", "drain throttle");
      const auto offset = [&](Cause cause, const char* quantity, int channel, int feature) {
        Hypothesis* h = add(cause, at, fmt::format("offset@sensor.{}_{}", b, quantity),
                            fmt::format("{}_{}: this transducer is off", b, quantity));
        if (h == nullptr) return;
        h->channels = {channel};
        h->drift_unit = h->size_unit + "/s";
        if (cause == kOffsetWarm) h->rise = 0;
        if (feature >= 0) h->feature = feature + kFeatures * at;
      };
      offset(kOffsetInlet, "inlet_pressure", branch.inlet, kInlet);
      offset(kOffsetOutlet, "outlet_pressure", branch.outlet, kOutlet);
      offset(kOffsetFlow, "mass_flow", branch.flow, kFlow);
      offset(kOffsetCold, "inlet_temperature", branch.cold, kCold);
      if (Hypothesis* wall = add(kWallHeat, at, fmt::format("scale@heat.{}_wall", b),
                                 fmt::format("Branch {}: heat from the wall is off", b)))
        wall->rise = branch.warming;
      offset(kOffsetWarm, "outlet_temperature", branch.warm, -1);
    }
    add(kDroop, -1, "droop@source.supply", "Supply pressure is lost between tank and bench valve");
    add(kClogValve, -1, "clogging@restriction.bench_valve", "Bench valve clogged");
    if (Hypothesis* supply =
            add(kOffsetSupply, -1, "offset@sensor.supply_pressure", "supply_pressure: this transducer is off")) {
      supply->channels = {supply_};
      supply->drift_unit = supply->size_unit + "/s";
    }
    add(kFiringHeat, -1, "scale@command.heat_load_command", "All walls: heat differs from what is commanded");
    // Of these two balances see what has come of it, not the effect's own size.
    if (Hypothesis* water = add(kWaterDrift, -1, "drift@source.water", "Incoming water has changed its temperature"))
      see(*water, "change", "K", 0.1, kLargestWarming);
    if (Hypothesis* viscosity = add(kViscosity, -1, "viscosity_drift@source.water",
                                    "All cooling channels pass more or less than they did: viscosity"))
      see(*viscosity, "log_factor", "1", 1e-2, kLargestThinning);
  }

  static void see(Hypothesis& hypothesis, const char* what, const char* unit, double step, double most) {
    hypothesis.size_name = what;
    hypothesis.size_unit = unit;
    hypothesis.unit = step;
    hypothesis.low = -most;
    hypothesis.high = most;
    hypothesis.shown_from = 0;
  }

  std::vector<Branch> branches_;
  std::vector<double> feature_noise_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<Case> cases_;
  double density_, drain_pressure_, drain_pressure_error_, feed_error_ = 0;
  int supply_;
  mutable std::vector<Terms> terms_;          // of residuals(), per branch
  mutable std::vector<Untouched> untouched_;  // likewise, as last computed
};

FAULTLINE_BALANCE_MODEL(cooling_circuit, {"cooling_circuit", make_balance_model_of<CoolingCircuit>});

}  // namespace
}  // namespace faultline
