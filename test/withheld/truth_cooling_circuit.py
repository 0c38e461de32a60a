"""An independent truth of the cooling circuit, for the check of `faultline gap` on effects that are withheld.

Shares no code with src/; takes only the datasheet's numbers. Integrated by a diagonally implicit method with the
eleven pressures solved together (rate_cooling_circuit.py), restarted at every sample and wherever a command changes.
Where physics allows, the formula is another one than the datasheet's:

    orifices            the pressure as a quadratic in the flow, laminar below 0.01 Pa
    tubes               the pressure loss as a power of the flow, about a reference flow
    droop, line inertia solved with the flow they belong to, within a step
    entrained air       polytropic, exponent 1.1 (so its fraction is not the datasheet's number to the last digit)
    hysteresis          three plays in parallel;   deadband  softplus blend
    lags                exact between samples;   delay  exact shift, a command changes within a sample
Small nuisance effects that no datasheet lists: a valve with a trace of hysteresis, a supply that hums, walls that take
up heat, transducers a little off. Each stays below the sensor noise. Extra white noise (noise@sensor) has no truth
here. SI units throughout.
"""
import math

import numpy as np

import excitation_cooling_circuit as excitation
import rate_cooling_circuit as rate
import truth_classes
from rate_cooling_circuit import BRANCHES
from signal_paths import CommandPath, Sensor, split

DURATION = 20.0  # s, of a run
BUDGET = 60.0  # s, of all runs of a random truth together
SHOWN = ["inlet_pressure", "outlet_pressure", "mass_flow", "inlet_temperature", "outlet_temperature"]
OUTPUTS = [f"{b}_{name}" for b in BRANCHES for name in SHOWN]
COMMANDS = ["bench_valve_command", "heat_load_command"]
REFERENCE = {"t": 2.0}  # kg/s in a tube, 1.5 in the others
PARAMETERS = [
    "density",
    "sound_speed",
    "specific_heat",
    "valve_coefficient",
    "valve_time_constant",
    "manifold_volume",
    "drain_pressure",
    "water_temperature",
    "ambient_temperature",
    "firing_time_constant",
] + [f"{b}_{name}" for b in BRANCHES for name in ("b", "c", "feed_coefficient", "drain_coefficient", "heat_flux")]
NO_NUISANCE = {"valve_hysteresis": 0.0, "hum": 0.0, "hum_frequency": 0.0, "wall": 0.0, "gain_error": 0.0}
# Classes of a random truth (truth_classes.py). The friction is the water's in the tubes.
VARIANTS = {
    "friction": {
        "rough": {"power": (-0.2, 0.2)},
        "entrance": {"entrance": (0.05, 0.6)},
        "temperature": {"thinning": (0.7, 0.99)},
    },
    "valve": {
        "second_order": {"damping": (0.5, 0.9)},
        "hysteresis": {"valve_hysteresis": (2e-3, 3e-2)},
        "curve": {"valve_exponent": (0.95, 1.05)},
        "null_leakage": {"valve_leak": (2e-4, 1e-2)},
    },
    "supply": {
        "pulsation": {"hum": (1e3, 5e4), "hum_frequency": (5.0, 120.0)},
        "line": {"line": (1e6, 4e7)},
        "column": {"feed_inertance": (1e5, 6e6)},
    },
    "hose": {"air": {"air": (1e-3, 5e-2)}, "walls": {"wall": (20.0, 800.0)}, "loss": {"loss": (30.0, 1000.0)}},
    "integrator": {"coarse": {"substeps": 1.0}, "fine": {"substeps": 8.0}},
}
SUBSTEPS = 2.0  # a sample


def draw_nuisance(random):
    return {
        "valve_hysteresis": random.uniform(0.0, 3e-4),
        "hum": random.uniform(0.0, 300.0),
        "hum_frequency": random.uniform(10.0, 50.0),
        "wall": random.uniform(0.0, 2.0),
        "gain_error": random.uniform(-5e-5, 5e-5),
    }


def as_recorded(sheet):
    sheet.bounds = {key: bounds for key, bounds in sheet.bounds.items() if not key.startswith("noise@")}
    return sheet


