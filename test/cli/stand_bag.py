"""A made-up stand with topics of its own, and the sheet and mapping of a small rig for it. Run in the built environment
(`python3 stand_bag.py BAG [key=value...]`) it writes a bag; imported, it has the numbers.

Topics: /motor/voltage std_msgs/Float64 (on change, no header), /joints sensor_msgs/JointState (names lift, swing),
/load geometry_msgs/WrenchStamped, /supply sensor_msgs/FluidPressure, /note std_msgs/String."""
import math
import sys

SHEET = """
rig: stand
title: A stand of somebody else
source: made up for a test
sample_period: 0.01
channels:
  - {name: stroke_wanted, symbol: r, unit: m, role: setpoint, range: [-1, 1], noise_std: 0, resolution: 0, meaning: r}
  - {name: voltage, symbol: u, unit: V, role: command, range: [-10, 10], noise_std: 0, resolution: 0, meaning: u}
  - {name: stroke, symbol: x, unit: m, role: output, range: [-0.9, 0.9], noise_std: 1.0e-4, resolution: 0, meaning: x}
  - {name: load, symbol: F, unit: N, role: output, range: [-500, 500], noise_std: 1, resolution: 0, meaning: F}
  - {name: supply, symbol: p, unit: Pa, role: input, range: [0, 1.0e+7], noise_std: 100, resolution: 0, meaning: p}
states:
  - {name: x, symbol: x, unit: m}
parameters:
  - {name: mass, symbol: m, unit: kg, nominal: 1, tolerance: 0.1, from: guess}
ports:
  sensor.stroke: {component: transducer, meaning: stroke, effects: {offset: {value: [-1, 1]}}}
"""

MAPPING = """
channels:
  voltage: {from: /motor/voltage/data, hold: .inf}
  stroke: {from: "/joints/position[lift]", unit: mm}
  load: {from: /load/wrench/force/z, sign: -1}
  supply: {from: /supply/fluid_pressure}
"""

START = 1700000000  # s since 1970
DURATION = 4.0


def voltage(t):
    return 2.0 if t >= 2.5 else -1.5 if t >= 1.3 else 0.5


def stroke(t):
    return 0.4 * math.sin(3 * t)


def load(t):
    return 100 * math.cos(2 * t)


def supply(t):
    return 5e6 + 1e5 * t


def messages(joints_every=0.01, load_every=0.01, supply_every=0.01, offset=0.0, stamps=True, tone=0.0):
    """(topic, message, time of receipt in ns), in the order of receipt."""
    import genpy
    from geometry_msgs.msg import WrenchStamped
    from sensor_msgs.msg import FluidPressure, JointState
    from std_msgs.msg import Float64, String

    made = []

    def add(topic, message, t, late):
        nanoseconds = START * 10**9 + round(t * 1e9)
        if hasattr(message, "header") and stamps:
            message.header.stamp = genpy.Time(nanoseconds // 10**9, nanoseconds % 10**9)
        made.append((nanoseconds + late, len(made), topic, message))

    def times(every, shift=0.0):
        return [k * every + shift for k in range(round(DURATION / every) + 1)]

    for t in times(joints_every):
        value = 1000 * stroke(t) + 1000 * tone * math.sin(2 * math.pi * 97 * t)
        add("/joints", JointState(name=["swing", "lift"], position=[0.1, value]), t, 300000)
    for t in times(load_every, offset):
        message = WrenchStamped()
        message.wrench.force.z = -load(t)
        add("/load", message, t, 500000)
    for t in times(supply_every):
        add("/supply", FluidPressure(fluid_pressure=supply(t)), t, 100000)
    for t in (0.0, 1.3, 2.5):
        add("/motor/voltage", Float64(voltage(t)), t - 0.005, 0)
    add("/note", String("begun"), 0, 0)
    return [(topic, message, received) for received, _, topic, message in sorted(made, key=lambda entry: entry[:2])]


def write(path, change=None, **options):
    """`change`: takes and gives the list of messages."""
    import genpy
    import rosbag

    wanted = messages(**options)
    with rosbag.Bag(str(path), "w") as bag:
        for topic, message, received in change(wanted) if change else wanted:
            bag.write(topic, message, genpy.Time(received // 10**9, received % 10**9))


if __name__ == "__main__":
    write(sys.argv[1], **{key: float(value) for key, value in (word.split("=") for word in sys.argv[2:])})
