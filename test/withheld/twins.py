"""Families, near-equivalents and parameter twins, as effects.md and the datasheets' notes name them.

One table for all rigs: what a rig's datasheet does not list does not count there.
"""

FAMILY = {}
for _family, _names in {
    "friction": "coulomb_friction viscous_friction stribeck_friction asymmetric_friction load_dependent_friction"
    " presliding_friction",
    "load": "load_force added_mass end_stop",
    "play": "backlash elasticity",
    "deadzone": "deadband underlap",
    "hysteresis": "hysteresis",
    "gain": "gain_curve scale",
    "limit": "rate_limit saturation",
    "offset": "offset drift",
    "lag": "lag second_order_lag",
    "delay": "delay",
    "resolution": "quantisation noise",
    "stuck": "stuck",
    "leakage": "orifice_leakage laminar_leakage speed_leakage relief_opening overflow",
    "restriction": "clogging area_curve flow_exponent",
    "compliance": "entrained_air compliance_factor",
    "line": "line_inertia",
    "source": "droop ripple displacement_ripple",
    "temperature": "viscosity_drift",
    "heat": "heat_loss heat_capacity",
}.items():
    for _name in _names.split():
        FAMILY[_name] = _family

# Move like a nominal parameter: below about three tolerances miscalibration, not structure.
PARAMETER_TWINS = {
    "coulomb_friction@force.piston",
    "viscous_friction@force.piston",
    "stribeck_friction@force.piston",
    "added_mass@force.piston",
    "compliance_factor@compliance.chambers",
    "clogging@restriction.valve",
    "scale@command.valve_command",
    # hydraulic drive
    "viscous_friction@force.shaft",
    "added_mass@force.shaft",
    "laminar_leakage@flow.motor_in_motor_out",
    "compliance_factor@compliance.motor_line",
    "scale@command.valve",
    "scale@transmission.motor",
    "scale@transmission.pump",
    "scale@transmission.displacement",
    "scale@sensor.pump_pressure",
    "load_dependent_friction@force.shaft",
    "viscosity_drift@source.oil",
    # pump-controlled cylinder
    "laminar_leakage@flow.pump2_a_b",
    "laminar_leakage@flow.pump2_a_tank",
    "laminar_leakage@flow.pump2_b_tank",
    "laminar_leakage@flow.pump1_a_tank",
    "laminar_leakage@flow.chamber_a_chamber_b",
    "compliance_factor@compliance.chamber_a",
    "compliance_factor@compliance.chamber_b",
    # control valve: the datasheet's list
    "offset@command.coil_voltage",
    "scale@command.coil_voltage",
    "lag@command.coil_voltage",
    "coulomb_friction@force.spool",
    "asymmetric_friction@force.spool",
    "load_force@force.spool",
    "coulomb_friction@force.actuator",
    "asymmetric_friction@force.actuator",
    "viscous_friction@force.actuator",
    "load_force@force.actuator",
    "coulomb_friction@force.valve",
    "orifice_leakage@flow.prestage_ambient",
    "clogging@restriction.fixed_restrictor",
    "clogging@restriction.nozzle",
    "clogging@restriction.spool_ports",
    "clogging@restriction.process_valve",
    "area_curve@restriction.process_valve",
    "compliance_factor@compliance.cylinder",
    "elasticity@transmission.linkage",
}
# Parameter that does exactly what the effect does: effect -> (parameter, its relative shift from the effect and its
# value).
EXACT_TWIN = {
    "coulomb_friction@force.piston": ("coulomb_friction", lambda e, nominal: e["force"] / nominal),
    "viscous_friction@force.piston": ("viscous_damping", lambda e, nominal: e["coefficient"] / nominal),
    "added_mass@force.piston": ("moving_mass", lambda e, nominal: e["mass"] / nominal),
    "compliance_factor@compliance.chambers": ("compliance", lambda e, nominal: 1 / e["factor"] - 1),
    "clogging@restriction.valve": ("flow_coefficient", lambda e, nominal: -e["fraction"]),
    "scale@command.valve_command": ("spool_gain", lambda e, nominal: e["factor"] - 1),
    # hydraulic drive
    "viscous_friction@force.shaft": ("viscous_friction", lambda e, nominal: e["coefficient"] / nominal),
    "added_mass@force.shaft": ("inertia", lambda e, nominal: e["mass"] / nominal),
    "laminar_leakage@flow.motor_in_motor_out": (
        "leakage_coefficient",
        lambda e, nominal: e["coefficient"] / nominal,
    ),
    "compliance_factor@compliance.motor_line": ("bulk_modulus", lambda e, nominal: e["factor"] - 1),
    "scale@command.valve": ("valve_gain", lambda e, nominal: e["factor"] - 1),
    "scale@transmission.motor": ("motor_efficiency", lambda e, nominal: e["factor"] - 1),
    "scale@transmission.pump": ("pump_efficiency", lambda e, nominal: 1 / e["factor"] - 1),
    "scale@transmission.displacement": ("displacement", lambda e, nominal: e["factor"] - 1),
    "scale@sensor.pump_pressure": ("pump_efficiency", lambda e, nominal: e["factor"] - 1),
    # pump-controlled cylinder; C_ea is at both pumps
    "laminar_leakage@flow.pump2_b_tank": ("external_leakage_b", lambda e, nominal: e["coefficient"] / nominal),
    "laminar_leakage@flow.pump2_a_tank": ("external_leakage_a", lambda e, nominal: e["coefficient"] / (2 * nominal)),
    "laminar_leakage@flow.pump1_a_tank": ("external_leakage_a", lambda e, nominal: e["coefficient"] / (2 * nominal)),
    # control valve
    "scale@command.coil_voltage": ("coil_force_factor", lambda e, nominal: e["factor"] - 1),
    "coulomb_friction@force.spool": ("spool_coulomb", lambda e, nominal: e["force"] / nominal),
    "viscous_friction@force.actuator": ("actuator_viscous", lambda e, nominal: e["coefficient"] / nominal),
    "clogging@restriction.fixed_restrictor": ("restrictor_cd", lambda e, nominal: -e["fraction"]),
    "clogging@restriction.nozzle": ("nozzle_cd_factor", lambda e, nominal: -e["fraction"]),
    "clogging@restriction.spool_ports": ("port_area", lambda e, nominal: -e["fraction"]),
}
# cooling circuit: its datasheet's notes, for each branch
PARAMETER_TWINS |= {
    "clogging@restriction.bench_valve",
    "lag@command.bench_valve_command",
    "lag@command.heat_load_command",
    "scale@command.heat_load_command",
    "compliance_factor@compliance.manifold",
    "droop@source.supply",
}
EXACT_TWIN["clogging@restriction.bench_valve"] = ("valve_coefficient", lambda e, nominal: -e["fraction"])
EXACT_TWIN["compliance_factor@compliance.manifold"] = ("manifold_volume", lambda e, nominal: 1 / e["factor"] - 1)
_BRANCHES = ["m", "v1", "v2", "v3", "t"]
for _b in _BRANCHES:
    _less = lambda e, nominal: -e["fraction"]
    EXACT_TWIN[f"clogging@restriction.{_b}_feed"] = (f"{_b}_feed_coefficient", _less)
    EXACT_TWIN[f"clogging@restriction.{_b}_drain"] = (f"{_b}_drain_coefficient", _less)
    EXACT_TWIN[f"clogging@restriction.{_b}_orifice"] = (f"{_b}_c", _less)
    EXACT_TWIN[f"scale@heat.{_b}_wall"] = (f"{_b}_heat_flux", lambda e, nominal: e["factor"] - 1)
    PARAMETER_TWINS |= {f"clogging@restriction.{_b}_{_place}" for _place in ("feed", "drain", "orifice")}
    PARAMETER_TWINS |= {f"{_effect}@heat.{_b}_wall" for _effect in ("scale", "heat_loss", "heat_capacity")}
    PARAMETER_TWINS |= {f"orifice_leakage@flow.{_b}_{_place}_ambient" for _place in ("inlet", "outlet", "drain")}
    PARAMETER_TWINS |= {f"laminar_leakage@flow.{_b}_{_place}_ambient" for _place in ("inlet", "outlet")}
