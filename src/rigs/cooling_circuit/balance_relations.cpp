// What must balance in the cooling circuit, as relations with one unknown coefficient each (relation_model.h).
// Source: Iannetti et al. (2015), equation (9), for the tube; the others are the rig's own equations at rest,
// config/cooling_circuit.
//
//   {b}_tube   q_2 = c q_2^0.125 sqrt(P_1 - P_2)
//   {b}_drain  q_2 = k_d sqrt(P_2 - P_d)
//   {b}_feed   q_2 = k_f sqrt(P_m - P_1),   P_m = mean over the branches of P_1 + (q_2/k_f nominal)^2
//   {b}_heat   T_2 - theta_T = Q_n theta_Q;  M theta_T' = q_2 (T_1 - theta_T),  M theta_Q' = -q_2 theta_Q + s/cv,  M =
//   rho b a^2
//   {b}_water  T_1 = T_w
//   valve      sum q_2 = k_v z sqrt(P_s - P_m)
// z and s follow the commands with their nominal lags. The pressures settle within 0.1 ms and the manifold within 2 ms,
// so balances at rest hold from sample to sample; only z and s are doubtful while a command moves. P_m is not measured:
// a branch whose feed is off pulls P_m by a fifth of it, which isolation reckons with. Rows with a drop below
// `smallest_drop` (Pa) or without firing are not used. Further quantities: every channel but the commands, z, s,
// {b}_heat_row (theta_Q), {b}_heat_rise (T_2 - theta_T), {b}_back_pressure (P_2 - (q_2/k_d nominal)^2, whose swings are
// those behind the throttle), and steady_time: s since the bench fires and no command moved by more than 0.5 %; 0 while
// it does not fire.
#include <algorithm>
#include <cmath>

#include "faultline/estimators/relation_model.h"

namespace faultline {
namespace {

constexpr double kFiring = 0.05;       // firing level from which the bench fires
constexpr double kMoved = 0.005;       // change of a command that counts
constexpr double kSmallestHeat = 0.1;  // of the nominal temperature rise

struct Branch {
  std::string name;
  int inlet, outlet, flow, cold, warm;  // channels
  double feed, c, drain, heat, mass, smallest_rise;
  double p1 = 0, p2 = 0, q = 0, t1 = 0, t2 = 0, theta_t = 0, theta_q = 0;
};

enum { kTube, kDrain, kFeed, kHeat, kWater, kPerBranch };

class CoolingBalances : public RelationModel {
 public:
  CoolingBalances(const Datasheet& sheet, const Settings& settings)
      : smallest_drop_(settings.number("smallest_drop", 1, 1e6)), channels_(sheet.channels) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const std::string& name) {
      return nominal[static_cast<std::size_t>(sheet.parameter(name))];
    };
    specific_heat_ = value("specific_heat");
    valve_time_ = value("valve_time_constant");
    firing_time_ = value("firing_time_constant");
    drain_pressure_ = value("drain_pressure");
    water_ = value("water_temperature");
    valve_coefficient_ = value("valve_coefficient");
    supply_ = sheet.channel("supply_pressure");
    valve_command_ = sheet.channel("bench_valve_command");
    heat_command_ = sheet.channel("heat_load_command");
    for (const std::string& b : sheet.branches) {
      Branch branch;
      branch.name = b;
      branch.inlet = sheet.channel(b + "_inlet_pressure");
      branch.outlet = sheet.channel(b + "_outlet_pressure");
      branch.flow = sheet.channel(b + "_mass_flow");
      branch.cold = sheet.channel(b + "_inlet_temperature");
      branch.warm = sheet.channel(b + "_outlet_temperature");
      branch.feed = value(b + "_feed_coefficient");
      branch.c = value(b + "_c");
      branch.drain = value(b + "_drain_coefficient");
      branch.heat = value(b + "_heat_flux");
      branch.mass = value("density") * value(b + "_b") * value("sound_speed") * value("sound_speed");
      // K/W at the coefficient's own nominal flow of 30 bar over the drain, a tenth of it.
      branch.smallest_rise = kSmallestHeat / (branch.drain * std::sqrt(3e6) * specific_heat_);
      branches_.push_back(branch);
    }
  }

  std::vector<Relation> relations() const override {
    std::vector<Relation> result;
    const double root = std::sqrt(smallest_drop_);
    for (const Branch& b : branches_) {
      const std::string& n = b.name;
      // At the least excitation a flow of about a tenth of a kg/s passes: its power 0.125 is 0.75.
      result.push_back({n + "_tube",
                        {{n + "_c", "c", "kg^0.875/(s^0.875 Pa^0.5)"}},
                        {b.c},
                        {b.inlet, b.outlet, b.flow},
                        0.75 * root});
      result.push_back(
          {n + "_drain", {{n + "_drain_coefficient", "k_d", "kg/(s sqrt(Pa))"}}, {b.drain}, {b.outlet, b.flow}, root});
      result.push_back(
          {n + "_feed", {{n + "_feed_coefficient", "k_f", "kg/(s sqrt(Pa))"}}, {b.feed}, {b.inlet, b.flow}, root});
      result.push_back(
          {n + "_heat", {{n + "_heat_flux", "Q_n", "W"}}, {b.heat}, {b.flow, b.cold, b.warm}, b.smallest_rise});
      result.push_back({n + "_water", {{n + "_water_temperature", "T_w", "K"}}, {water_}, {b.cold}, 1});
    }
    std::vector<int> flows = {supply_, valve_command_};
    for (const Branch& b : branches_) flows.push_back(b.flow);
    result.push_back(
        {"valve", {{"valve_coefficient", "k_v", "kg/(s sqrt(Pa))"}}, {valve_coefficient_}, flows, 0.1 * root});
    return result;
  }

