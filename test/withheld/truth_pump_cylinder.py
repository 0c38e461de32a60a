"""An independent truth of the pump-controlled cylinder, for the check of `faultline gap` on effects that are withheld.

Shares no code with src/; takes only the datasheet's numbers. Integrated by Dormand and Prince's method with its own
step control (dormand_prince.py), restarted at every sample. Where physics allows, the formula is another one than the
datasheet's:

    Coulomb friction    v / (|v|^3 + v_c^3)^(1/3) in place of tanh(v/v_c); of effects, bristles that take it up over
                        20 um and then hold at rest; Stribeck part with sech^2
    bulk modulus        series about P = 0 in place of the logarithm
    orifices            y / (|y|^3 + d^3)^(1/6) in place of y / (y^2 + d^2)^(1/4)
    entrained air       polytropic, exponent 1.1 (so its fraction is not the datasheet's number to the last digit)
    relief valve        rounded over 20 kPa;   deadband  softplus blend
    end stop            stiffer the faster it is met
    speed channels      the angle turned within the sample
    lags                exact between samples
Small nuisance effects that no datasheet lists: drives that follow a tenth of a millisecond late, a little of the
friction on bristles, pumps that are not quite equal and pulsate, oil that warms, transmitters a little off and with an
input filter. Each stays below the sensor noise.

The replay is driven by the commands, so it predicts the speeds too: a speed sensor that lies is seen against its
command as well as in the pressures. States: rate_pump_cylinder.py. SI units throughout.
"""
import math

import numpy as np

import excitation_pump_cylinder as excitation
import rate_pump_cylinder as rate
from signal_paths import CommandPath, Sensor, Transducers, split

