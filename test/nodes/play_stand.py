"""Run in the built environment: publishes a bag's topics as a stand would, in simulated time, and writes the samples
that a driver makes of them as JSON lines.

play_stand.py BAG RIG TOPIC,... LAST AHEAD FILE
No message goes out that lies more than AHEAD s before the newest sample: what is compared then does not depend on how
busy the machine is. Behind a message of the topic /command it waits until the driver has seen that nothing more comes.
Ends when a sample of LAST s (since 1970) came, or with exit code 1 when nothing moves for 20 s."""

import json
import os
import sys
import threading
import time

import rosbag
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

from faultline.msg import Sample

bag, rig, topics, last, ahead, file_name = sys.argv[1:]
topics, last, ahead = topics.split(","), float(last), float(ahead)
BEGIN = 0.9  # s of the stand's time before the first sample
samples, received = [], [0]
moved = threading.Condition()


def take(message):
    with moved:
        samples.append(message)
        moved.notify_all()


def hear(message):
    with moved:
        for status in message.status:
            for value in status.values:
                if value.key == "values received":
                    received[0] = int(value.value)
        moved.notify_all()


def wait(condition, what):
    limit = time.monotonic() + 20
    with moved:
        while not condition():
            moved.wait(0.1)
            if time.monotonic() > limit:
                print(f"nothing moves: {what}", flush=True)
                os._exit(1)


def newest():
    return samples[-1].header.stamp.to_sec() if samples else 0.0


rospy.init_node("stand", disable_signals=True)
rospy.Subscriber(f"/{rig}/sample", Sample, take, queue_size=None, tcp_nodelay=True)
rospy.Subscriber("/diagnostics", DiagnosticArray, hear)
messages = list(rosbag.Bag(bag).read_messages(topics=topics))
publishers = {
    topic: rospy.Publisher(topic, type(message), queue_size=None, tcp_nodelay=True) for topic, message, _ in messages
}
clock = rospy.Publisher("/clock", Clock, queue_size=None, tcp_nodelay=True)
wait(lambda: all(p.get_num_connections() > 0 for p in publishers.values()), "the driver does not subscribe")
start = messages[0][2]
while received[0] == 0:  # until simulated time has begun at the driver, which tells of it once a second
    clock.publish(Clock(start))
    publishers[messages[0][0]].publish(messages[0][1])
    with moved:
        moved.wait(0.1)
for topic, message, stamp in messages[1:]:
    seconds = stamp.to_sec()
    if seconds > start.to_sec() + BEGIN:
        wait(lambda: seconds < newest() + ahead, f"at {seconds}, newest sample {newest()}")
    clock.publish(Clock(stamp))
    publishers[topic].publish(message)
    if topic == "/command" and samples:
        wait(lambda: newest() > seconds - 0.12, f"behind the command of {seconds}")
wait(lambda: newest() >= last - 1e-4, f"the end: newest sample {newest()}, wanted {last}")
with open(file_name, "w") as file:
    for sample in samples:
        entry = {"stamp": sample.header.stamp.to_nsec(), "sequence": sample.sequence, "values": list(sample.values)}
        file.write(json.dumps(entry) + "\n")
os._exit(0)
