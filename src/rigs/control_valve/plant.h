// Quarter-turn pneumatic control valve in a flow loop. Source: Manninen, "Fault Simulator and Detection for a Process
// Control Valve", Aalto University 2012, equations (1)-(15), which stand with their modules: nozzle_flapper.h,
// spool_valve.h, actuator.h, process_valve.h. Numbers and tables in config/control_valve. No body has mass. What is
// here: the modules joined, and the linkage between piston and process valve.
//
// States: the spool's is X over its stroke, the piston's the opening at which a tight joint holds the shaft,
// phi(x)/(pi/2). With effects at transmission.linkage two states follow: where the piston stands in the play [m], and
// the twist of the joint [rad]. Inside the play the seal holds the valve and T_v is 0. Damping of the joint works where
// it is slower than the integration step, else the twist is compliance T_v. SI units.
#pragma once

#include <array>

#include "rigs/control_valve/actuator.h"
#include "rigs/control_valve/nozzle_flapper.h"
#include "rigs/control_valve/process_valve.h"
#include "rigs/control_valve/spool_valve.h"

namespace faultline {

constexpr int kValveStates = 6;  // of the nominal model

class ControlValve : public Rig {
 public:
  ControlValve(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return linked_ ? kValveStates + 2 : kValveStates; }
  // The spool in the middle in balance, the piston where the flow, or else the valve, is at its set point.
  void start(const double* channels, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  void set_modes(const double* state) override;
  int motion(const double* state) const override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void after_step(double time, double* state, const double* channels) override;
  void outputs(double time, const double* state, double* channels) const override;

 private:
  struct MassFlows {    // kg/s
    double supply = 0;  // Pa gauge, at the device
    double prestage = 0, prestage_leak = 0, cylinder = 0, cylinder_leak = 0;
  };
  struct Shaft {
    double piston = 0;   // x, m
    double ratio = 0;    // phi' of the joint's driven side, rad/m
    double opening = 0;  // h
    double torque = 0;   // T_v
    ProcessValve::Seal seal;
    double load() const { return torque * ratio; }  // N, on the piston
  };

  MassFlows mass_flows(double time, const double* state, const double* channels) const;
  Shaft shaft(const double* state) const;
  void pass_joint(const double* state, Shaft& shaft) const;  // to its driven side
  double twist(const double* state, double torque) const;
  double turn(const Shaft& now, double speed, double* rate, const double* state) const;
  void follow_play(double* state);
  void stop_bodies(double* state) const;

  const NozzleFlapper nozzle_flapper_;
  const SpoolValve spool_valve_;
  Actuator actuator_;
  const ProcessValve process_valve_;
  const EffectChain& linkage_port_;
  const bool linked_;
  const double gas_constant_, ambient_;

  int voltage_, supply_, temperature_, flow_setpoint_, valve_setpoint_;  // channels that drive
  int out_flapper_, out_prestage_, out_spool_, out_cylinder_, out_torque_, out_position_, out_flow_;
  int out_prestage_flow_, out_cylinder_flow_;  // -1 where they are not recorded

  mutable double root_at_ = 0, root_ = 0;  // sqrt(2/(R T_a)) at the last temperature

  std::array<double, kValveStates> before_{};  // at the last step's end, or where a restart put it
  double sure_torque_;                         // N m
  int contact_ = 0;                            // flank of the play: 1 pushes the valve open, -1 closed, 0 is none
  MassFlows last_;                             // for what is recorded of them
};

}  // namespace faultline
