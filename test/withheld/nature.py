"""What a truth drawn at random is by nature, in the words of the library: a case without an effect whose transducers
are slow has a lag, and to name it is no error. As wide as what a variant does: families of effects at kinds of ports.

A variant that no effect resembles (cross-talk, a clock, an integrator) has none.
"""
import twins

_SLOW = ("lag delay", "sensor. command.")
_FRICTION = ("friction", "force.")
_COMPLIANCE = ("compliance", "compliance.")

# {(class, variant)}, or {class} for all variants of it that do not stand there: families, and where ports begin
NATURE = {
    "friction": [_FRICTION],
    ("friction", "temperature"): [_FRICTION, ("temperature", "source.")],
    ("friction", "rough"): [("restriction", "restriction.")],
    ("friction", "entrance"): [("restriction", "restriction.")],
    ("valve", "second_order"): [("lag delay", "command.")],
    ("valve", "late_drives"): [("lag delay", "command.")],
    ("valve", "overlap"): [("deadzone", "command. restriction.")],
    ("valve", "underlap"): [("deadzone gain leakage", "command. restriction. flow.")],
    ("valve", "null_leakage"): [("deadzone leakage", "command. restriction. flow.")],
    ("valve", "hysteresis"): [("hysteresis", "command. force. sensor.")],
    ("valve", "uneven"): [("restriction gain offset", "command. restriction.")],
    ("valve", "curve"): [("restriction gain", "command. restriction.")],
    ("valve", "slip"): [("leakage gain", "flow. command. source.")],
    ("valve", "mismatch"): [("gain", "command. sensor.")],
    "supply": [("source", "source.")],
    ("supply", "column"): [("line", "line.")],
    "hose": [_COMPLIANCE],
    ("hose", "ripple"): [("source", "source.")],
    ("hose", "walls"): [("heat", "heat.")],
    ("hose", "loss"): [("heat", "heat.")],
    ("sensor", "bandwidth"): [_SLOW],
    ("sensor", "anti_aliasing"): [_SLOW],
    ("sensor", "hysteresis"): [("hysteresis", "sensor.")],
    ("sensor", "bow"): [("gain", "sensor.")],
    ("noise", "coarse"): [("resolution", "sensor.")],
    ("sampling", "skew"): [_SLOW],
    ("sampling", "late"): [_SLOW],
    ("sampling", "clock"): [_SLOW],
}


def has(label, name):
    """Whether effect@port is what the drawn truth of a label is by nature."""
    effect, port = name.split("@")
    return any(
        twins.family(effect + "@" + port) in families.split() and port.startswith(tuple(starts.split()))
        for drawn in label.get("classes", {}).items()
        for families, starts in NATURE.get(drawn, NATURE.get(drawn[0], []))
    )


def foreign(label, names):
    """Of the names those that are neither the case's effects nor in the truth's nature."""
    return [name for name in names if name not in label["effects"] and not has(label, name)]
