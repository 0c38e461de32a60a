"""The control valve's equations as its datasheet has them, read from the datasheet a second time and independently of
the plant's code: states in the datasheet's own coordinates, tables by their points, Runge-Kutta of fourth order."""
import math
import pathlib

import yaml

RIG = pathlib.Path(__file__).resolve().parents[3] / "config/control_valve/rig.yaml"
GAS, AIR, STROKE = 287.0, 101325.0, 0.0776
CRANK = STROKE / math.sqrt(2)


def between(x, xs, ys):
    if x <= xs[0]:
        return ys[0]
    for x_0, x_1, y_0, y_1 in zip(xs, xs[1:], ys, ys[1:]):
        if x <= x_1:
            return y_0 + (y_1 - y_0) * (x - x_0) / (x_1 - x_0)
    return ys[-1]


def outside(force, low, high):
    return force - high if force > high else force - low if force < low else 0.0


def psi(ratio):
    if ratio <= 0.528282:
        return 0.484178
    subsonic = lambda r: math.sqrt(3.5 * (r ** (10 / 7) - r ** (12 / 7)))
    return subsonic(ratio) if ratio < 0.99 else subsonic(0.99) * (1 - ratio) / 0.01


def orifice(area, p_1, p_2, temperature):
    if p_2 > p_1:
        return -orifice(area, p_2, p_1, temperature)
    return area * p_1 * psi(p_2 / p_1) * math.sqrt(2 / (GAS * temperature))


class Valve:
    """State [x_f, p_p, X, p_c, x, T_v]: m, Pa gauge, m, Pa gauge, m, N m."""

    def __init__(self):
        sheet = yaml.safe_load(RIG.read_text())
        self.value = {p["symbol"]: float(p["nominal"]) for p in sheet["parameters"]}
        self.tables = {name: table["columns"] for name, table in sheet["tables"].items()}

    def table(self, name, x, column, value="value"):
        return between(x, self.tables[name][column], self.tables[name][value])

    def flow(self, h):
        v = self.value
        c = v["a"] * h + (1 - v["a"]) * h**3
        drop = v["dp_0"] * v["DP_f"] / (v["DP_f"] + (1 - v["DP_f"]) * c * c)
        return 0.865 * v["C_v"] * c * math.sqrt(drop / 1e5) / 3600

    @staticmethod
    def opening(x):
        return (math.pi / 4 + math.asin((x - STROKE / 2) / CRANK)) / (math.pi / 2)

    @staticmethod
    def travel(h):
        return STROKE / 2 + CRANK * math.sin(h * math.pi / 2 - math.pi / 4)

    def rates(self, state, voltage, supply, temperature):
        v = self.value
        x_f, p_p, x_s, p_c, x, torque = state
        high, pre, cyl = supply + AIR, p_p + AIR, p_c + AIR

        area = math.pi / 4 * (v["d_i"] + 0.4125 * (v["d_o"] - v["d_i"])) ** 2
        coil = voltage * v["f_f"] * ((temperature - 293.15) * v["c_T"] + 1)
        d_x_f = (max(0, v["c_0"] - v["c_1"] * x_f) * p_p * area - coil - v["k_f"] * (x_f - v["x_0"])) / v["c_f"]
        d_x_f = max(d_x_f, 0) if x_f <= 0 else min(d_x_f, 0) if x_f >= 1.2e-4 else d_x_f

        force = v["A_p"] * p_p - v["A_s"] * supply - v["k_ss"] * (x_s + v["x_spre"]) - v["k_d"] * x_s
        d_x_s = outside(force, -v["F_cs"], v["F_cs"]) / v["b_s"]
        d_x_s = max(d_x_s, 0) if x_s <= 0 else min(d_x_s, 0) if x_s >= v["L_s"] else d_x_s

        nozzle = v["f_n"] * self.table("nozzle_cd", x_f, "x_m") * math.pi * v["d_i"] * x_f
        m_p = orifice(v["C_r"] * math.pi / 4 * v["d_r"] ** 2, high, pre, temperature)
        m_p -= orifice(nozzle, pre, AIR, temperature)
        d_p_p = 1.4 / (v["V_p"] + v["A_p"] * x_s) * (m_p * GAS * temperature - pre * v["A_p"] * d_x_s)

        s = x_s / v["L_s"]
        if s > 0.5:
            rows = [self.table("fill_cd", cyl / high, "pressure_ratio", c) for c in ("s_0.6", "s_0.8_and_1")]
            area = v["f_fi"] * between(s, [0.6, 0.8], rows) * v["A_v"] * (s - 0.5) / 0.5
            m_c = orifice(area, high, cyl, temperature)
        else:
            rows = [self.table("exhaust_cd", p_c, "p_c_Pa", c) for c in ("s_0", "s_0.2", "s_0.4")]
            area = v["f_ex"] * between(s, [0, 0.2, 0.4], rows) * v["A_v"] * (0.5 - s) / 0.5
            m_c = -orifice(area, cyl, AIR, temperature)

        ratio = 1 / math.sqrt(CRANK**2 - (x - STROKE / 2) ** 2)
        force = v["A_c"] * p_c - v["k_a"] * (x + v["x_a0"]) - torque * ratio
        low = -v["f_cn"] * self.table("coulomb_neg", x, "x_m", "value_N")
        d_x = outside(force, low, v["f_cp"] * self.table("coulomb_pos", x, "x_m", "value_N")) / v["b_a"]
        d_x = max(d_x, 0) if x <= 0 else min(d_x, 0) if x >= STROKE else d_x
        d_p_c = 1.4 / (v["V_d"] + v["A_c"] * x) * (m_c * GAS * temperature - cyl * v["A_c"] * d_x)

        turning = d_x * ratio
        level = v["f_mu"] * self.table("seal_mu", self.opening(x), "h") * v["F_seal"] * 0.05
        d_torque = (turning * level - abs(turning) * torque) / v["phi_w"]
        return [d_x_f, d_p_p, d_x_s, d_p_c, d_x, d_torque]

    def step(self, state, dt, *inputs):
        add = lambda a, b, c: [x + c * y for x, y in zip(a, b)]
        k_1 = self.rates(state, *inputs)
        k_2 = self.rates(add(state, k_1, dt / 2), *inputs)
        k_3 = self.rates(add(state, k_2, dt / 2), *inputs)
        k_4 = self.rates(add(state, k_3, dt), *inputs)
        return [x + dt / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip(state, k_1, k_2, k_3, k_4)]

    def outputs(self, state):
        x_f, p_p, x_s, p_c, x, torque = state
        h = self.opening(x)
        return {
            "flapper_position": x_f,
            "prestage_pressure": p_p,
            "spool_position": x_s / self.value["L_s"],
            "cylinder_pressure": p_c,
            "load_torque": torque,
            "valve_position": h,
            "flow": self.flow(h),
        }