# Other rigs' names for the same parameter.
SAME_PARAMETER = {"viscous_damping": "viscous_friction"}


def twin_tolerances(key, values, parameters, tolerance):
    """By how many tolerances a parameter would have to be off to pass for the effect exactly; infinite if none can."""
    if key not in EXACT_TWIN:
        return float("inf")
    name, shift = EXACT_TWIN[key]
    if name not in parameters:
        name = SAME_PARAMETER.get(name)
    if name not in parameters:
        return float("inf")
    return abs(shift(values, parameters[name])) / tolerance[name]


# Groups whose members one run may not tell apart (the datasheet's notes, cosine 0.93 and above, and their logic).
_GROUPS = [
    ["lag@command.valve_command", "delay@command.valve_command", "second_order_lag@command.valve_command"],
    ["orifice_leakage@flow.chamber_a_chamber_b", "laminar_leakage@flow.chamber_a_chamber_b"],
    ["offset@sensor.chamber_a_pressure", "scale@sensor.chamber_a_pressure"],
    [
        "coulomb_friction@force.piston",
        "load_dependent_friction@force.piston",
        "viscous_friction@force.piston",
        "stribeck_friction@force.piston",
    ],
    ["asymmetric_friction@force.piston", "load_force@force.piston"],
    ["scale@command.valve_command", "gain_curve@command.valve_command", "clogging@restriction.valve"],
    ["entrained_air@compliance.chambers", "compliance_factor@compliance.chambers"],
    ["droop@source.supply_pressure", "offset@source.supply_pressure", "clogging@restriction.valve"],
    ["clogging@restriction.valve", "area_curve@restriction.valve", "gain_curve@command.valve_command"],
    ["area_curve@restriction.valve", "deadband@restriction.valve"],
    ["deadband@command.valve_command", "hysteresis@command.valve_command"],
    ["deadband@command.valve_command", "gain_curve@command.valve_command"],
    ["saturation@command.valve_command", "gain_curve@command.valve_command", "rate_limit@command.valve_command"],
    ["rate_limit@command.valve_command", "lag@command.valve_command"],
    ["offset@command.valve_command", "offset@sensor.spool_position"],
    ["scale@command.valve_command", "scale@sensor.spool_position"],
    ["offset@sensor.load_pressure", "offset@sensor.chamber_a_pressure"],
    ["offset@sensor.load_pressure", "offset@sensor.chamber_b_pressure"],
    ["backlash@transmission.rod", "elasticity@transmission.rod"],
    ["added_mass@force.piston", "elasticity@transmission.rod"],
    ["load_force@force.piston", "end_stop@force.piston"],
    ["orifice_leakage@flow.chamber_a_tank", "orifice_leakage@flow.chamber_b_tank"],
    ["line_inertia@line.valve_cylinder", "lag@command.valve_command"],
    ["quantisation@sensor.position", "lag@sensor.position"],
    ["scale@sensor.position", "drift@sensor.position"],
    # hydraulic drive: the notes, and what follows from its equations at positive speed
    ["scale@command.valve", "clogging@restriction.valve", "gain_curve@command.valve"],
    ["offset@sensor.pump_pressure", "load_force@force.shaft", "coulomb_friction@force.shaft"],
    ["drift@sensor.pump_pressure", "offset@sensor.pump_pressure"],
    ["scale@sensor.pump_pressure", "scale@transmission.pump"],
    ["load_dependent_friction@force.shaft", "scale@transmission.motor", "scale@sensor.motor_pressure"],
    [
        "coulomb_friction@force.shaft",
        "load_dependent_friction@force.shaft",
        "viscous_friction@force.shaft",
        "stribeck_friction@force.shaft",
    ],
    ["viscosity_drift@source.oil", "viscous_friction@force.shaft"],
    ["viscosity_drift@source.oil", "laminar_leakage@flow.motor_in_motor_out"],
    ["laminar_leakage@flow.motor_in_motor_out", "orifice_leakage@flow.motor_in_motor_out"],
    ["entrained_air@compliance.motor_line", "compliance_factor@compliance.motor_line"],
    ["line_inertia@line.motor", "compliance_factor@compliance.motor_line"],
    ["added_mass@force.shaft", "elasticity@transmission.shaft"],
    ["lag@command.valve", "delay@command.valve", "rate_limit@command.valve"],
    ["lag@sensor.shaft_speed", "delay@sensor.shaft_speed"],
    ["lag@sensor.motor_pressure", "delay@sensor.motor_pressure"],
    ["lag@sensor.pump_pressure", "delay@sensor.pump_pressure"],
    ["deadband@command.valve", "offset@command.valve", "hysteresis@command.valve"],
    ["area_curve@restriction.valve", "gain_curve@command.valve", "offset@command.valve"],
    ["saturation@command.valve", "gain_curve@command.valve"],
    ["droop@source.supply", "offset@sensor.supply_pressure", "scale@sensor.supply_pressure"],
    ["droop@source.supply", "clogging@restriction.valve"],
    ["offset@sensor.supply_pressure", "clogging@restriction.valve"],
    ["scale@sensor.supply_pressure", "clogging@restriction.valve"],
    ["scale@sensor.shaft_speed", "scale@transmission.displacement"],
    ["offset@sensor.shaft_speed", "drift@sensor.shaft_speed"],
    ["offset@sensor.motor_pressure", "drift@sensor.motor_pressure"],
    ["offset@sensor.motor_pressure", "scale@sensor.motor_pressure"],
    # pump-controlled cylinder: the notes, and what follows from its equations
    [
        "laminar_leakage@flow.pump2_a_tank",
        "laminar_leakage@flow.pump1_a_tank",
        "orifice_leakage@flow.pump1_a_tank",
        "speed_leakage@flow.pump1_a_tank",
    ],
    [
        "laminar_leakage@flow.pump2_a_b",
        "laminar_leakage@flow.chamber_a_chamber_b",
        "orifice_leakage@flow.pump2_a_b",
        "orifice_leakage@flow.chamber_a_chamber_b",
        "speed_leakage@flow.pump2_a_b",
    ],
    [
        "laminar_leakage@flow.pump2_b_tank",
        "orifice_leakage@flow.pump2_b_tank",
        "relief_opening@flow.pump2_b_tank",
    ],
    ["viscosity_drift@source.oil", "laminar_leakage@flow.pump2_a_b", "viscous_friction@force.piston"],
    ["offset@sensor.pump2_speed", "laminar_leakage@flow.pump2_a_b", "viscosity_drift@source.oil"],
    ["offset@sensor.pump1_speed", "laminar_leakage@flow.pump1_a_tank", "viscosity_drift@source.oil"],
    ["scale@sensor.pump2_speed", "scale@command.pump2_speed", "displacement_ripple@source.pump2"],
    ["lag@command.pump2_speed", "rate_limit@command.pump2_speed"],
    ["offset@sensor.chamber_a_pressure", "drift@sensor.chamber_a_pressure"],
    ["offset@sensor.chamber_b_pressure", "scale@sensor.chamber_b_pressure", "drift@sensor.chamber_b_pressure"],
    ["entrained_air@compliance.chamber_a", "compliance_factor@compliance.chamber_a"],
    ["entrained_air@compliance.chamber_b", "compliance_factor@compliance.chamber_b"],
    ["line_inertia@line.a", "compliance_factor@compliance.chamber_a"],
    ["line_inertia@line.b", "compliance_factor@compliance.chamber_b"],
    ["backlash@transmission.plate", "lag@sensor.position"],
    # control valve: the notes, and what follows where the spool is not measured
    [
        "orifice_leakage@flow.prestage_ambient",
        "clogging@restriction.fixed_restrictor",
        "clogging@restriction.nozzle",
        "offset@command.coil_voltage",
        "scale@command.coil_voltage",
    ],
    ["asymmetric_friction@force.spool", "load_force@force.spool"],
    ["asymmetric_friction@force.actuator", "load_force@force.actuator"],
    [
        "coulomb_friction@force.actuator",
        "asymmetric_friction@force.actuator",
        "viscous_friction@force.actuator",
        "stribeck_friction@force.actuator",
    ],
    ["coulomb_friction@force.spool", "hysteresis@force.spool"],
    ["coulomb_friction@force.valve", "load_dependent_friction@force.valve", "scale@sensor.load_torque"],
    ["orifice_leakage@flow.cylinder_ambient", "load_force@force.spool", "asymmetric_friction@force.spool"],
    ["clogging@restriction.spool_ports", "deadband@restriction.spool_ports", "droop@source.supply"],
    ["droop@source.supply", "offset@source.supply"],
    ["scale@sensor.flow", "clogging@restriction.process_valve"],
    ["offset@sensor.flow", "scale@sensor.flow", "area_curve@restriction.process_valve"],
    ["lag@sensor.flow", "delay@sensor.flow"],
    ["lag@sensor.cylinder_pressure", "compliance_factor@compliance.cylinder"],
    ["offset@sensor.prestage_pressure", "scale@sensor.prestage_pressure"],
    ["offset@sensor.cylinder_pressure", "scale@sensor.cylinder_pressure", "load_force@force.actuator"],
    ["offset@sensor.valve_position", "scale@sensor.valve_position"],
    ["backlash@transmission.linkage", "elasticity@transmission.linkage"],
]

