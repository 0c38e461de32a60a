"""An independent truth of the control valve, for the check of `faultline gap` on effects that are withheld.

Shares no code with src/; takes only the datasheet's numbers and the thesis's tables. Recorded as a plant's historian
would: ten rows a second, the coil voltage their mean, flapper and spool (laser sensors of a laboratory) not at all.
Integrated by Dormand and Prince's method with its own step control, restarted at every millisecond of the spool loop.
Where physics allows, the formula is another one than the datasheet's:

    piston              a mass, and friction taken up by bristles over 0.04 mm (datasheet: no mass, set-valued)
    spool friction      bristles over 2 um, more where there is more of it
    seal                two bristles, of 0.6 and 1.4 of the wind-up angle, with some damping
    shaft               an inertia; play and yield in the linkage are a contact spring that pushes only
    stops of the piston stiff, with damping
    diaphragms          hysteresis of two elements that turn over on 3 and 7 % of the stroke
    Stribeck part       sech^2
    overlap             softplus blend
    droop               of a small volume behind the regulator
    flow function       straight to zero from a pressure ratio of 0.996 on
    lags, delays        exact between samples
Small nuisance effects that no datasheet lists: the pump's pulsation, diaphragms with a trace of hysteresis, a supply
line with some resistance, transducers a little off. Each stays below the sensor noise. SI units throughout.
"""
import math

import numpy as np

import excitation_control_valve as excitation
import rate_control_valve as rate
from signal_paths import Sensor, split

DURATION = 30.0  # s, of a run
BUDGET = 240.0  # s, of all runs of a random truth together
OUTPUTS = ["prestage_pressure", "cylinder_pressure", "load_torque", "valve_position", "flow"]
NOT_MEASURED = ["flapper_position", "spool_position"]
INPUTS = ["supply_pressure", "ambient_temperature"]
PERIOD = 0.1  # s, of the recording and of the flow loop
WARM_UP = 40  # periods before the recording, under its first demand
PARAMETERS = list(rate.CONSTANTS.names[: rate.CONSTANTS.names.index("prestage_leak")])
NO_NUISANCE = {"pump_ripple": 0.0, "diaphragm_trace": 0.0, "line_resistance": 0.0, "gain_error": 0.0}
# Classes of a random truth (truth_classes.py): what each variant puts in the nuisance's place.
VARIANTS = {
    "friction": {
        "set_valued": {"piston_winding": 4e-6},
        "lugre": {"piston_winding": (1e-5, 1e-3)},
        "dahl": {"piston_winding": (1e-5, 1e-3), "shape": (1.2, 3.0)},
        "maxwell": {"piston_winding": (2e-5, 4e-4), "maxwell": 1.0},
        "position": {"stroke_friction": (-0.8, 0.8)},
        "temperature": {"heat_friction": (-0.06, 0.06)},
    },
    "valve": {
        "null_leakage": {"null_area": (1e-3, 3e-2)},
        "underlap": {"underlap": (1e-2, 0.15)},
        "overlap": {"overlap": (5e-4, 1e-2)},
        "hysteresis": {"diaphragm_trace": (0.1, 2.0)},
        "curve": {"exponent": (0.85, 1.15)},
    },
    "supply": {"pulsation": {"hum": (5e2, 2e4), "hum_frequency": (3.0, 40.0)}, "line": {"line_resistance": (5e5, 2e7)}},
    "hose": {"polytropic": {"gamma": (1.05, 1.35)}, "ripple": {"pump_ripple": (2e-3, 2e-2)}},
    "integrator": {"loose": {"tolerance": 10.0}, "tight": {"tolerance": 0.05}, "cash_karp": {"tolerance": -1.0}},
}
STIFFEST = 2.0e-5  # rad/(N m), of a joint without elasticity
CONTACT_DAMPING = 20.0  # N m s
# Of the states: what an error per step is held against.
SCALE = np.array([1e-2, 1e8, 1e-1, 100, 1e8, 1e1, 1e1, 100, 100, 100, 1e7, 100, 100, 1e1, 1e2, 100, 100]) * 1e-2
TOLERANCE = 1e-5


def draw_nuisance(random):
    return {
        "pump_ripple": random.uniform(0.0, 2e-3),
        "diaphragm_trace": random.uniform(0.0, 0.1),
        "line_resistance": random.uniform(0.0, 1e5),
        "gain_error": random.uniform(-3e-4, 3e-4),
    }


