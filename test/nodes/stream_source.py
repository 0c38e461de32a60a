"""Run in the built environment: a source of samples that does what it is told to do wrong. Reads lines from standard
input, each the name of a KIND below, and goes on sending that kind until the next; ends with the input. `unfit` sends
one estimate and one judgement that are not of this rig beside them. Stamps go on
with every sample, 1 ms apart where nothing else is said; with CLOCK this node publishes simulated time that goes on
like the stamps of good samples, while it is silent too.

stream_source.py RIG_YAML NODE_NAME FIRST_STAGE [clock]"""

import sys
import threading

import rospy
import yaml
from faultline.msg import ChannelDescription, Detections, Estimate, Hypotheses, RigDescription, Sample
from rosgraph_msgs.msg import Clock

sheet = yaml.safe_load(open(sys.argv[1]))
channels = sheet["channels"]
values = [sum(channel["range"]) / 2 for channel in channels]
rig = sheet["rig"]
rospy.init_node(sys.argv[2], disable_signals=True)
descriptions = rospy.Publisher(f"/{rig}/description", RigDescription, queue_size=1, latch=True)
samples = rospy.Publisher(f"/{rig}/sample", Sample, queue_size=1000, tcp_nodelay=True)
estimates = rospy.Publisher(f"/{rig}/estimate", Estimate, queue_size=1)
detections = rospy.Publisher(f"/{rig}/detections", Detections, queue_size=1)
hypotheses = rospy.Publisher(f"/{rig}/hypotheses", Hypotheses, queue_size=1)
clock = rospy.Publisher("/clock", Clock, queue_size=10, tcp_nodelay=True) if "clock" in sys.argv[4:] else None
kind, over = ["good"], []


def describe(period=1.0, swapped=False):
    message = RigDescription(rig=rig, sample_period=period * sheet["sample_period"], made_by="a test")
    order = list(reversed(channels)) if swapped else channels
    message.channels = [ChannelDescription(name=c["name"], unit=str(c["unit"]), role=c["role"]) for c in order]
    descriptions.publish(message)


def stamp(number):
    return rospy.Time.from_sec(1.7e9) + rospy.Duration.from_sec(1e-3 * number)


KINDS = {
    "good": lambda k: (k, stamp(k), values),
    "zero": lambda k: (k, rospy.Time(0), values),
    "rate": lambda k: (k, stamp(10 * k), values),
    "jitter": lambda k: (k, stamp(k + (0.4 if k % 2 else 0)), values),
    "uncounted": lambda k: (7, stamp(k), values),
    "down": lambda k: ((1 << 40) - k, stamp(k), values),
    "by_tens": lambda k: (10 * k, stamp(k), values),
    "at_random": lambda k: (k**3 % 997, stamp(k), values),
    "short": lambda k: (k, stamp(k), values[:-1]),
    "silent": None,
}


def listen():
    for line in sys.stdin:
        word = line.strip()
        if word == "described_at_half_the_rate":
            describe(period=2.0)
        elif word == "described_otherwise":
            describe(swapped=True)
        elif word == "unfit":
            # Alone, or the two halves of the judgement would be torn apart by those of the samples.
            sent, kind[0] = kind[0], "silent"
            rospy.rostime.wallsleep(0.5)
            estimates.publish(Estimate(stage=sys.argv[3]))
            detections.publish(Detections(sequence=1 << 40))
            hypotheses.publish(Hypotheses(sequence=1 << 40))
            rospy.rostime.wallsleep(0.2)
            kind[0] = sent
        elif word == "described":
            describe()
        else:
            kind[0] = word
    over.append(True)


threading.Thread(target=listen, daemon=True).start()
number = 0
while not over and not rospy.is_shutdown():
    # Steps on, so that each batch of a kind is a run of its own.
    if clock:
        clock.publish(Clock(stamp(number)))
    for _ in range(50):
        if KINDS[kind[0]]:
            message = Sample(values=[])
            message.sequence, message.header.stamp, message.values = KINDS[kind[0]](number)
            samples.publish(message)
        number += 1
    rospy.rostime.wallsleep(0.05)