  void reset(const double* channels) override {
    valve_ = last_valve_ = std::clamp(channels[valve_command_], 0.0, 1.0);
    firing_ = last_heat_ = std::max(channels[heat_command_], 0.0);
    steady_ = 0;
    take(channels);
    for (Branch& b : branches_) {
      b.theta_t = b.t1;
      b.theta_q = b.q > 0 ? firing_ / (b.q * specific_heat_) : 0.0;
    }
  }

  void advance(const double* channels, const ChannelStatus*, double dt) override {
    // Commands act from their row to the next: the lags run with those of the last sample.
    const double u = std::clamp(valve_input_, 0.0, 1.0), h = std::max(heat_input_, 0.0);
    valve_ += (1 - std::exp(-dt / valve_time_)) * (u - valve_);
    firing_ += (1 - std::exp(-dt / firing_time_)) * (h - firing_);
    for (Branch& b : branches_) {
      const double q = std::max(b.q, 1e-3);
      const double gain = 1 - std::exp(-q * dt / b.mass);
      b.theta_t += gain * (b.t1 - b.theta_t);
      b.theta_q += gain * (firing_ / (q * specific_heat_) - b.theta_q);
    }
    take(channels);
    if (firing_ < kFiring || std::abs(valve_input_ - last_valve_) > kMoved ||
        std::abs(heat_input_ - last_heat_) > kMoved) {
      steady_ = 0;
      last_valve_ = valve_input_;
      last_heat_ = heat_input_;
    } else {
      steady_ += dt;
    }
  }

  double row(std::size_t relation, double* h) const override {
    if (relation == kPerBranch * branches_.size()) {
      double total = 0;
      for (const Branch& b : branches_) total += b.q;
      h[0] = valve_ * std::sqrt(std::max(supply_pressure_ - manifold_, 0.0));
      return total;
    }
    const Branch& b = branches_[relation / kPerBranch];
    switch (relation % kPerBranch) {
      case kTube:
        h[0] = std::sqrt(std::sqrt(std::sqrt(std::max(b.q, 0.0)))) * std::sqrt(std::max(b.p1 - b.p2, 0.0));
        return b.q;
      case kDrain:
        h[0] = std::sqrt(std::max(b.p2 - drain_pressure_, 0.0));
        return b.q;
      case kFeed:
        h[0] = std::sqrt(std::max(manifold_ - b.p1, 0.0));
        return b.q;
      case kHeat:
        h[0] = b.theta_q;
        return b.t2 - b.theta_t;
      default:
        h[0] = 1;
        return b.t1;
    }
  }

  void quantities(const double* channels, std::vector<Quantity>& result) const override {
    const std::size_t coefficients = kPerBranch * branches_.size() + 1;
    if (result.size() == coefficients) {
      for (const Channel& channel : channels_)
        if (channel.role != Role::command) result.push_back({channel.name, channel.unit, 0, 0});
      result.push_back({"valve_opening", "1", 0, 0});
      result.push_back({"firing_level", "1", 0, 0});
      result.push_back({"steady_time", "s", 0, 0});
      for (const Branch& b : branches_) {
        result.push_back({b.name + "_heat_row", "K/W", 0, 0});
        result.push_back({b.name + "_heat_rise", "K", 0, 0});
        result.push_back({b.name + "_back_pressure", "Pa", 0, 0});
      }
    }
    Quantity* q = &result[coefficients];
    for (std::size_t c = 0; c < channels_.size(); ++c)
      if (channels_[c].role != Role::command) (q++)->value = channels[c];
    (q++)->value = valve_;
    (q++)->value = firing_;
    (q++)->value = steady_;
    for (const Branch& b : branches_) {
      (q++)->value = b.theta_q;
      (q++)->value = b.t2 - b.theta_t;
      (q++)->value = b.p2 - (b.q / b.drain) * (b.q / b.drain);
    }
  }

 private:
  void take(const double* channels) {
    supply_pressure_ = channels[supply_];
    valve_input_ = channels[valve_command_];
    heat_input_ = channels[heat_command_];
    manifold_ = 0;
    for (Branch& b : branches_) {
      b.p1 = channels[b.inlet];
      b.p2 = channels[b.outlet];
      b.q = channels[b.flow];
      b.t1 = channels[b.cold];
      b.t2 = channels[b.warm];
      const double drop = b.q / b.feed;
      manifold_ += b.p1 + drop * drop;
    }
    manifold_ /= static_cast<double>(branches_.size());
  }

  double smallest_drop_;
  std::vector<Channel> channels_;
  std::vector<Branch> branches_;
  double specific_heat_, valve_time_, firing_time_, drain_pressure_, water_, valve_coefficient_;
  int supply_, valve_command_, heat_command_;
  double supply_pressure_ = 0, manifold_ = 0, valve_input_ = 0, heat_input_ = 0, valve_ = 0, firing_ = 0;
  double last_valve_ = 0, last_heat_ = 0, steady_ = 0;
};

FAULTLINE_RELATION_MODEL(cooling_balances, {"cooling_balances", make_relation_model_of<CoolingBalances>});

}  // namespace
}  // namespace faultline