def as_recorded(sheet):
    """The datasheet as this recording has it: ten rows a second, two channels empty, no effects at their sensors."""
    sheet = sheet.without(NOT_MEASURED)
    sheet.sample_period = PERIOD
    return sheet


class Truth:
    """The rig with given parameters and effects; the names that the check asks for are told in truth_servo_actuator.py.

    supply, load: (level, tones) of supply pressure and air temperature; given: both at the samples in place of these,
    linear in between, and what replays of the run share.
    """

    COMMAND, OUTPUTS, PARAMETERS = "coil_voltage", OUTPUTS, PARAMETERS
    WINDOW = 25
    QUIET = {}

    def __init__(self, datasheet, parameters=None, effects=None, nuisance=None, supply=None, load=None, given=None):
        self.sheet, self.period = datasheet, PERIOD
        self.p = dict(datasheet.nominal)
        self.p.update(parameters or {})
        self.effects, self.ports = effects or {}, split(effects or {})
        self.nuisance = dict(NO_NUISANCE)
        self.nuisance.update(nuisance or {})
        self.supply, self.load, self.given = supply or (5e5, []), load or (293.15, []), given
        self.constants = np.zeros(1, rate.CONSTANTS).view(np.recarray)
        self._constants()

    def again(self, parameters, effects, nuisance):
        """The same rig under the same inputs, otherwise changed."""
        return Truth(self.sheet, parameters, effects, nuisance, given=self.seen)

    def _effect(self, port, effect, parameter, nothing=0.0):
        return self.ports.get(port, {}).get(effect, {}).get(parameter, nothing)

    def _constants(self):
        of, c, n = self._effect, self.constants[0], self.nuisance
        for name in PARAMETERS:
            setattr(c, name, self.p[name])
        c.gas_constant = self.sheet.constants["gas_constant"]
        c.prestage_leak = of("flow.prestage_ambient", "orifice_leakage", "coefficient")
        c.cylinder_leak = of("flow.cylinder_ambient", "orifice_leakage", "coefficient")
        c.restrictor_clog = of("restriction.fixed_restrictor", "clogging", "fraction")
        c.nozzle_clog = of("restriction.nozzle", "clogging", "fraction")
        c.ports_clog = of("restriction.spool_ports", "clogging", "fraction")
        c.overlap = of("restriction.spool_ports", "deadband", "width")
        c.valve_clog = of("restriction.process_valve", "clogging", "fraction")
        c.exponent = of("restriction.process_valve", "area_curve", "exponent", 1.0)
        c.compliance = of("compliance.cylinder", "compliance_factor", "factor", 1.0)
        spool, piston, valve = "force.spool", "force.actuator", "force.valve"
        c.spool_friction = of(spool, "coulomb_friction", "force")
        c.spool_shift = of(spool, "load_force", "constant") + 0.5 * of(spool, "asymmetric_friction", "difference")
        c.spool_stiffness = of(spool, "load_force", "stiffness")
        c.diaphragm_width = of(spool, "hysteresis", "width") + n["diaphragm_trace"]
        c.more_coulomb = of(piston, "coulomb_friction", "force")
        c.more_viscous = of(piston, "viscous_friction", "coefficient")
        c.excess = of(piston, "stribeck_friction", "static_excess")
        c.stribeck = of(piston, "stribeck_friction", "velocity", 0.01)
        c.piston_shift = of(piston, "load_force", "constant") + 0.5 * of(piston, "asymmetric_friction", "difference")
        c.piston_stiffness = of(piston, "load_force", "stiffness")
        c.valve_friction = of(valve, "coulomb_friction", "force")
        c.valve_by_load = of(valve, "load_dependent_friction", "coefficient")
        c.supply_offset = of("source.supply", "offset", "value")
        c.droop = of("source.supply", "droop", "resistance") + n["line_resistance"]
        linkage = self.ports.get("transmission.linkage", {})
        spring = linkage.get("elasticity", {})
        c.gap = of("transmission.linkage", "backlash", "gap")
        c.joint = bool(linkage)
        c.joint_stiffness = 1 / max(spring.get("compliance", 0.0), STIFFEST)
        c.joint_damping = spring.get("damping", CONTACT_DAMPING)
        c.ripple, c.size = n["pump_ripple"], rate.STATES
        more = lambda name, nothing=0.0: n.get(name) or nothing
        c.piston_winding = more("piston_winding", rate.PISTON_WINDING)
        c.shape = 0.0 if more("maxwell") else more("shape", 1.0)
        c.stroke_friction, c.heat_friction = more("stroke_friction"), more("heat_friction")
        c.null_area, c.underlap = more("null_area"), more("underlap")
        c.overlap, c.exponent = c.overlap + more("overlap"), c.exponent * more("exponent", 1.0)
        c.hum, c.hum_w, c.gamma = more("hum"), 2 * math.pi * more("hum_frequency"), more("gamma", rate.GAMMA)
        self.tolerance = TOLERANCE * more("tolerance", 1.0)
        c.supply_level, c.air_level = self.supply[0], self.load[0]
        for name, (_, terms) in (("supply", self.supply), ("air", self.load)):
            for field, values in zip("awp", zip(*terms)):
                getattr(c, f"{name}_{field}")[: len(values)] = values

    def _loops(self, control, noise):
        loops = np.zeros(1, rate.LOOPS).view(np.recarray)
        l, of = loops[0], self._effect
        for name in ("position_gain", "bias", "gain", "integral", "derivative", "filter"):
            setattr(l, name, getattr(control, name))
        l.offset = of("sensor.valve_position", "offset", "value")
        l.factor = of("sensor.valve_position", "scale", "factor", 1.0)
        l.stuck_from = of("sensor.valve_position", "stuck", "from", math.inf)
        l.held, l.step, l.noise = -1.0, 1e-3, noise
        l.position_noise, l.spool_noise = self.sheet.noise["valve_position"], self.sheet.noise["spool_position"]
        l.scale = of("command.coil_voltage", "scale", "factor", 1.0)
        l.shift = of("command.coil_voltage", "offset", "value")
        l.lag = of("command.coil_voltage", "lag", "time_constant")
        l.drive = l.scale * control.bias + l.shift
        return loops

    def rest(self, flow):
        """Near where the valve passes a flow; the loops do the rest."""
        c, y = self.constants[0], np.zeros(rate.STATES)
        shown, dy, low, high = np.zeros(5), np.zeros(rate.STATES), 0.0, rate.STROKE
        for _ in range(40):
            y[rate.X] = 0.5 * (low + high)
            y[rate.SHAFT] = rate.angle(y[rate.X])
            rate.show(0.0, y, c, dy, shown)
            low, high = (y[rate.X], high) if shown[4] < flow else (low, y[rate.X])
        y[rate.X_F], y[rate.P_P], y[rate.SPOOL] = 5e-5, 3e5, 0.5 * c.spool_stroke
        y[rate.P_C] = c.spring_rate * (y[rate.X] + c.spring_pretension) / c.cylinder_area
        return y

    def start(self, base):
        """A full state from a base: the shaft stays where it is, a joint that yields lies on its loaded side."""
        y, c = np.array(base), self.constants[0]
        y[rate.DROP] = 0.0
        phi = y[rate.SHAFT]
        if c.joint:
            torque = rate.seal(c, phi, 0.0, y[rate.SEAL_1], y[rate.SEAL_2])[0]
            x = rate.RADIUS * math.sin(phi - math.pi / 4) + rate.STROKE / 2
            phi += torque / c.joint_stiffness + 0.5 * c.gap * rate.turning(x) * min(max(torque, -1.0), 1.0)
            y[rate.SHAFT_W] = y[rate.V] * rate.turning(x)
        y[rate.X] = rate.RADIUS * math.sin(phi - math.pi / 4) + rate.STROKE / 2
        return y

    def base(self, y):
        y = np.array(y)
        if not self.constants[0].joint:
            y[rate.SHAFT] = rate.angle(y[rate.X])
        return y

    def sensor(self, name):
        sign = {"prestage_pressure": 1, "cylinder_pressure": -1, "flow": 1}.get(name, 0)
        return Sensor(self.ports.get("sensor." + name, {}), PERIOD, 1 + sign * self.nuisance["gain_error"])

    def run(self, duration, control, noise_scale=1.0, seed=0):
        """Simulate with a controller; returns a dictionary of channel arrays (as recorded) and `states`, `clean`.

        Noise in the recording is the datasheet's times noise_scale, but for the voltage's; the loops have their own,
        quieter path (one times).
        """
        sheet, count = self.sheet, int(round(duration / PERIOD))
        random = np.random.default_rng(seed)
        names, own = OUTPUTS + INPUTS, min(noise_scale, 1.0)
        white, more = random.standard_normal((2, count + WARM_UP, len(names) + 1))
        inner = random.standard_normal((count + WARM_UP, 110))
        wander = 0.0
        more *= math.sqrt(max(noise_scale**2 - 1, 0.0))
        sensors = {name: self.sensor(name) for name in names}
        record = {c: np.full(count, math.nan) for c in sheet.channels}
        states, clean = np.empty((count, rate.STATES)), np.empty((count, len(OUTPUTS)))
        supply, air = np.empty(count), np.empty(count)
        c, loops = self.constants[0], self._loops(control, own)
        y = self.rest(0.028 * control.demand(0.0))
        if control.flow_control:
            control.sum = rate.angle(y[rate.X]) / (math.pi / 2)
        given, shown = np.zeros(4), np.zeros(10)
        for n in range(count + WARM_UP):
            k, t = n - WARM_UP, (n - WARM_UP) * PERIOD
            wander += (0.005 * math.sqrt(0.2) * white[n, -1] * bool(noise_scale)) - 0.1 * wander
            wish = min(max(control.demand(max(t, 0.0)) + wander, 0.02), 0.98)
            drive = np.array([loops[0].drive, loops[0].drive, 0.0, t])
            rate.sloped(t, y, c, drive, given, t, shown)
            around = rate.surroundings(t, c, given, t)
            values = [*shown[:5], *around]
            slopes = [*shown[5:], 0.0, 0.0]
            seen = {}
            for i, name in enumerate(names):
                value = sensors[name](t, values[i], slopes[i])
                if k >= 0 and i < len(OUTPUTS):
                    clean[k, i] = value
                low, high = sheet.range[name]
                step = sheet.resolution[name]
                value += own * white[n, i] * sheet.noise[name]
                seen[name] = value = sensors[name].last(t, value)
                if "stuck" not in sensors[name].e:
                    value += more[n, i] * sheet.noise[name]
                if k >= 0:
                    record[name][k] = min(max(step * math.floor(value / step + 0.5), low), high)
            set_point = control.set_point(wish, seen["flow"])
            if k >= 0:
                states[k], supply[k], air[k] = self.base(y), *around
                record["flow_setpoint"][k], record["valve_setpoint"][k] = 0.028 * wish, set_point
            volts, spool = rate.period(y, t, c, loops[0], set_point, inner[n], self.tolerance, SCALE)
            if volts < 0:
                raise RuntimeError(f"the truth could not be integrated past t = {t:.4f} s")
            if k >= 0:
                record["spool_setpoint"][k] = spool
                volts += own * sheet.noise["coil_voltage"] * random.standard_normal()
                record["coil_voltage"][k] = min(max(1e-3 * math.floor(volts / 1e-3 + 0.5), 0.0), 4.5)
        self.seen = (supply, air, {})
        return {"t": np.arange(count) * PERIOD, "record": record, "states": states, "clean": clean, "truth": self}

    def replay(self, commands, windows, starts):
        """Outputs without noise on windows (first, last+1) of a run, each started from a state, driven by the recorded
        voltage, held, and by the inputs, linear between samples. The coil's lag is taken along from the start of the
        run; a transducer's starts settled at the window's first value."""
        self.seen = self.given
        columns = []
        for values in self.given[:2]:
            columns += [values, np.append(np.diff(values), 0.0) / PERIOD]
        inputs, drives, clean = np.column_stack(columns), self._drives(commands), []
        for (first, last), base in zip(windows, starts):
            shown = rate.replay(
                self.start(base), drives, first, last, PERIOD, inputs, self.constants[0], self.tolerance, SCALE
            )
            if not len(shown):
                raise RuntimeError(f"the truth could not be replayed from sample {first}")
            times = np.arange(first, last) * PERIOD
            clean.append(
                np.column_stack(
                    [self.sensor(name).all(times, shown[:, n], shown[:, n + 5]) for n, name in enumerate(OUTPUTS)]
                )
            )
        return np.concatenate(clean)

    def _drives(self, commands):
        """Rows of (held target, drive before, lag) of the coil."""
        of = self._effect
        lag = of("command.coil_voltage", "lag", "time_constant")
        targets = np.asarray(commands) * of("command.coil_voltage", "scale", "factor", 1.0)
        targets = targets + of("command.coil_voltage", "offset", "value")
        return np.column_stack([targets, np.append(targets[0], targets[:-1]), np.full(len(targets), lag)])

