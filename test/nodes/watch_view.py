"""Run in the built environment: writes what view_node says of a rig as JSON lines, until SIGINT or nothing comes for
QUIET s. At the end: the estimates; of each plot topic that the rig's messages promise its points, each beside the
number that the message of that stamp has; of each stage how large its residuals over sigma are. Samples and estimates,
thousands a second, are kept as bytes until then: taking them apart at once, it would miss messages of a busy machine.

watch_view.py RIG QUIET FILE"""

import array
import json
import math
import os
import re
import signal
import sys
import threading
import time

import rospy
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from faultline.msg import AlarmArray, Estimate, RigDescription, Sample, Scalar

rig, quiet, file_name = rospy.myargv(sys.argv)[1:]
file = open(file_name, "w")
last = [time.monotonic() + 40]
lock = threading.Lock()  # rospy calls back from a thread per publisher
topics = {}  # of each message that is plotted, "channel" or a stage: its numbers' topics below /RIG/plot
numbers = {}  # by what and microsecond: a node's stamps are doubles and lose the last digits
points = {}  # by topic: [stamp, value]
sent = {Sample: [], Estimate: []}  # as they came over the wire
squares = {}  # by stage: its last stamp, and of each channel the mean square of residual over sigma, forgotten in 1 s


def write(entry):
    with lock:
        file.write(json.dumps(entry) + "\n")


def frames(message, still):
    last[0] = time.monotonic()
    for frame in message.transforms:
        place, turn = frame.transform.translation, frame.transform.rotation
        write(
            {
                "topic": "frame",
                "still": still,
                "time": frame.header.stamp.to_nsec(),
                "parent": frame.header.frame_id,
                "frame": frame.child_frame_id,
                "at": [place.x, place.y, place.z],
                "turn": [turn.z, turn.w],
            }
        )


def microsecond(message):
    return round(message.header.stamp.to_nsec() / 1000)


def description(message):
    topics["channel"] = ["channel/" + channel.name for channel in message.channels]


def sample(message):
    numbers["channel", microsecond(message)] = array.array("d", message.values)


def point(message, name):
    points[name].append([microsecond(message), message.value])


def promise(message):
    """The topics that a stage's numbers have."""
    names = [f"{message.stage}/state/{name}" for name in message.state_names]
    names += [f"{message.stage}/quantity/{quantity.name}" for quantity in message.quantities]
    names += [f"{message.stage}/residual/{name}" for name in message.channel_names]
    topics.setdefault(message.stage, [re.sub("[^A-Za-z0-9/]", "_", name) for name in names])


def estimate(message):
    promise(message)
    stamp = message.header.stamp.to_nsec()
    write(
        {
            "topic": "estimate",
            "time": stamp,
            "stage": message.stage,
            "state": dict(zip(message.state_names, message.state)),
        }
    )
    ratios = [e / s if s > 0 else math.nan for e, s in zip(message.innovation, message.innovation_std)]
    values = [*message.state, *(quantity.value for quantity in message.quantities), *ratios]
    numbers[message.stage, microsecond(message)] = array.array("d", values)
    before, means = squares.get(message.stage, (stamp, {}))
    if message.restarted:
        before, means = stamp, {}
    share = -math.expm1(-max(0, stamp - before) / 1e9)
    for name, ratio in zip(message.channel_names, ratios):
        if math.isfinite(ratio):
            means[name] = means.get(name, 0) + share * (ratio**2 - means.get(name, 0))
    squares[message.stage] = (stamp, means)


def markers(message):
    write(
        {
            "topic": "markers",
            "markers": [
                {
                    "ns": marker.ns,
                    "id": marker.id,
                    "frame": marker.header.frame_id,
                    "action": marker.action,
                    "at": [marker.pose.position.x, marker.pose.position.y],
                    "size": [marker.scale.x, marker.scale.y],
                    "colour": [round(c, 3) for c in (marker.color.r, marker.color.g, marker.color.b)],
                    "text": marker.text,
                }
                for marker in message.markers
            ],
        }
    )


def alarms(message):
    write(
        {
            "topic": "alarms",
            "alarms": [
                {name: getattr(alarm, name) for name in ("kind", "effect", "port", "level", "active", "confidence")}
                for alarm in message.alarms
            ],
        }
    )


def keep(topic, kind):
    rospy.Subscriber(
        f"/{rig}/{topic}",
        rospy.AnyMsg,
        lambda message: sent[kind].append(message._buff),  # all that rospy has of a message that it does not take apart
        queue_size=20000,
        tcp_nodelay=True,
    )


rospy.init_node("watcher", disable_signals=True)
stopped = []
signal.signal(signal.SIGINT, lambda *_: stopped.append(True))
rospy.Subscriber("/tf", TFMessage, frames, False, queue_size=10000)
rospy.Subscriber("/tf_static", TFMessage, frames, True, queue_size=100)
keep("estimate", Estimate)
keep("sample", Sample)
rospy.Subscriber("/{}/alarms".format(rig), AlarmArray, alarms, queue_size=100)
rospy.Subscriber("/{}/view".format(rig), MarkerArray, markers, queue_size=100)
rospy.Subscriber("/{}/description".format(rig), RigDescription, description, queue_size=1)
while not stopped and time.monotonic() < last[0] + float(quiet):
    for message in sent[Estimate][-4:]:  # of every stage after a few times
        promise(Estimate().deserialize(message))
    for name in [name for names in list(topics.values()) for name in names if name not in points]:
        points[name] = []
        rospy.Subscriber("/{}/plot/{}".format(rig, name), Scalar, point, name, queue_size=1000)
    time.sleep(0.05)
for kind, take in ((Sample, sample), (Estimate, estimate)):
    for message in list(sent[kind]):
        take(kind().deserialize(message))
for what, names in list(topics.items()):
    told = sum(1 for key in list(numbers) if key[0] == what)
    for i, name in enumerate(names):
        said = [[stamp, value, numbers.get((what, stamp), {i: None})[i]] for stamp, value in points.get(name, [])]
        write({"topic": "plot", "name": name, "told": told, "points": said})
for stage, (_, means) in squares.items():
    write({"topic": "residuals", "stage": stage, "ratio": {name: math.sqrt(mean) for name, mean in means.items()}})
with lock:
    file.flush()
os._exit(0)  # callbacks may still run
