"""An independent truth of the servo actuator, for the check of `faultline gap` on effects that are withheld.

Shares no code with src/; takes only the datasheet's numbers. Integrated by LSODA (stiff, variable step), restarted at
every sample and wherever a held command changes. Where physics allows, the formula is another one than the datasheet's:

    friction            LuGre bristles (datasheet: set-valued Coulomb + Stribeck); extra Stribeck part with sech^2
    orifices            y / (|y|^3 + d^3)^(1/6) in place of y / (y^2 + d^2)^(1/4)
    supply              pump with a soft characteristic, a state of its own; measured at its outlet
    entrained air       polytropic, exponent 1.1 (so its fraction is not the datasheet's number to the last digit)
    deadband, overlap   softplus blend;     saturation  high-order rational blend;     hysteresis  three plays in
    parallel droop               solved exactly for the drawn flow (quadratic)
    end stop, backlash  contacts after Hunt and Crossley
    lags                exact between samples;   delay  exact shift, the command changes within a sample
Small nuisance effects that no datasheet lists: friction that varies along the stroke, oil that warms up, a valve with a
trace of hysteresis, transducers a little off, a filter on the pressure channels. Each stays well below the sensor
noise.

States: x, v, p_a, p_b, x_v, P_s, z (bristle); with a rod effect also x_l, v_l, z_l; with line inertia also p_va, q_a,
p_vb, q_b. SI units throughout.
"""
import math

import numpy as np
from scipy.integrate import ode

import excitation
import rate_servo_actuator as rate
from friction_laws import SPREAD
from signal_paths import CommandPath, Sensor, split

BRISTLE = 1.0e8  # N/m: 400 N of friction winds the seals up by 4 um; softer ones would be a gap of their own
CONTACT = 1.0e7  # N/m, backlash flanks
COUPLING_STIFFNESS = 4.0e7  # N/m, rod coupling when only the other rod effect is asked for
DURATION = 20.0  # s, of a run
BUDGET = 60.0  # s, of all runs of a random truth together
STIFF_BRISTLE = 6.0e8  # N/m: nearly the datasheet's set-valued friction
OUTPUTS = ["position", "velocity", "load_pressure", "chamber_a_pressure", "chamber_b_pressure", "spool_position"]
PARAMETERS = [
    "ram_area",
    "moving_mass",
    "viscous_damping",
    "coulomb_friction",
    "static_excess",
    "stribeck_velocity",
    "compliance",
    "chamber_volume",
    "flow_coefficient",
    "spool_time_constant",
    "spool_gain",
]
NO_NUISANCE = {
    "stroke_friction": 0.0,
    "warming": 0.0,
    "spool_hysteresis": 0.0,
    "gain_error": 0.0,
    "pressure_filter": 0.0,
    "bristle": BRISTLE,
}
# Classes of a random truth (truth_classes.py): what each variant puts in the nuisance's place.
VARIANTS = {
    "friction": {
        "set_valued": {"bristle": STIFF_BRISTLE},
        "lugre": {"bristle": (5e5, 5e7)},
        "dahl": {"bristle": (1e6, 1e8), "shape": (1.2, 3.0)},
        "maxwell": {"bristle": (5e5, 3e7), "maxwell": 1.0},
        "position": {"stroke_friction": (-0.5, 0.5)},
        "temperature": {"warming": (-1.2e-2, -1e-3)},
    },
    "valve": {
        "second_order": {"spool_damping": (0.35, 0.9)},
        "overlap": {"lap": (0.005, 0.15), "rounding": (1e-3, 5e-3)},
        "underlap": {"lap": (-0.5, -0.02), "rounding": (1e-3, 5e-3)},
        "null_leakage": {"rounding": (1e-2, 0.2)},
        "hysteresis": {"spool_hysteresis": (5e-3, 0.15)},
        "uneven": {"uneven": (-0.06, 0.06)},
    },
    "supply": {
        "pulsation": {"pulsation": (5e4, 8e5), "pulsation_frequency": (30.0, 300.0)},
        "line": {"line": (1e8, 3e9)},
    },
    "hose": {"stiffening": {"stiffening": (-0.6, 0.6)}, "air": {"air": (2e-4, 2e-2)}},
    "integrator": {"loose": {"tolerance": 30.0}, "tight": {"tolerance": 0.03}},
}


