"""Which size an effect gets: one knob q in [0, 1] from barely there to as strong as its port allows, on a log scale.

A template fixes everything but the size (signs, the second parameter), drawn once per case.
"""
import math

SIGNED = {("offset", "value"), ("drift", "rate"), ("asymmetric_friction", "difference"), ("gain_curve", "curvature")}
AROUND_ONE = {
    ("scale", "factor"),
    ("area_curve", "exponent"),
    ("compliance_factor", "factor"),
    ("viscosity_drift", "factor"),
}
FROM_INFINITY = {("rate_limit", "rate"), ("saturation", "limit"), ("end_stop", "position")}
SPAN = 2.5  # decades between weakest and strongest where the port gives no lower bound
# Parameters whose number means the same in the truth and in the datasheet, so that an interval for it can be scored.
NOT_COMPARABLE = {"entrained_air", "stribeck_friction", "end_stop", "hysteresis", "stuck", "ripple"}


def main_parameter(effect):
    return {
        "stribeck_friction": "static_excess",
        "load_force": "constant",
        "end_stop": "position",
        "ripple": "amplitude",
        "elasticity": "compliance",
        "stuck": "from",
        "relief_opening": "slope",
    }.get(effect)


def template(key, bounds, random):
    """What of the effect is fixed for the case: sign of the main parameter and values of the others."""
    effect = key.split("@")[0]
    main = main_parameter(effect) or next(iter(bounds))
    fixed = {"main": main, "sign": 1 if random.random() < 0.5 else -1}
    for name, (low, high) in bounds.items():
        if name == main:
            continue
        if effect == "load_force":
            fixed[name] = 0.0
        else:
            low = low or 1e-3 * high
            fixed[name] = low * (high / low) ** random.random()
    if effect == "load_force" and "stiffness" in bounds and random.random() < 0.35:
        fixed["main"], fixed["sign"], fixed["constant"] = "stiffness", 1, 0.0
        fixed.pop("stiffness", None)
    if effect == "stuck":
        fixed["from"] = random.uniform(6.0, 16.0)
    return fixed


def value(key, bounds, fixed, q):
    """Parameters of the effect at knob q."""
    effect = key.split("@")[0]
    main, sign = fixed["main"], fixed["sign"]
    result = {name: v for name, v in fixed.items() if name not in ("main", "sign")}
    if effect == "stuck":
        return {"from": fixed["from"]}
    low, high = bounds[main]
    q = min(max(q, 0.0), 1.0)
    if (effect, main) in AROUND_ONE:
        far = high - 1 if sign > 0 else 1 - low
        if effect == "compliance_factor":
            far = math.log(high) if sign > 0 else -math.log(low)
            result[main] = math.exp(sign * far * 10 ** (-SPAN * (1 - q)))
        else:
            result[main] = 1 + sign * far * 10 ** (-SPAN * (1 - q))
    elif (effect, main) in SIGNED or (effect, main) == ("load_force", "constant"):
        far = high if sign > 0 else -low
        result[main] = sign * far * 10 ** (-SPAN * (1 - q))
    elif (effect, main) in FROM_INFINITY:
        result[main] = high * (low / high) ** q
    else:
        low = max(low, high * 10**-4) if low <= 0 else low
        result[main] = low * (high / low) ** q
    return result


def nothing(key, fixed):
    """The value at which the effect changes nothing."""
    effect = key.split("@")[0]
    main = fixed["main"]
    result = {name: v for name, v in fixed.items() if name not in ("main", "sign")}
    if effect == "end_stop":
        result["stiffness"] = 0.0
        result["position"] = 1.0
    elif (effect, main) in AROUND_ONE:
        result[main] = 1.0
    elif (effect, main) in FROM_INFINITY or effect == "stuck":
        result[main] = math.inf
    else:
        result[main] = 0.0
    return result


def scaled(key, bounds, values, main, ratio):
    """The effect `ratio` times as strong, kept within its port's bounds."""
    effect = key.split("@")[0]
    result = dict(values)
    low, high = bounds[main]
    if (effect, main) in AROUND_ONE:
        result[main] = 1 + ratio * (values[main] - 1)
    elif (effect, main) in FROM_INFINITY:
        result[main] = values[main] / max(ratio, 1e-6)
    elif effect != "stuck":
        result[main] = ratio * values[main]
    result[main] = min(max(result[main], low), high)
    return result
