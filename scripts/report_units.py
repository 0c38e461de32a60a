"""From SI, in which all data are kept, to the units that people at a test stand read: bar, mm, l/s."""
import math

# SI unit: (factor, shift, unit shown);  shown = factor * value + shift
ENGINEERING = {
    "m": (1e3, 0.0, "mm"),
    "m/s": (1e3, 0.0, "mm/s"),
    "m^2": (1e4, 0.0, "cm²"),
    "m^3": (1e3, 0.0, "l"),
    "m^3/s": (1e3, 0.0, "l/s"),
    "Pa": (1e-5, 0.0, "bar"),
    "Pa/s": (1e-5, 0.0, "bar/s"),
    "K": (1.0, -273.15, "°C"),
    "kg/s": (1e3, 0.0, "g/s"),
    "rad": (180.0 / math.pi, 0.0, "°"),
    "rad/s": (30.0 / math.pi, 0.0, "1/min"),
}


def pretty_unit(unit):
    """`m^3/(s sqrt(Pa))` as a person writes it: m³/(s √Pa)."""
    if unit in ("", "1", "-"):
        return ""
    return unit.replace("sqrt(Pa)", "√Pa").replace("^2", "²").replace("^3", "³").replace("N m", "N·m").replace("*", "·")


class Scale:
    """How one SI unit is shown. A spread, such as a standard deviation, takes `span`: no shift."""

    def __init__(self, unit, engineering=True):
        self.factor, self.shift, self.unit = ENGINEERING.get(unit, (1.0, 0.0, pretty_unit(unit)))
        if not engineering:
            self.factor, self.shift, self.unit = 1.0, 0.0, pretty_unit(unit)

    def value(self, number):
        return self.factor * number + self.shift

    def span(self, number):
        return abs(self.factor) * number


def decimals_for(number, digits=3):
    """Decimal places that leave `number` with so many significant digits."""
    if number == 0 or not math.isfinite(number):
        return 0
    return max(0, digits - 1 - int(math.floor(math.log10(abs(number)))))


def show(number, digits=3, decimals=None):
    """A number in few digits, without the letters of a computer's notation."""
    if number is None or not math.isfinite(number):
        return "–"
    if number != 0 and not 1e-4 <= abs(number) < 1e6:
        mantissa, exponent = "{:.{}e}".format(number, digits - 1).split("e")
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return mantissa.replace("-", "−") + "·10" + raised
    if decimals is None:
        decimals = decimals_for(number, digits)
    return "{:.{}f}".format(number, decimals).replace("-", "−")


def words(name):
    """`orifice_leakage` as words."""
    return name.replace("_", " ")
