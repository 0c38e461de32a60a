"""An independent truth of the hydraulic drive, for the check of `faultline gap` on effects that are withheld.

Shares no code with src/; takes only the datasheet's numbers. Integrated by Dormand and Prince's method with its own
step control (rate_hydraulic_drive.py), restarted at every sample and wherever a held command changes. Where physics
allows, the formula is another one than the datasheet's:

    orifices            y / (|y|^3 + d^3)^(1/6) in place of y / (y^2 + d^2)^(1/4)
    dry friction        bristles that take it up over 2 mrad (datasheet: set-valued); Stribeck part with sech^2
    supply              power unit with a soft characteristic and wander, a state of its own; measured at its outlet
    load pressure       load valve behind three lags, flutter on top; runs smoothly between samples
    entrained air       polytropic, exponent 1.1 (so its fraction is not the datasheet's number to the last digit)
    deadband            softplus blend
    saturation          high-order rational blend
    hysteresis          three plays in parallel
    droop               solved exactly for the drawn flow (quadratic)
    lags                exact between samples;   delay  exact shift: the command changes within a sample, a transducer's
                        reading is a cubic between samples
Small nuisance effects that no datasheet lists: a motor of nine pistons that pulsates, seals that rub a little, oil that
warms up, a valve with a trace of hysteresis, transducers a little off, a filter on the pressure channels. Each stays
below the sensor noise.

States: x_1, X_s, P_m, S_s (pump end), shaft angle, bristle, P_s, three lags of P_p; with line inertia also the
pressure at the valve and the column's flow; with elasticity the motor end's speed and the twist. SI units throughout.
"""
import math

import numpy as np

import excitation_hydraulic_drive as excitation
import rate_hydraulic_drive as rate
from signal_paths import CommandPath, Sensor, Transducers, split

DURATION = 30.0  # s, of a run
BUDGET = 180.0  # s, of all runs of a random truth together
OUTPUTS = ["motor_pressure", "shaft_speed"]
INPUTS = ["supply_pressure", "pump_pressure"]
PARAMETERS = [
    "valve_time_constant_1",
    "valve_time_constant_2",
    "valve_gain",
    "flow_coefficient",
    "displacement",
    "trapped_volume",
    "bulk_modulus",
    "leakage_coefficient",
    "motor_efficiency",
    "pump_efficiency",
    "inertia",
    "viscous_friction",
]
NO_NUISANCE = {
    "pulsation": 0.0,
    "seal_friction": 0.0,
    "warming": 0.0,
    "spool_hysteresis": 0.0,
    "gain_error": 0.0,
    "pressure_filter": 0.0,
}
# Classes of a random truth (truth_classes.py): what each variant puts in the nuisance's place. dry: N m.
VARIANTS = {
    "friction": {
        "set_valued": {"dry": (0.02, 0.4), "winding": 2e-4},
        "lugre": {"dry": (0.02, 0.4), "winding": (4e-4, 4e-2)},
        "dahl": {"dry": (0.02, 0.4), "winding": (4e-4, 4e-2), "shape": (1.2, 3.0)},
        "maxwell": {"dry": (0.02, 0.4), "winding": (1e-3, 2e-2), "maxwell": 1.0},
        "position": {"dry": (0.05, 0.4), "turn": (0.2, 0.9)},
        "temperature": {"warming": (-6e-3, -4e-4)},
    },
    "valve": {
        "second_order": {"damping": (0.35, 0.8)},
        "overlap": {"overlap": (2e-7, 8e-6)},
        "null_leakage": {"null_opening": (1e-6, 3e-5)},
        "hysteresis": {"spool_hysteresis": (1.5e-3, 2e-2)},
    },
    "supply": {
        "pulsation": {"hum": (1e4, 4e5), "hum_frequency": (15.0, 200.0)},
        "line": {"line": (1e8, 3e9)},
        "motor_pulsation": {"pulsation": (1e-2, 0.1)},
    },
    "hose": {"stiffening": {"stiffening": (-0.3, 0.3)}, "air": {"air": (1e-4, 1e-2)}},
    "integrator": {"loose": {"tolerance": 30.0}, "tight": {"tolerance": 0.03}, "cash_karp": {"tolerance": -1.0}},
}
TOLERANCE = 1e-5
STIFFEST = 2.0e-4  # rad/(N m), where a search asks for a spring that yields to nothing
# Of the states, for the integrator's error.
SCALE = np.array([1e-4, 1e-4, 1e6, 50.0, 10.0, 1.0, 1e7, 1e6, 1e6, 1e6, 1.0, 1.0])


