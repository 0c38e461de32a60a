"""Run in the built environment: writes what view_node says of a rig as JSON lines, until SIGINT or nothing comes for
QUIET s.

watch_view.py RIG QUIET FILE"""

import json
import os
import signal
import sys
import threading
import time

import rospy
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from faultline.msg import AlarmArray, Estimate

rig, quiet, file_name = rospy.myargv(sys.argv)[1:]
file = open(file_name, "w")
last = [time.monotonic() + 40]
lock = threading.Lock()  # rospy calls back from a thread per publisher


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


def estimate(message):
    write(
        {
            "topic": "estimate",
            "time": message.header.stamp.to_nsec(),
            "stage": message.stage,
            "state": dict(zip(message.state_names, message.state)),
        }
    )


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


rospy.init_node("watcher", disable_signals=True)
stopped = []
signal.signal(signal.SIGINT, lambda *_: stopped.append(True))
rospy.Subscriber("/tf", TFMessage, frames, False, queue_size=10000)
rospy.Subscriber("/tf_static", TFMessage, frames, True, queue_size=100)
rospy.Subscriber("/{}/estimate".format(rig), Estimate, estimate, queue_size=20000, tcp_nodelay=True)
rospy.Subscriber("/{}/alarms".format(rig), AlarmArray, alarms, queue_size=100)
rospy.Subscriber("/{}/view".format(rig), MarkerArray, markers, queue_size=100)
while not stopped and time.monotonic() < last[0] + float(quiet):
    time.sleep(0.05)
with lock:
    file.flush()
os._exit(0)  # callbacks may still run