_GROUPS += [
    ["lag@command.bench_valve_command", "delay@command.bench_valve_command", "rate_limit@command.bench_valve_command"],
    ["deadband@command.bench_valve_command", "hysteresis@command.bench_valve_command"],
    ["gain_curve@command.bench_valve_command", "area_curve@restriction.bench_valve"],
    ["lag@command.heat_load_command", "delay@command.heat_load_command"],
    ["offset@source.supply", "offset@sensor.supply_pressure", "drift@sensor.supply_pressure"],
    ["droop@source.supply", "clogging@restriction.bench_valve", "area_curve@restriction.bench_valve"],
    ["entrained_air@compliance.manifold", "compliance_factor@compliance.manifold", "line_inertia@line.feed"],
]
for _b in _BRANCHES:
    _leak = lambda place, kinds=("orifice", "laminar"), b=_b: [f"{k}_leakage@flow.{b}_{place}_ambient" for k in kinds]
    _GROUPS += [
        _leak("inlet") + [f"clogging@restriction.{_b}_feed", f"clogging@restriction.{_b}_orifice"],
        _leak("outlet") + [f"clogging@restriction.{_b}_orifice", f"scale@sensor.{_b}_mass_flow"],
        _leak("drain", ("orifice",)) + [f"clogging@restriction.{_b}_drain"],
        [f"clogging@restriction.{_b}_orifice", f"area_curve@restriction.{_b}_orifice"],
        [f"heat_loss@heat.{_b}_wall", f"scale@heat.{_b}_wall", f"offset@sensor.{_b}_outlet_temperature"],
        [f"heat_capacity@heat.{_b}_wall", f"lag@sensor.{_b}_outlet_temperature"],
        [f"lag@sensor.{_b}_mass_flow", f"delay@sensor.{_b}_mass_flow"],
        [f"offset@sensor.{_b}_mass_flow", f"scale@sensor.{_b}_mass_flow", f"clogging@restriction.{_b}_drain"],
        [f"offset@sensor.{_b}_inlet_temperature", f"drift@sensor.{_b}_inlet_temperature"],
        [f"offset@sensor.{_b}_outlet_temperature", f"drift@sensor.{_b}_outlet_temperature"],
        [
            f"{_e}@sensor.{_b}_{_place}_pressure"
            for _e in ("offset", "scale", "drift")
            for _place in ("inlet", "outlet")
        ],
    ]


def rivals(key, known):
    """Effects that could be mistaken for this one and that the datasheet knows."""
    found = []
    for group in _GROUPS:
        if key in group:
            found += [other for other in group if other != key and other in known and other not in found]
    return found


def withheld(key, known):
    """What the open part takes out of the library with an effect: its near-equivalents and its family at the same
    port."""
    effect, port = key.split("@")
    same = [
        other
        for other in known
        if other != key and other.split("@")[1] == port and FAMILY.get(other.split("@")[0]) == FAMILY.get(effect)
    ]
    return [key] + rivals(key, known) + [other for other in same if other not in rivals(key, known)]


def family(key):
    return FAMILY.get(key.split("@")[0], key.split("@")[0])


def place_kind(port):
    return "sensor" if port.startswith("sensor.") else "process"
