"""Run in the built environment: hands the isolator's two topics of a rig on to RIG/lossy/..., but for some samples,
lets the replay go on once both ends are connected, and writes what the alarm node of the whole topics and the one of
the lossy ones say, as one JSON object, on SIGINT.

lossy_relay.py RIG FILE LOST_DETECTIONS LOST_HYPOTHESES   (sequence numbers with commas)"""

import json
import pathlib
import signal
import sys
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from faultline.msg import AlarmArray, Detections, Hypotheses
from std_srvs.srv import SetBool

words = rospy.myargv(sys.argv)
rig, file = words[1], pathlib.Path(words[2])
lost = [{int(number) for number in word.split(",")} for word in words[3:5]]
said = {"alarms": [], "lossy/alarms": [], "counts": {}}
rospy.init_node("relay", disable_signals=True)
signal.signal(signal.SIGINT, lambda *_: rospy.signal_shutdown("over"))


def hand_on(topic, kind, missing):
    out = rospy.Publisher(f"/{rig}/lossy/{topic}", kind, queue_size=100000, tcp_nodelay=True)

    def take(message):
        if message.sequence not in missing:
            out.publish(message)

    heard = rospy.Subscriber(f"/{rig}/{topic}", kind, take, queue_size=100000, tcp_nodelay=True)
    return lambda: heard.get_num_connections() > 0 and out.get_num_connections() > 0


def keep(topic):
    def take(message):
        said[topic] = [
            [a.kind, a.effect, a.port, a.since.to_nsec(), a.raised.to_nsec(), a.active] for a in message.alarms
        ]

    rospy.Subscriber(f"/{rig}/{topic}", AlarmArray, take, queue_size=100)


def count(message):
    for status in message.status:
        values = {value.key: value.value for value in status.values}
        if "lossy_alarms" in status.name and "lost" in values:
            said["counts"] = values


connected = [hand_on("detections", Detections, lost[0]), hand_on("hypotheses", Hypotheses, lost[1])]
keep("alarms")
keep("lossy/alarms")
rospy.Subscriber("/diagnostics", DiagnosticArray, count, queue_size=100)
# The replay begins paused.
while not rospy.is_shutdown() and not all(there() for there in connected):
    time.sleep(0.1)
if not rospy.is_shutdown():
    go_on = rospy.ServiceProxy(f"/{rig}/player/pause_playback", SetBool)
    go_on.wait_for_service(30)
    time.sleep(2)  # a subscriber counts a connection before the other end sends through it
    go_on(False)
while not rospy.is_shutdown():
    time.sleep(0.1)
file.write_text(json.dumps(said))