DURATION = 12.0  # s, of a run: hundred time constants of the level
BUDGET = 60.0  # s, of all runs of a random truth together
PUMPS = ["pump1_speed", "pump2_speed"]
OUTPUTS = ["position", "chamber_a_pressure", "chamber_b_pressure"] + PUMPS
# Which pressures --partly-measured leaves out: the paper's measurement sets {x, P_A}, {x, P_B} and {x}.
MAY_BE_EMPTY = [["chamber_b_pressure"], ["chamber_a_pressure"], ["chamber_a_pressure", "chamber_b_pressure"]]
PARAMETERS = [
    "mass",
    "cap_area",
    "rod_area",
    "chamber_a_volume",
    "chamber_b_volume",
    "pump_displacement",
    "internal_leakage",
    "external_leakage_a",
    "external_leakage_b",
    "viscous_friction",
    "coulomb_friction",
    "bulk_c1",
    "bulk_c2",
]
NO_NUISANCE = {
    "drive_time": 0.0,
    "stiction": 0.0,
    "mismatch": 0.0,
    "pulsation": 0.0,
    "warming": 0.0,
    "gain_error": 0.0,
    "pressure_filter": 0.0,
}
# Classes of a random truth (truth_classes.py): what each variant puts in the nuisance's place. stiction: the share of
# the Coulomb friction that bristles take up; the rest is the datasheet's smooth one.
VARIANTS = {
    "friction": {
        "set_valued": {"stiction": (0.1, 1.0), "winding": 2e-6},
        "lugre": {"stiction": (0.1, 1.0), "winding": (4e-6, 4e-4)},
        "dahl": {"stiction": (0.1, 1.0), "winding": (4e-6, 4e-4), "shape": (1.2, 3.0)},
        "maxwell": {"stiction": (0.1, 1.0), "winding": (1e-5, 2e-4), "maxwell": 1.0},
        "position": {"stroke_friction": (-0.9, 0.9)},
        "temperature": {"warming": (-8e-3, -2e-4)},
    },
    "valve": {  # the pumps and their drives stand in its place
        "late_drives": {"drive_time": (2e-4, 3e-3)},
        "slip": {"slip": (-1e-2, 1e-2)},
        "mismatch": {"mismatch": (-6e-3, 6e-3)},
        "hysteresis": {"drive_hysteresis": (0.05, 1.5)},
    },
    "supply": {"pulsation": {"pulsation": (1e-3, 3e-2)}, "turn": {"hum": (1e-3, 2e-2)}},
    "hose": {"stiffening": {"stiffening": (-0.4, 0.4)}, "air": {"air": (1e-4, 1e-2)}},
    "integrator": {"loose": {"tolerance": 10.0}, "tight": {"tolerance": 0.05}, "cash_karp": {"tolerance": -1.0}},
}
# Of the states, for the integrator's error.
SCALE = np.array([1e-4, 1e-2, 1e5, 1e5, 1.0, 1.0, 0.1, 1e-4, 1e-2, 1e5, 1e-5, 1e5, 1e-5, 0.1, 0.1])
TOLERANCE = 1e-4
# Where the datasheet's ports give their sizes to.
CONSTANT_OF = {
    "force.piston": {
        "more_coulomb": ("coulomb_friction", "force"),
        "more_viscous": ("viscous_friction", "coefficient"),
        "excess": ("stribeck_friction", "static_excess"),
        "asymmetry": ("asymmetric_friction", "difference"),
        "by_load": ("load_dependent_friction", "coefficient"),
        "push": ("load_force", "constant"),
        "spring": ("load_force", "stiffness"),
        "added": ("added_mass", "mass"),
        "end_x": ("end_stop", "position"),
        "end_k": ("end_stop", "stiffness"),
    },
    "flow.pump2_a_b": {
        "lam_2ab": ("laminar_leakage", "coefficient"),
        "orf_2ab": ("orifice_leakage", "coefficient"),
        "spd_2ab": ("speed_leakage", "coefficient"),
    },
    "flow.pump2_a_tank": {"lam_2a": ("laminar_leakage", "coefficient")},
    "flow.pump2_b_tank": {
        "lam_2b": ("laminar_leakage", "coefficient"),
        "orf_2b": ("orifice_leakage", "coefficient"),
        "crack": ("relief_opening", "cracking_pressure"),
        "relief": ("relief_opening", "slope"),
    },
    "flow.pump1_a_tank": {
        "lam_1a": ("laminar_leakage", "coefficient"),
        "orf_1a": ("orifice_leakage", "coefficient"),
        "spd_1a": ("speed_leakage", "coefficient"),
    },
    "flow.chamber_a_chamber_b": {
        "lam_ab": ("laminar_leakage", "coefficient"),
        "orf_ab": ("orifice_leakage", "coefficient"),
    },
    "compliance.chamber_a": {"air_a": ("entrained_air", "fraction")},
    "compliance.chamber_b": {"air_b": ("entrained_air", "fraction")},
    "line.a": {"inertance_a": ("line_inertia", "inertance")},
    "line.b": {"inertance_b": ("line_inertia", "inertance")},
    "transmission.plate": {"gap": ("backlash", "gap")},
    "source.pump2": {"ripple": ("displacement_ripple", "amplitude"), "order": ("displacement_ripple", "order")},
}


def draw_nuisance(random):
    return {
        "drive_time": random.uniform(0.0, 1.2e-4),
        "stiction": random.uniform(0.0, 0.06),
        "mismatch": random.uniform(-3e-4, 3e-4),
        "pulsation": random.uniform(0.0, 5e-4),
        "warming": random.uniform(-2e-4, 0.0),
        "gain_error": random.uniform(-1e-3, 1e-3),
        "pressure_filter": random.uniform(1e-4, 5e-4) if random.random() < 0.5 else 0.0,
    }