class Truth:
    """The rig with given parameters and effects; the names that the check asks for are told in truth_servo_actuator.py.

    supply: (level, tones); given: the supply's true pressure at the samples in its place, linear in between, and what
    replays of the run share.
    """

    COMMAND, OUTPUTS, PARAMETERS = "commands", OUTPUTS, PARAMETERS
    WINDOW = 200
    QUIET = {}

    def __init__(self, datasheet, parameters=None, effects=None, nuisance=None, supply=None, load=None, given=None):
        self.sheet, self.period = datasheet, datasheet.sample_period
        self.p = dict(datasheet.nominal)
        self.p.update(parameters or {})
        self.effects, self.ports = effects or {}, split(effects or {})
        self.nuisance = dict(NO_NUISANCE)
        self.nuisance.update(nuisance or {})
        self.supply, self.given = supply or (7e6, []), given
        self.constants = np.zeros(1, rate.CONSTANTS).view(np.recarray)
        self._constants()

    def again(self, parameters, effects, nuisance):
        """The same rig under the same supply, otherwise changed."""
        return Truth(self.sheet, parameters, effects, nuisance, given=self.seen)

    def _effect(self, port, effect, parameter, nothing=0.0):
        return self.ports.get(port, {}).get(effect, {}).get(parameter, nothing)

    def _constants(self):
        p, of, c = self.p, self._effect, self.constants[0]
        more = lambda name, nothing=0.0: self.nuisance.get(name) or nothing
        a2 = p["sound_speed"] ** 2
        c.density, c.specific_heat, c.drain = p["density"], p["specific_heat"], p["drain_pressure"]
        c.water, c.outside = p["water_temperature"], p["ambient_temperature"]
        c.water_drift = of("source.water", "drift", "rate")
        c.thinning = of("source.water", "viscosity_drift", "factor", 1.0) * more("thinning", 1.0)
        c.valve_time, c.firing_time = p["valve_time_constant"], p["firing_time_constant"]
        plug = "restriction.bench_valve"
        c.valve_gain = p["valve_coefficient"] * (1 - of(plug, "clogging", "fraction"))
        c.exponent = of(plug, "area_curve", "exponent", 1.0) * more("valve_exponent", 1.0)
        c.valve_leak, c.damping = more("valve_leak"), more("damping")
        c.manifold = p["manifold_volume"] / a2 / of("compliance.manifold", "compliance_factor", "factor", 1.0)
        air = of("compliance.manifold", "entrained_air", "fraction") + more("air")
        c.air = air * p["manifold_volume"] * p["density"]
        c.feed_inertance = of("line.feed", "line_inertia", "inertance") + more("feed_inertance")
        tank = "source.supply"
        c.offset = of(tank, "offset", "value")
        c.droop = of(tank, "droop", "resistance") + more("line")
        c.ripple, c.ripple_w = of(tank, "ripple", "amplitude"), 2 * math.pi * of(tank, "ripple", "frequency")
        c.hum, c.hum_w = more("hum"), 2 * math.pi * more("hum_frequency")
        c.substeps = more("substeps", SUBSTEPS)
        for n, b in enumerate(BRANCHES):
            tube, wall, drain = f"restriction.{b}_orifice", f"heat.{b}_wall", f"source.{b}_drain"
            c.b[n], c.mass[n] = p[b + "_b"], p["density"] * p[b + "_b"] * a2
            c.c[n] = p[b + "_c"] * (1 - of(tube, "clogging", "fraction"))
            c.power[n] = 1.75 / of(tube, "area_curve", "exponent", 1.0) + more("power")
            c.reference[n], c.entrance[n] = REFERENCE.get(b, 1.5), more("entrance")
            c.feed[n] = p[b + "_feed_coefficient"] * (1 - of(f"restriction.{b}_feed", "clogging", "fraction"))
            c.throttle[n] = p[b + "_drain_coefficient"] * (1 - of(f"restriction.{b}_drain", "clogging", "fraction"))
            c.leak_1[n] = of(f"flow.{b}_inlet_ambient", "orifice_leakage", "coefficient")
            c.laminar_1[n] = of(f"flow.{b}_inlet_ambient", "laminar_leakage", "coefficient")
            c.leak_2[n] = of(f"flow.{b}_outlet_ambient", "orifice_leakage", "coefficient")
            c.laminar_2[n] = of(f"flow.{b}_outlet_ambient", "laminar_leakage", "coefficient")
            c.leak_3[n] = of(f"flow.{b}_drain_ambient", "orifice_leakage", "coefficient")
            c.inertance[n] = of(f"line.{b}_orifice", "line_inertia", "inertance")
            c.flux[n] = p[b + "_heat_flux"] * of(wall, "scale", "factor", 1.0)
            c.loss[n] = of(wall, "heat_loss", "coefficient") + more("loss")
            c.capacity[n] = of(wall, "heat_capacity", "capacity") + more("wall")
            c.shake[n] = of(drain, "ripple", "amplitude")
            c.shake_w[n] = 2 * math.pi * of(drain, "ripple", "frequency")
        c.supply_level = self.supply[0]
        for field, values in zip("awp", zip(*self.supply[1])):
            getattr(c, f"supply_{field}")[: len(values)] = values

    def start(self, base):
        """A full state from a base: every truth has all states."""
        return np.array(base)

    def base(self, y):
        return np.array(y)

    def rest(self, pieces):
        """Settled under the first commands: by simulation, as the rig does, with the lags taken out of it."""
        y, c, drives = np.zeros(rate.STATES), self.constants[0].copy(), np.zeros((2, 5))
        y[rate.PM] = 5e6
        for n in range(5):
            at = rate.FIRST + rate.EACH * n
            y[at : at + rate.EACH] = 4e6, 3.8e6, c.water, c.water + 20.0, 1.5
        drives[0, 1], drives[1, 1] = pieces[0][4], pieces[0][9]
        y[rate.Z], y[rate.S] = min(max(drives[0, 1], 0.0), 1.0), max(drives[1, 1], 0.0)
        rate.advance(y, -4.0, 0.0, c, drives, np.array([rate.supply(0.0, c, np.zeros(2), 0.0), 0.0]), 0.0)
        return y

    def sensor(self, name):
        sign = {"inlet_pressure": 1, "outlet_pressure": -1}.get(name.split("_", 1)[1], 0)
        return Sensor(self.ports.get("sensor." + name, {}), self.period, 1 + sign * self.nuisance["gain_error"])

    def _shown(self, first, shown, without=()):
        """Behind the transducers; `without`: effects that come after the noise, where that is still to come."""
        times = np.arange(first, first + len(shown)) * self.period
        columns = []
        for n, name in enumerate(OUTPUTS):
            sensor = self.sensor(name)
            sensor.e = {k: v for k, v in sensor.e.items() if k not in without}
            slopes = np.gradient(shown[:, n], self.period) if sensor.delay > 0 else np.zeros(len(shown))
            columns.append(sensor.all(times, shown[:, n], slopes))
        return np.column_stack(columns)

    def _pieces(self, commands):
        """Rows of (sample, start, end, drive of the valve, of the heat); most replays of a run share them."""
        keys = tuple(repr(self.ports.get("command." + name)) for name in COMMANDS)
        key = keys + (self.nuisance["valve_hysteresis"],)
        known = self.given[1] if self.given else {}
        if key not in known:
            paths = [
                CommandPath(self.ports.get("command." + name, {}), self.period, trace, 1.0)
                for name, trace in zip(COMMANDS, (self.nuisance["valve_hysteresis"], 0.0))
            ]
            rows = []
            for k, row in enumerate(commands):
                if k == 0:  # settled under the first commands
                    for path, u in zip(paths, row):
                        path.history[-1] = u
                        self._settle(path, u)
                parts = [path.pieces(k, u) for path, u in zip(paths, row)]
                ends = sorted({part[1] for side in parts for part in side})
                start = k * self.period
                for end in ends:
                    entry = [k, start, end]
                    for side in parts:
                        begin, _, *drive = next(part for part in side if part[1] >= end - 1e-12)
                        entry += [*drive, begin]
                    rows.append(entry)
                    start = end
            known[key] = np.array(rows)
        return known[key]

    @staticmethod
    def _settle(path, u):
        """As if the first command had stood for ever."""
        path.trace_state = u
        for play in path.plays:
            play[2][0] = u
        path.out = path._static(u)
        for back in range(1, 1000 if path.delay > 0 else 2):
            path.history[-back] = u

    def run(self, duration, control, noise_scale=1.0, seed=0):
        """Simulate under a sequence; returns a dictionary of channel arrays (as recorded) and `states`, `clean`."""
        sheet, count = self.sheet, int(round(duration / self.period))
        random = np.random.default_rng(seed)
        commands = control.commands(count)
        pieces = self._pieces(commands)
        states, nothing = np.empty((count, rate.STATES)), np.zeros((count, 2))
        shown = rate.replay(self.rest(pieces), pieces, 0, count, self.period, nothing, self.constants[0], states)
        if not len(shown):
            raise RuntimeError("the truth could not be integrated")
        times = np.arange(count) * self.period
        supply = np.array([rate.supply(t, self.constants[0], nothing[0], 0.0) for t in times])
        record = {name: np.zeros(count) for name in sheet.channels}
        record["commands"] = commands
        for n, name in enumerate(COMMANDS):
            record[name] = commands[:, n]
        name = "supply_pressure"
        sensor, step = self.sensor(name), sheet.resolution[name]
        noise = noise_scale * sheet.noise[name] * random.standard_normal(count)
        seen = np.array([sensor.last(t, sensor(t, y) + e) for t, y, e in zip(times, supply, noise)])
        record[name] = step * np.floor(seen / step + 0.5)
        clean = self._shown(0, shown, ("quantisation", "stuck"))
        output = {"t": times, "record": record, "states": states, "clean": clean, "truth": self}
        self.seen = (supply, {})
        truth_classes.record(output, sheet, noise_scale, {}, seed)
        return output

    def replay(self, commands, windows, starts):
        """Outputs without noise on windows (first, last+1) of a run, each started from a state, driven by given
        commands and by the supply as a recording would show it: linear between samples, behind its transducer. Memory
        of the command paths is taken along from the start of the run; a transducer starts settled at the window's first
        value."""
        self.seen = self.given
        sensor, supply = self.sensor("supply_pressure"), self.given[0]
        if sensor.e:
            times = np.arange(len(supply)) * self.period
            supply = sensor.all(times, supply, np.zeros(len(supply)))
        pressures = np.column_stack([supply, np.append(np.diff(supply), 0.0) / self.period])
        pieces, clean = self._pieces(commands), []
        for (first, last), base in zip(windows, starts):
            shown = rate.replay(
                self.start(base), pieces, first, last, self.period, pressures, self.constants[0], np.empty((0, 0))
            )
            if not len(shown):
                raise RuntimeError(f"the truth could not be replayed from sample {first}")
            clean.append(self._shown(first, shown))
        return np.concatenate(clean)
