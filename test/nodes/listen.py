"""Run in the built environment: writes what comes on a rig's topics as JSON lines, until nothing comes for QUIET s, or
until SIGINT and what was under way then is written.

listen.py RIG QUIET FILE TOPIC..."""

import json
import os
import signal
import sys
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from faultline.msg import AlarmArray, Detections, Estimate, Gap, Histogram, Hypotheses, Sample

words = rospy.myargv(sys.argv)
rig, quiet, file_name, topics = words[1], float(words[2]), words[3], words[4:]
file = open(file_name, "w")
last = [time.monotonic() + 20]
lock = threading.Lock()  # rospy calls back from a thread per publisher


def write(entry):
    last[0] = time.monotonic()
    with lock:
        file.write(json.dumps(entry) + "\n")


def sample(message):
    write(
        {
            "topic": "sample",
            "time": message.header.stamp.to_nsec(),
            "sequence": message.sequence,
            "values": list(message.values),
        }
    )


def estimate(message):
    if message.stage == "responses":  # speaks only now and then
        return
    write(
        {
            "topic": "estimate",
            "time": message.header.stamp.to_nsec(),
            "sequence": message.sequence,
            "stage": message.stage,
            "quantities": {quantity.name: quantity.value for quantity in message.quantities},
            "restarted": message.restarted,
            "finite": all(abs(value) < 1e300 for value in message.state),
            "status": list(message.channel_status),
        }
    )


def alarms(message):
    write(
        {
            "topic": "alarms",
            "time": message.header.stamp.to_nsec(),
            "verdict": message.verdict,
            "alarms": [
                {
                    "kind": alarm.kind,
                    "effect": alarm.effect,
                    "port": alarm.port,
                    "level": alarm.level,
                    "since": alarm.since.to_nsec(),
                    "raised": alarm.raised.to_nsec(),
                    "until": alarm.until.to_nsec(),
                    "active": alarm.active,
                    "size": alarm.size,
                    "text": alarm.text,
                    "equivalent": alarm.equivalent,
                }
                for alarm in message.alarms
            ],
        }
    )


def detections(message):
    write(
        {
            "topic": "detections",
            "time": message.header.stamp.to_nsec(),
            "sequence": message.sequence,
            "active": {d.name: d.since for d in message.detections if d.active},
        }
    )


def hypotheses(message):
    write(
        {
            "topic": "hypotheses",
            "time": message.header.stamp.to_nsec(),
            "sequence": message.sequence,
            "active": {h.name: [h.effect, h.port, h.since, h.confidence] for h in message.hypotheses if h.active},
        }
    )


def gap(message):
    write(
        {
            "topic": "gap",
            "time": message.header.stamp.to_nsec(),
            "channels": list(message.channels),
            "smoothed": list(message.smoothed),
            "normal": list(message.normal),
            "judged": message.judged,
            "left_normal": message.left_normal,
            "since": message.since.to_nsec(),
            "port": message.port,
            "effect": message.effect,
            "share": message.share,
            "text": message.text,
        }
    )


def histogram(message):
    def numbers(values):
        return [None if value != value else value for value in values]

    write(
        {
            "topic": "histogram",
            "time": message.header.stamp.to_nsec(),
            "variable": message.variable,
            "axes": list(message.axes),
            "axis_bins": list(message.axis_bins),
            "sections": message.sections,
            "population": list(message.population),
            "counts": list(message.counts),
            "mean": numbers(message.mean),
            "low": numbers(message.low),
            "high": numbers(message.high),
            "above": message.above,
            "below": message.below,
            "level": message.level,
            "judging": message.judging,
        }
    )


def diagnostics(message, topic="diagnostics"):
    entry = {
        "topic": topic,
        "status": [
            {
                "name": status.name,
                "level": ord(status.level) if isinstance(status.level, bytes) else status.level,
                "message": status.message,
                "values": {value.key: value.value for value in status.values},
            }
            for status in message.status
        ],
    }
    with lock:
        file.write(json.dumps(entry) + "\n")
        file.flush()  # once a second: who reads the file while it grows need not wait for a full buffer


rospy.init_node("listener", disable_signals=True)
stopped = []
signal.signal(signal.SIGINT, lambda *_: stopped.append(True))
kinds = {
    "sample": (Sample, sample),
    "estimate": (Estimate, estimate),
    "alarms": (AlarmArray, alarms),
    "detections": (Detections, detections),
    "hypotheses": (Hypotheses, hypotheses),
    "gap": (Gap, gap),
    "histogram": (Histogram, histogram),
}
for topic in topics:
    if topic in ("diagnostics", "diagnostics_agg"):
        rospy.Subscriber(f"/{topic}", DiagnosticArray, diagnostics, topic, queue_size=1000)
    else:
        rospy.Subscriber(f"/{rig}/{topic}", kinds[topic][0], kinds[topic][1], queue_size=20000, tcp_nodelay=True)
while not stopped and time.monotonic() < last[0] + quiet:
    time.sleep(0.02)
# A busy machine leaves messages in the queues when the nodes have ended; a live rig never falls silent.
interrupted = last[0] = time.monotonic()
while stopped and time.monotonic() < min(last[0] + 0.5, interrupted + 8):
    time.sleep(0.02)
with lock:
    file.flush()
os._exit(0)  # callbacks may still run