def draw_nuisance(random):
    return {
        "stroke_friction": random.uniform(-0.006, 0.006),
        "warming": random.uniform(-1e-3, 0.0),
        "spool_hysteresis": random.uniform(0.0, 0.003),
        "gain_error": random.uniform(-3e-4, 3e-4),
        "pressure_filter": random.uniform(5e-6, 2e-5) if random.random() < 0.5 else 0.0,
    }


class Truth:
    """The rig with given parameters and effects. What the check asks of a truth: the names below, again(), run(),
    base() and replay().

    parameters: name -> value; effects: "effect@port" -> {parameter: value}; supply_wander(t) and load(t): callables.
    """

    COMMAND, OUTPUTS, PARAMETERS = "valve_command", OUTPUTS, PARAMETERS
    WINDOW = 160  # samples after which a replay starts from the true state again
    QUIET = {"bristle": STIFF_BRISTLE}  # the nuisance without which nothing but the datasheet's equations is left

    def __init__(
        self, datasheet, parameters=None, effects=None, nuisance=None, supply=None, load=None, bypass_volts=0.0
    ):
        self.sheet = datasheet
        self.p = dict(datasheet.nominal)
        self.p.update(parameters or {})
        self.effects = effects or {}
        self.ports = split(self.effects)
        self.nuisance = dict(NO_NUISANCE)
        self.nuisance.update(nuisance or {})
        level = datasheet.constants.get("supply_pressure_set", 6.89e6)
        self.supply = supply or excitation.Tones(level)
        self.load = load or excitation.Tones(0.0)
        self.bristle = self.nuisance["bristle"]
        self.bypass_volts = bypass_volts
        self.period = datasheet.sample_period
        self.drive = [0.0, 0.0, 0.0, 1.0, 0.0]
        rod = self.ports.get("transmission.rod", {})
        self.has_rod = bool(rod)
        self.inertance = self.ports.get("line.valve_cylinder", {}).get("line_inertia", {}).get("inertance", 0.0)
        self.rod_index = 7
        self.line_index = 7 + (3 if self.has_rod else 0)
        self.maxwell_index = self.line_index + (4 if self.inertance > 0 else 0)
        self.spool_index = self.maxwell_index + (2 if self.nuisance.get("maxwell") else 0)
        self.size = self.spool_index + (1 if self.nuisance.get("spool_damping") else 0)
        self.compiled = isinstance(self.supply, excitation.Tones) and isinstance(self.load, excitation.Tones)
        self.constants = np.zeros(1, rate.CONSTANTS).view(np.recarray)
        self._constants()

    def again(self, parameters, effects, nuisance):
        """The same rig under the same supply and load, otherwise changed."""
        return Truth(self.sheet, parameters, effects, nuisance, self.supply, self.load)

    def _constants(self):
        """The record of constants that the right-hand side reads."""
        p, ports, c = self.p, self.ports, self.constants[0]
        c.area, c.volume, c.viscous = p["ram_area"], p["chamber_volume"], p["viscous_damping"]
        c.coulomb, c.excess, c.stribeck = p["coulomb_friction"], p["static_excess"], p["stribeck_velocity"]
        c.tau_v, c.spool_gain = p["spool_time_constant"], p["spool_gain"]
        c.stop, c.stop_k, c.stop_d = p["stroke_limit"], p["stop_stiffness"], p["stop_damping"]
        c.bristle = self.bristle
        c.stroke_friction, c.warming = self.nuisance["stroke_friction"], self.nuisance["warming"]
        more = lambda name, nothing=0.0: self.nuisance.get(name) or nothing
        c.shape, c.maxwell, c.maxwell_index = more("shape", 1.0), more("maxwell"), self.maxwell_index
        c.spool_damping, c.spool_index = more("spool_damping"), self.spool_index
        c.second_order = c.spool_damping > 0
        c.lap, c.rounding, c.uneven = more("lap"), more("rounding"), more("uneven")
        c.pulsation, c.pulsation_w = more("pulsation"), 2 * math.pi * more("pulsation_frequency")
        c.line, c.stiffening = more("line"), more("stiffening")

        f = ports.get("force.piston", {})
        c.more_coulomb = f.get("coulomb_friction", {}).get("force", 0.0)
        c.more_viscous = f.get("viscous_friction", {}).get("coefficient", 0.0)
        c.more_excess = f.get("stribeck_friction", {}).get("static_excess", 0.0)
        c.more_velocity = f.get("stribeck_friction", {}).get("velocity", 0.05)
        c.asymmetry = f.get("asymmetric_friction", {}).get("difference", 0.0)
        c.by_load = f.get("load_dependent_friction", {}).get("coefficient", 0.0)
        c.push, c.spring = f.get("load_force", {}).get("constant", 0.0), f.get("load_force", {}).get("stiffness", 0.0)
        end = f.get("end_stop")
        c.end_x, c.end_k = (end["position"], end["stiffness"]) if end else (0.0, 0.0)
        c.extra_friction = bool(c.more_coulomb or c.more_excess or c.asymmetry or c.by_load)

        ab = ports.get("flow.chamber_a_chamber_b", {})
        c.leak_ab = ab.get("orifice_leakage", {}).get("coefficient", 0.0) + p["leak_valve_gain"] * max(
            self.bypass_volts, 0.0
        )
        c.laminar_ab = ab.get("laminar_leakage", {}).get("coefficient", 0.0)
        c.leak_a = ports.get("flow.chamber_a_tank", {}).get("orifice_leakage", {}).get("coefficient", 0.0)
        c.leak_b = ports.get("flow.chamber_b_tank", {}).get("orifice_leakage", {}).get("coefficient", 0.0)
        c.any_leak = bool(c.leak_ab or c.laminar_ab or c.leak_a or c.leak_b)
        oil = ports.get("compliance.chambers", {})
        c.air = oil.get("entrained_air", {}).get("fraction", 0.0) + more("air")
        c.bulk = p["chamber_volume"] / (2 * p["compliance"]) * oil.get("compliance_factor", {}).get("factor", 1.0)
        lands = ports.get("restriction.valve", {})
        c.flow_gain = p["flow_coefficient"] * math.sqrt(2.0) * (1 - lands.get("clogging", {}).get("fraction", 0.0))
        c.exponent = lands.get("area_curve", {}).get("exponent", 1.0)
        c.overlap = lands.get("deadband", {}).get("width", 0.0)
        source = ports.get("source.supply_pressure", {})
        c.droop = source.get("droop", {}).get("resistance", 0.0)
        c.ripple = source.get("ripple", {}).get("amplitude", 0.0)
        c.ripple_w = 2 * math.pi * source.get("ripple", {}).get("frequency", 1.0)
        c.supply_offset = source.get("offset", {}).get("value", 0.0)

        c.has_rod, c.has_line = self.has_rod, self.inertance > 0
        c.rod_index, c.line_index, c.inertance = self.rod_index, self.line_index, self.inertance
        share_m = p["load_mass_share"] if self.has_rod else 0.0
        c.share_f = p["load_friction_share"] if self.has_rod else 0.0
        c.piston_mass = p["moving_mass"] * (1 - share_m) + f.get("added_mass", {}).get("mass", 0.0)
        c.load_mass = p["moving_mass"] * share_m
        rod = ports.get("transmission.rod", {})
        c.gap = rod.get("backlash", {}).get("gap", 0.0)
        if "elasticity" in rod:
            c.rod_k, c.rod_d = 1 / rod["elasticity"]["compliance"], rod["elasticity"]["damping"]
        else:
            c.rod_k, c.rod_d = CONTACT, 3.0e3
        if self.compiled:
            for name, tones in (("supply", self.supply), ("load", self.load)):
                setattr(c, name + "_level", tones.level)
                for field, values in zip("awp", zip(*tones.terms)):
                    getattr(c, f"{name}_{field}")[:] = values
        self.leak_coefficient = c.leak_ab

    def rhs(self, t, y):
        """dy/dt, with whatever functions of time supply and load are."""
        c, dy = self.constants[0], np.zeros(len(y))
        if not self.compiled:
            c.supply_level, c.load_level = self.supply(t), self.load(t)
        rate.rate(t, np.asarray(y, dtype=float), c, np.array(self.drive, dtype=float), dy)
        return dy.tolist()

    def absolute_tolerance(self):
        tolerance = [1e-8, 1e-6, 20.0, 20.0, 1e-5, 20.0, 1e-9]
        if self.has_rod:
            tolerance += [1e-8, 1e-6, 1e-9]
        if self.inertance > 0:
            tolerance += [20.0, 1e-9, 20.0, 1e-9]
        return tolerance + [1e-9] * (self.spool_index - self.maxwell_index) + [1e-2] * (self.size - self.spool_index)

    def start(self, base=None, t=0.0, speed_sign=1.0):
        """A full state from base states (or rest), with the effect's own states where they would settle.

        The base is x, v, p_a, p_b, x_v, P_s and the bristle's force, which a truth with other bristles can take over;
        then the windings of a Maxwell body's other elements and the spool's speed, where the truth has them.
        """
        ps = self.supply(t)
        y = list(base[:7]) if base is not None else [0.0, 0.0, ps / 2, ps / 2, 0.0, ps, 0.0]
        own = list(base[7:]) if base is not None and len(base) > 7 else []  # of a truth like this one
        maxwell, second = self.spool_index > self.maxwell_index, self.size > self.spool_index
        windings = own[:2] if maxwell and len(own) >= 2 else [0.0, 0.0] * maxwell
        if windings:
            y[6] -= self.bristle * (SPREAD[0] * windings[0] + SPREAD[2] * windings[1])
        spool = ([own[-1]] if len(own) % 2 else [0.0]) if second else []
        y[6] /= self.bristle
        if self.has_rod:
            share = self.p["load_friction_share"]
            z = y[6]
            y[6] = (1 - share) * z
            held = share * self.bristle * z + self.load(t)
            rod = self.ports["transmission.rod"]
            stiffness = 1 / rod["elasticity"]["compliance"] if "elasticity" in rod else CONTACT
            play = rod.get("backlash", {}).get("gap", 0.0) / 2
            side = math.copysign(1.0, held) if abs(held) > 1 else speed_sign
            y += [y[0] - held / stiffness - side * play, y[1], share * z]
        if self.inertance > 0:
            y += [y[2], self.p["ram_area"] * y[1], y[3], self.p["ram_area"] * y[1]]
        return y + windings + spool

    def base(self, y):
        """The base of a full state (for a model without the rod's or the line's states)."""
        y = list(y)
        if self.has_rod:
            y[6] += y[self.rod_index + 2]
        y[6] *= self.bristle
        if self.spool_index > self.maxwell_index:
            first, last = y[self.maxwell_index : self.spool_index]
            y[6] += self.bristle * (SPREAD[0] * first + SPREAD[2] * last)
        return y[:7] + y[self.maxwell_index :]

    def solver(self, tolerance=1e-5):
        tolerance *= self.nuisance.get("tolerance") or 1.0
        return ode(rate.FORTRAN if self.compiled else self.rhs).set_integrator(
            "lsoda", rtol=tolerance, atol=self.absolute_tolerance(), nsteps=20000
        )

    def advance(self, solver, y, pieces):
        rate.NOW[:] = self.constants
        for start, end, *drive in pieces:
            self.drive = rate.DRIVE[:] = (*drive, start)
            solver.set_initial_value(y, start)
            y = solver.integrate(end)
            if not solver.successful():
                raise RuntimeError(f"the truth could not be integrated past t = {start:.4f} s")
        return y

    def measured(self, y, sensors, t):
        """Outputs behind the transducers, without noise."""
        return (
            sensors[0](t, y[0]),
            sensors[1](t, y[1]),
            sensors[2](t, y[2] - y[3]),
            sensors[3](t, y[2]),
            sensors[4](t, y[3]),
            sensors[5](t, y[4]),
        )

    def sensors(self):
        n = self.nuisance
        made = []
        for index, name in enumerate(OUTPUTS):
            pressure = name.endswith("pressure")
            made.append(
                Sensor(
                    self.ports.get("sensor." + name, {}),
                    self.period,
                    1 + n["gain_error"] * (-1) ** index if name != "position" else 1.0,
                    n["pressure_filter"] if pressure else 0.0,
                )
            )
        return made

    def run(self, duration, controller, noise_scale=1.0, seed=0, y0=None, tolerance=1e-5):
        """Simulate with a controller; returns a dictionary of channel arrays (as recorded) and `states`, `clean`.

        controller(k, measured) -> command, called once per sample with the measured channels of that sample.
        Noise in the recording is the datasheet's times noise_scale; the controller has its own, quieter path (one
        times). """
        sheet, h = self.sheet, self.period
        count = int(round(duration / h))
        random = np.random.default_rng(seed)
        path = CommandPath(self.ports.get("command.valve_command", {}), h, self.nuisance["spool_hysteresis"], 10.0)
        sensors = self.sensors()
        std = [sheet.noise[c] for c in OUTPUTS]
        step = [sheet.resolution[c] for c in OUTPUTS]
        white = random.standard_normal((count, 6))
        more = random.standard_normal((count, 6)) * math.sqrt(max(noise_scale**2 - 1, 0.0))
        low = [0.0 if sheet.range[c][0] == 0 else -math.inf for c in OUTPUTS]
        solver = self.solver(tolerance)
        y = self.start(y0)
        states = np.empty((count, self.size))
        clean = np.empty((count, 6))
        record = {c: np.zeros(count) for c in sheet.channels}
        rows = [record[c] for c in OUTPUTS]
        command = record["valve_command"]
        dac = sheet.resolution["valve_command"]
        supply, load, reference = record["supply_pressure"], record["load_force"], record["position_reference"]
        own_noise = min(noise_scale, 1.0)
        for k in range(count):
            t = k * h
            states[k] = y
            values = self.measured(y, sensors, t)
            clean[k] = values
            seen = {}
            for c in range(6):
                noise = own_noise * white[k, c] * std[c]
                own = sensors[c].last(t, values[c] + noise)
                seen[OUTPUTS[c]] = own
                logged = (
                    own
                    if noise_scale <= 1 or "stuck" in sensors[c].e
                    else sensors[c].last(t, values[c] + noise + more[k, c] * std[c])
                )
                rows[c][k] = max(low[c], math.floor(logged / step[c] + 0.5) * step[c])
            supply[k], load[k] = y[5], self.load(t)
            seen["supply_pressure"], seen["load_force"] = y[5], load[k]
            volts, reference[k] = controller(k, seen)
            volts = dac * math.floor(min(max(volts, -10.0), 10.0) / dac + 0.5)
            command[k] = volts
            y = self.advance(solver, y, path.pieces(k, volts))
        for name in ("supply_pressure", "load_force", "leak_flow"):
            noisy = record[name] + noise_scale * sheet.noise[name] * random.standard_normal(count)
            if sheet.range[name][0] == 0:
                noisy = np.maximum(noisy, 0.0)
            if sheet.resolution[name] > 0:
                noisy = np.round(noisy / sheet.resolution[name]) * sheet.resolution[name]
            record[name] = noisy
        return {"t": np.arange(count) * h, "record": record, "states": states, "clean": clean, "truth": self}

    def replay(self, commands, windows, starts, tolerance=1e-5):
        """Outputs without noise on windows (first, last+1) of a run, each started from a state, driven by given
        commands.

        Memory of the command path and of the transducers is taken along from the start of the run: the path sees every
        command, a transducer starts settled at the window's first value.
        """
        path = CommandPath(
            self.ports.get("command.valve_command", {}), self.period, self.nuisance["spool_hysteresis"], 10.0
        )
        solver = self.solver(tolerance)
        clean = []
        k = 0
        for (first, last), base in zip(windows, starts):
            while k < first:
                path.pieces(k, commands[k])
                k += 1
            y = self.start(base, first * self.period, 1.0 if base[1] >= 0 else -1.0)
            sensors = self.sensors()
            for k in range(first, last):
                values = self.measured(y, sensors, k * self.period)
                clean.append([s.last(k * self.period, value) for s, value in zip(sensors, values)])
                y = self.advance(solver, y, path.pieces(k, commands[k]))
            k = last
        return np.array(clean)
