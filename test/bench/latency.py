#!/usr/bin/env python3
"""End-to-end latency over ROS at 1 kHz: sample published -> estimate received, and bad sample -> data alarm received.

Starts a ROS master, kalman_node, isolator_node and alarm_node of its own on 127.0.0.1, publishes samples of the servo
actuator that `faultline simulate` made (--csv), and takes wall times at the publisher and at the subscriber, in one
process. Every 2.5 s, from 5 s on, the velocity of one sample is missing: the data alarm that follows is timed from that
sample. Prints p50, p99 and maximum in ms. Estimates are read as bytes, so that what is timed is the graph and not
Python's unpacking.
Leaves nothing running. """
import argparse
import csv
import math
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

RATE = 1000  # samples per second
ALARM_EVERY = 2.5  # s; a data alarm stays for one second after its last bad sample
SETTLE = 3.0  # s at the start that do not count


def free_port():
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


def rows_of(path):
    with open(path, newline='') as file:
        reader = csv.reader(line for line in file if not line.startswith('#'))
        names = [name.split('[')[0].strip() for name in next(reader)][1:]
        return names, [[float(value) for value in row[1:]] for row in reader]


def percentile(ordered, share):
    return ordered[min(len(ordered) - 1, int(math.ceil(share * len(ordered))) - 1)]


def line(name, times, expected):
    if not times:
        return f'{name:32s} nothing arrived'
    ordered = sorted(1e3 * t for t in times)
    return (
        f'{name:32s} p50 {percentile(ordered, 0.5):7.3f} ms   p99 {percentile(ordered, 0.99):7.3f} ms   '
        f'max {ordered[-1]:7.3f} ms   ({len(ordered)} of {expected})'
    )


def measure(arguments):
    import rospy
    from faultline.msg import AlarmArray, ChannelDescription, RigDescription, Sample

    names, rows = rows_of(arguments.csv)
    published, arrived, alarm_sent, alarms = {}, {}, [], []
    lock = threading.Lock()

    def estimate(message):
        now = time.monotonic()
        raw = message._buff  # header: seq, secs, nsecs, length of frame_id, frame_id; then the sample's sequence
        length = struct.unpack_from('<I', raw, 12)[0]
        arrived[struct.unpack_from('<Q', raw, 16 + length)[0]] = now

    known = set()

    def alarm(message):
        now = time.monotonic()
        for entry in message.alarms:
            key = (entry.port, entry.raised.to_nsec())
            if entry.port == 'sensor.velocity' and entry.active and key not in known:
                known.add(key)
                with lock:
                    if alarm_sent:
                        alarms.append(now - alarm_sent[-1])

    rospy.init_node('latency', anonymous=True, disable_signals=True)
    rig = arguments.rig
    described = rospy.Publisher(f'/{rig}/description', RigDescription, latch=True, queue_size=1)
    samples = rospy.Publisher(f'/{rig}/sample', Sample, queue_size=1000, tcp_nodelay=True)
    rospy.Subscriber(f'/{rig}/estimate', rospy.AnyMsg, estimate, queue_size=1000, tcp_nodelay=True)
    rospy.Subscriber(f'/{rig}/alarms', AlarmArray, alarm, queue_size=100, tcp_nodelay=True)
    sheet = description_of(arguments, names)
    description = RigDescription(
        rig=rig,
        sample_period=1 / RATE,
        made_by='latency.py',
        channels=[ChannelDescription(name=n, unit=u, role=r) for n, u, r in sheet],
    )
    described.publish(description)
    until = time.monotonic() + 20
    while samples.get_num_connections() < 1:
        if time.monotonic() > until:
            sys.exit('latency: kalman_node did not subscribe within 20 s')
        time.sleep(0.05)
    time.sleep(1.5)

    start, stamp = time.monotonic(), time.time()
    velocity, next_bad = names.index('velocity'), 5.0
    count = int(arguments.duration * RATE)
    message = Sample()
    message.header.frame_id = rig
    for k in range(count):
        wait = start + k / RATE - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        values = list(rows[k % len(rows)])
        bad = k / RATE >= next_bad
        if bad:
            values[velocity] = math.nan
            next_bad += ALARM_EVERY
        message.header.stamp = rospy.Time.from_sec(stamp + k / RATE)
        message.sequence = k
        message.values = values
        published[k] = time.monotonic()
        if bad:
            with lock:
                alarm_sent.append(published[k])
        samples.publish(message)
    time.sleep(1)
    late = time.monotonic() - start - count / RATE - 1
    times = [arrived[k] - published[k] for k in published if k >= SETTLE * RATE and k in arrived]
    print(line('sample -> estimate', times, count - int(SETTLE * RATE)))
    print(line('bad sample -> data alarm', alarms, len(alarm_sent)))
    if late > 0.1:
        print(f'the publisher fell {late:.2f} s behind: this machine is busy')
    lost = count - len(arrived)
    if lost:
        print(f'{lost} of {count} estimates never arrived')
    rospy.signal_shutdown('done')
    return 0 if times and alarms and not lost else 1


def description_of(arguments, names):
    import yaml

    with open(arguments.sheet) as file:
        channels = {c['name']: c for c in yaml.safe_load(file)['channels']}
    return [(n, str(channels[n]['unit']), channels[n]['role']) for n in names]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--programs', required=True, help='folder of kalman_node, isolator_node and alarm_node')
    parser.add_argument('--csv', required=True, help='samples, as faultline simulate writes them')
    parser.add_argument('--sheet', required=True, help='the datasheet of the rig')
    parser.add_argument('--rig', default='servo_actuator')
    parser.add_argument('--duration', type=float, default=20, help='s')
    arguments = parser.parse_args()

    port = free_port()
    os.environ.update(ROS_MASTER_URI=f'http://127.0.0.1:{port}', ROS_IP='127.0.0.1')
    os.environ.pop('ROS_HOSTNAME', None)
    started = []

    def begin(*command):
        started.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
        )

    try:
        begin('roscore', '-p', str(port))
        until = time.monotonic() + 30
        while time.monotonic() < until:
            with socket.socket() as probe:
                if probe.connect_ex(('127.0.0.1', port)) == 0:
                    break
            time.sleep(0.1)
        time.sleep(2)
        begin(os.path.join(arguments.programs, 'alarm_node'), f'_rig:={arguments.rig}', f'__ns:={arguments.rig}')
        begin(os.path.join(arguments.programs, 'isolator_node'), f'_rig:={arguments.rig}', f'__ns:={arguments.rig}')
        begin(os.path.join(arguments.programs, 'kalman_node'), f'_rig:={arguments.rig}', f'__ns:={arguments.rig}')
        return measure(arguments)
    finally:
        for process in reversed(started):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        for process in started:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


if __name__ == '__main__':
    sys.exit(main())