def draw_nuisance(random):
    return {
        "pulsation": random.uniform(0.0, 2e-3),
        "seal_friction": random.uniform(0.0, 5e-3),
        "warming": random.uniform(-3e-4, 0.0),
        "spool_hysteresis": random.uniform(0.0, 1.5e-3),
        "gain_error": random.uniform(-3e-4, 3e-4),
        "pressure_filter": random.uniform(1e-4, 5e-4) if random.random() < 0.5 else 0.0,
    }


class Truth:
    """The rig with given parameters and effects; the names that the check asks for are told in truth_servo_actuator.py.

    supply: (level, tones), load: (set value over time, tones), as of excitation_hydraulic_drive; given: supply and load
    pressure at the samples in place of both, linear in between, and what replays of the run share.
    """

    COMMAND, OUTPUTS, PARAMETERS = "valve_voltage", OUTPUTS, PARAMETERS
    WINDOW = 150
    QUIET = {}

    def __init__(self, datasheet, parameters=None, effects=None, nuisance=None, supply=None, load=None, given=None):
        self.sheet, self.period = datasheet, datasheet.sample_period
        self.p = dict(datasheet.nominal)
        self.p.update(parameters or {})
        self.effects, self.ports = effects or {}, split(effects or {})
        self.nuisance = dict(NO_NUISANCE)
        self.nuisance.update(nuisance or {})
        self.supply, self.load, self.given = supply or (1.432e7, []), load or (lambda t: 3.5e6, []), given
        self.has_spring = bool(self.ports.get("transmission.shaft"))
        self.inertance = self._effect("line.motor", "line_inertia", "inertance", 0.0)
        self.line_at = rate.STATES
        self.spring_at = rate.STATES + (2 if self.inertance > 0 else 0)
        self.size = self.spring_at + (2 if self.has_spring else 0)
        self.tolerance = TOLERANCE * (self.nuisance.get("tolerance") or 1.0)
        self.constants = np.zeros(1, rate.CONSTANTS).view(np.recarray)
        self._constants()
        self.scale = np.ones(rate.MOST_STATES)
        self.scale[: rate.STATES] = SCALE
        if self.inertance > 0:
            self.scale[self.line_at : self.line_at + 2] = 1e6, 1e-5
        if self.has_spring:
            self.scale[self.spring_at : self.spring_at + 2] = 50.0, 0.1

    def again(self, parameters, effects, nuisance):
        """The same rig under the same inputs, otherwise changed."""
        return Truth(self.sheet, parameters, effects, nuisance, given=self.seen)

    def _effect(self, port, effect, parameter, nothing):
        return self.ports.get(port, {}).get(effect, {}).get(parameter, nothing)

    def _constants(self):
        p, of, c = self.p, self._effect, self.constants[0]
        c.t1, c.t2, c.gain = p["valve_time_constant_1"], p["valve_time_constant_2"], p["valve_gain"]
        c.k0, c.c_r, c.volume, c.bulk = p["flow_coefficient"], p["displacement"], p["trapped_volume"], p["bulk_modulus"]
        c.leak, c.eta_m, c.eta_p = p["leakage_coefficient"], p["motor_efficiency"], p["pump_efficiency"]
        c.inertia, c.viscous = p["inertia"], p["viscous_friction"]
        n = self.nuisance
        more = lambda name, nothing=0.0: n.get(name) or nothing
        c.warming, c.seal = n["warming"], n["seal_friction"]
        c.pulsation, c.line = n["pulsation"], more("line")
        c.hum, c.hum_w = more("hum"), 2 * math.pi * more("hum_frequency")
        c.dry, c.turn, c.winding = more("dry"), more("turn"), more("winding", rate.WINDING)
        c.shape = 0.0 if more("maxwell") else more("shape", 1.0)
        c.null_opening, c.overlap, c.damping = more("null_opening"), more("overlap"), more("damping")
        c.stiffening = more("stiffening")
        shaft = "force.shaft"
        c.coulomb = of(shaft, "coulomb_friction", "force", 0.0)
        c.more_viscous = of(shaft, "viscous_friction", "coefficient", 0.0)
        c.excess = of(shaft, "stribeck_friction", "static_excess", 0.0)
        c.stribeck = of(shaft, "stribeck_friction", "velocity", 10.0)
        c.by_load = of(shaft, "load_dependent_friction", "coefficient", 0.0)
        c.push = of(shaft, "load_force", "constant", 0.0)
        c.mass = of(shaft, "added_mass", "mass", 0.0)
        c.friction = bool(c.coulomb or c.excess or c.by_load or c.dry)
        c.laminar = of("flow.motor_in_motor_out", "laminar_leakage", "coefficient", 0.0)
        c.orifice = of("flow.motor_in_motor_out", "orifice_leakage", "coefficient", 0.0)
        c.clogging = of("restriction.valve", "clogging", "fraction", 0.0)
        c.exponent = of("restriction.valve", "area_curve", "exponent", 1.0)
        c.air = of("compliance.motor_line", "entrained_air", "fraction", 0.0) + more("air")
        c.bulk *= of("compliance.motor_line", "compliance_factor", "factor", 1.0)
        c.droop = of("source.supply", "droop", "resistance", 0.0)
        c.ripple = of("source.supply", "ripple", "amplitude", 0.0)
        c.ripple_w = 2 * math.pi * of("source.supply", "ripple", "frequency", 1.0)
        c.viscosity = of("source.oil", "viscosity_drift", "factor", 1.0)
        c.motor = of("transmission.motor", "scale", "factor", 1.0)
        c.pump = of("transmission.pump", "scale", "factor", 1.0)
        c.displacement = of("transmission.displacement", "scale", "factor", 1.0)
        c.has_line, c.inertance, c.line_at = self.inertance > 0, self.inertance, self.line_at
        c.has_spring, c.spring_at, c.size = self.has_spring, self.spring_at, self.size
        if self.has_spring:
            spring = self.ports["transmission.shaft"]["elasticity"]
            c.spring_k, c.spring_d = 1 / max(spring["compliance"], STIFFEST), spring["damping"]
        for name, (level, terms) in (("supply", self.supply), ("load", self.load)):
            for field, values in zip("awp", zip(*terms)):
                getattr(c, f"{name}_{field}")[: len(values)] = values
        c.supply_level = self.supply[0]

    def _pressures(self):
        """(supply, slope, load, slope) at the samples of a replay, behind their transducers."""
        columns = []
        for name, values in zip(INPUTS, self.given[:2]):
            sensor = self.sensor(name)
            if sensor.e:
                values = sensor.all(np.arange(len(values)) * self.period, values, np.gradient(values, self.period))
            columns += [values, np.append(np.diff(values), 0.0) / self.period]
        return np.column_stack(columns)

    def rest(self, volts):
        """State of rest under a voltage and the inputs' first values."""
        c = self.constants[0]
        y = np.zeros(rate.MOST_STATES)
        y[0] = y[1] = c.gain * volts
        y[7] = y[8] = y[9] = self.load[0](0.0)
        y[2], y[6] = 4e6, self.supply[0]
        # settled by simulation: the flow the power unit delivers, friction and all that
        step, given = 1e-4, np.zeros(4)
        c.load_set = y[7]
        tones = c.supply_a.copy(), c.load_a.copy()
        c.supply_a[:], c.load_a[:] = 0.0, 0.0
        drive = np.array([0.0, volts, 0.0, 1.0, 0.0])
        rate.integrate(y, 0.0, 3.0, step, c, drive, given, self.tolerance, self.scale)
        c.supply_a[:], c.load_a[:] = tones
        y[4] = 0.0
        return y

    def start(self, base):
        """A full state from a base, with the effect's own states where they would settle."""
        y = np.zeros(rate.MOST_STATES)
        y[: rate.STATES] = base
        c = self.constants[0]
        if self.inertance > 0:
            y[self.line_at], y[self.line_at + 1] = y[2], c.c_r * y[3] + c.leak * y[2]
        if self.has_spring:
            torque = c.c_r / c.eta_p * y[9] + 0.5 * c.viscous * y[3]
            y[self.spring_at], y[self.spring_at + 1] = y[3], torque / c.spring_k
        return y

    def base(self, y):
        return np.array(y[: rate.STATES])

    def advance(self, y, pieces):
        step, given, fine = 2e-3, np.zeros(4), (self.tolerance, self.scale)
        for start, end, *drive in pieces:
            inputs = np.array((*drive, start)), given
            step = rate.integrate(y, start, end, min(step, 2e-3), self.constants[0], *inputs, *fine)
            if step < 0:
                raise RuntimeError(f"the truth could not be integrated past t = {start:.4f} s")

    def sensor(self, name):
        gain = self.nuisance["gain_error"] * {"motor_pressure": 1, "shaft_speed": -1}.get(name, 0)
        filtered = self.nuisance["pressure_filter"] if name == "motor_pressure" else 0.0
        return Sensor(self.ports.get("sensor." + name, {}), self.period, 1 + gain, filtered)

    def path(self):
        return CommandPath(self.ports.get("command.valve", {}), self.period, self.nuisance["spool_hysteresis"], 2.0)

    def run(self, duration, controller, noise_scale=1.0, seed=0):
        """Simulate with a controller; returns a dictionary of channel arrays (as recorded) and `states`, `clean`.

        controller(k, measured) -> (volts, set point), called once per sample with the measured channels of that sample.
        Noise in the recording is the datasheet's times noise_scale; the controller has its own, quieter path (one
        times).
        """
        sheet, h = self.sheet, self.period
        count = int(round(duration / h))
        names = OUTPUTS + INPUTS
        path = self.path()
        record = {c: np.zeros(count) for c in sheet.channels}
        shown = Transducers(sheet, names, [self.sensor(n) for n in names], record, noise_scale, seed)
        states, clean = np.empty((count, rate.STATES)), np.empty((count, 2))
        supply, load = np.empty(count), np.empty(count)
        c = self.constants[0]
        load_a, load_w, load_p = c.load_a.copy(), c.load_w.copy(), c.load_p.copy()
        dac = sheet.resolution["valve_voltage"]
        first, _ = controller(0, {"shaft_speed": math.nan})
        y = self.rest(first if math.isfinite(first) else 0.35)
        drive = np.array([0.0, y[0] / c.gain, 0.0, 1.0, 0.0])
        for k in range(count):
            t = k * h
            c.load_set = self.load[0](t)
            states[k] = self.base(y)
            flutter = rate.tones(load_a, load_w, load_p, t)
            supply[k], load[k] = y[6], y[9] + flutter
            dy = np.zeros(rate.MOST_STATES)
            rate.rate(t, y, c, (drive, np.zeros(4), t), dy)
            tone_slope = float(np.sum(load_a * load_w * np.cos(load_w * t + load_p)))
            slopes = [dy[2], dy[3], dy[6], dy[9] + tone_slope]
            values = [
                shown.read(k, t, n, v, s) for n, (v, s) in enumerate(zip((y[2], y[3], supply[k], load[k]), slopes))
            ]
            clean[k] = values[:2]
            volts, record["speed_setpoint"][k] = controller(k, shown.seen)
            volts = dac * math.floor(min(max(volts, -5.0), 5.0) / dac + 0.5)
            record["valve_voltage"][k] = volts
            if k == 0:
                path.settle(volts)
            self.advance(y, path.pieces(k, volts))
        self.seen = (supply, load, {})
        return {"t": np.arange(count) * h, "record": record, "states": states, "clean": clean, "truth": self}

    def replay(self, commands, windows, starts):
        """Outputs without noise on windows (first, last+1) of a run, each started from a state, driven by given
        commands and by the inputs as a recording would show them: linear between samples, behind their transducers.

        Memory of the command path and of the inputs' transducers is taken along from the start of the run; that of an
        output starts settled at the window's first value.
        """
        self.seen = self.given
        pressures, pieces = self._pressures(), self._pieces(commands, windows[-1][1])
        clean = []
        for (first, last), base in zip(windows, starts):
            fine = self.constants[0], self.tolerance, self.scale
            shown = rate.replay(self.start(base), pieces, first, last, self.period, pressures, *fine)
            if not len(shown):
                raise RuntimeError(f"the truth could not be replayed from sample {first}")
            times = np.arange(first, last) * self.period
            clean.append(
                np.column_stack(
                    [self.sensor(name).all(times, shown[:, n], shown[:, n + 2]) for n, name in enumerate(OUTPUTS)]
                )
            )
        return np.concatenate(clean)

    def _pieces(self, commands, count):
        """Rows of (sample, start, end, kind, a, b, c) of the command path; most replays of a run share them."""
        key = (count, repr(self.ports.get("command.valve")), self.nuisance["spool_hysteresis"])
        known = self.given[2]
        if key not in known:
            path = self.path()
            path.settle(commands[0])
            known[key] = np.array([(k, *p) for k in range(count) for p in path.pieces(k, commands[k])])
        return known[key]