class Truth:
    """The rig with given parameters and effects; the names that the check asks for are told in truth_servo_actuator.py.

    supply and load are those of other rigs and not used; known: what replays of one run share.
    """

    COMMAND, OUTPUTS, PARAMETERS = "commands", OUTPUTS, PARAMETERS
    WINDOW = 250  # about two time constants of the level
    QUIET = {}

    def __init__(self, datasheet, parameters=None, effects=None, nuisance=None, supply=None, load=None, known=None):
        self.sheet, self.period = datasheet, datasheet.sample_period
        self.p = dict(datasheet.nominal)
        self.p.update(parameters or {})
        self.effects, self.ports = effects or {}, split(effects or {})
        self.nuisance = dict(NO_NUISANCE)
        self.nuisance.update(nuisance or {})
        self.known = {} if known is None else known
        self.constants = np.zeros(1, rate.CONSTANTS).view(np.recarray)
        self._constants()

    def again(self, parameters, effects, nuisance):
        """The same rig, otherwise changed."""
        return Truth(self.sheet, parameters, effects, nuisance, known=self.known)

    def _effect(self, port, effect, parameter, nothing):
        return self.ports.get(port, {}).get(effect, {}).get(parameter, nothing)

    def _constants(self):
        p, c, n = self.p, self.constants[0], self.nuisance
        c.mass, c.area_a, c.area_b, c.weight = p["mass"], p["cap_area"], p["rod_area"], p["mass"] * p["gravity"]
        c.volume_a, c.volume_b = p["chamber_a_volume"], p["chamber_b_volume"]
        c.line_a_volume, c.line_b_volume = p["line_volume_a"], p["line_volume_b"]
        c.displacement, c.internal = p["pump_displacement"], p["internal_leakage"]
        c.external_a, c.external_b = p["external_leakage_a"], p["external_leakage_b"]
        c.viscous, c.coulomb, c.width = p["viscous_friction"], p["coulomb_friction"], p["friction_width"]
        c.c1, c.c2 = p["bulk_c1"], p["bulk_c2"]
        for name in ("stiction", "mismatch", "pulsation", "warming"):
            setattr(c, name, n[name])
        more = lambda name, nothing=0.0: n.get(name) or nothing
        c.winding, c.shape = more("winding", rate.WINDING), 0.0 if more("maxwell") else more("shape", 1.0)
        for name in ("stroke_friction", "slip", "hum", "stiffening"):
            setattr(c, name, more(name))
        self.tolerance = TOLERANCE * more("tolerance", 1.0)
        c.stribeck = self._effect("force.piston", "stribeck_friction", "velocity", 0.01)
        for port, entries in CONSTANT_OF.items():
            for field, (effect, parameter) in entries.items():
                setattr(c, field, self._effect(port, effect, parameter, 0.0))
        c.air_a, c.air_b = c.air_a + more("air"), c.air_b + more("air")
        c.factor_a = self._effect("compliance.chamber_a", "compliance_factor", "factor", 1.0)
        c.factor_b = self._effect("compliance.chamber_b", "compliance_factor", "factor", 1.0)
        c.viscosity = self._effect("source.oil", "viscosity_drift", "factor", 1.0)

    def rest(self, position, total):
        c = self.constants[0]
        y = np.zeros(rate.STATES)
        y[rate.X] = position
        y[rate.PA] = (total + c.weight / c.area_b) / (1 + c.area_a / c.area_b)
        y[rate.PB] = total - y[rate.PA]
        return self.start(self.base(y))

    def base(self, y):
        """All states, those that only an effect has where they are without it."""
        base, c = np.array(y), self.constants[0]
        if c.gap == 0:
            base[rate.ROD_X : rate.ROD_V + 1] = y[rate.X : rate.V + 1]
        if c.inertance_a == 0:
            base[rate.LINE_A], base[rate.COLUMN_A] = y[rate.PA], c.area_a * y[rate.V]
        if c.inertance_b == 0:
            base[rate.LINE_B], base[rate.COLUMN_B] = y[rate.PB], c.area_b * y[rate.V]
        return base

    def start(self, base):
        """A full state from a base: a rod that was one with its plate carries or pulls it."""
        y, c = np.array(base), self.constants[0]
        if c.gap > 0 and y[rate.ROD_X] == y[rate.X]:
            y[rate.ROD_X] += 0.5 * c.gap * (-1 if y[rate.V] < -5e-3 else 1)
        return y

    def sensor(self, name):
        gain = self.nuisance["gain_error"] * {"chamber_a_pressure": 1, "chamber_b_pressure": -1}.get(name, 0)
        filtered = self.nuisance["pressure_filter"] if name.endswith("_pressure") else 0.0
        return Sensor(self.ports.get("sensor." + name, {}), self.period, 1 + gain, filtered)

    def paths(self):
        """From each pump's command to its speed; drives are a little late unless their slope is bounded."""
        result = []
        for pump in PUMPS:
            effects = dict(self.ports.get("command." + pump, {}))
            if not effects.get("rate_limit", {}).get("rate", math.inf) < math.inf:
                late = effects.get("lag", {}).get("time_constant", 0.0) + self.nuisance["drive_time"]
                effects["lag"] = {"time_constant": late}
            result.append(CommandPath(effects, self.period, self.nuisance.get("drive_hysteresis") or 0.0, 125.7))
        return result

    def run(self, duration, controller, noise_scale=1.0, seed=0):
        """Simulate with a controller; returns a dictionary of channel arrays (as recorded) and `states`, `clean`."""
        sheet, h, c = self.sheet, self.period, self.constants[0]
        count = int(round(duration / h))
        record = {name: np.zeros(count) for name in sheet.channels}
        shown = Transducers(sheet, OUTPUTS, [self.sensor(n) for n in OUTPUTS], record, noise_scale, seed)
        states, clean = np.empty((count, rate.STATES)), np.empty((count, len(OUTPUTS)))
        commands, paths = np.empty((count, 2)), self.paths()
        y = self.rest(controller.start, controller.sum(0.0))
        drive, step = np.zeros((2, 5)), 1e-4
        for k in range(count):
            t = k * h
            states[k] = self.base(y)
            for n, value in enumerate((y[rate.X], y[rate.PA], y[rate.PB])):
                clean[k, n] = shown.read(k, t, n, value)
            *wanted, record["position_reference"][k], record["pressure_sum_reference"][k] = controller(k, shown.seen)
            for n, (pump, path) in enumerate(zip(PUMPS, paths)):
                low, high = sheet.range[pump]
                grid = sheet.resolution[pump + "_command"]
                commands[k, n] = grid * math.floor(min(max(wanted[n], low), high) / grid + 0.5)
                record[pump + "_command"][k] = commands[k, n]
                ((_, _, *drive[n, :4]),) = path.pieces(k, commands[k, n])
            drive[:, 4] = t
            before = y[rate.ANGLE1], y[rate.ANGLE2]
            step = rate.integrate(y, t, t + h, min(step, h), c, drive, self.tolerance, SCALE)
            if step < 0:
                raise RuntimeError(f"the truth could not be integrated past t = {t:.4f} s")
            for n in range(2):
                clean[k, 3 + n] = shown.read(k, t, 3 + n, (y[rate.ANGLE1 + n] - before[n]) / h)
        record["commands"] = commands
        return {"t": np.arange(count) * h, "record": record, "states": states, "clean": clean, "truth": self}

    def replay(self, commands, windows, starts):
        """Outputs without noise on windows (first, last+1) of a run, each started from a state, driven by given
        commands. Memory of the command paths is taken along from the start of the run; a transducer starts settled at
        the window's first value."""
        pieces = self._pieces(commands)
        clean = []
        for (first, last), base in zip(windows, starts):
            y = self.start(base)
            shown = rate.replay(y, pieces, first, last, self.period, self.constants[0], self.tolerance, SCALE)
            if not len(shown):
                raise RuntimeError(f"the truth could not be replayed from sample {first}")
            times, slopes = np.arange(first, last) * self.period, np.zeros(last - first)  # no transducer has a delay
            shown = [self.sensor(name).all(times, shown[:, n], slopes) for n, name in enumerate(OUTPUTS)]
            clean.append(np.column_stack(shown))
        return np.concatenate(clean)

    def _pieces(self, commands):
        """A row a sample of (kind, a, b, c) of each pump; most replays of a run share them."""
        key = tuple(repr(self.ports.get("command." + pump)) for pump in PUMPS)
        key += (self.nuisance["drive_time"], self.nuisance.get("drive_hysteresis"))
        if key not in self.known:
            paths = self.paths()
            self.known[key] = np.array(
                [[v for path, u in zip(paths, row) for v in path.pieces(k, u)[0][2:]] for k, row in enumerate(commands)]
            )
        return self.known[key]
