#!/usr/bin/python3
"""Prints the alarms of a rig as they appear, and the verdict at the end.

  rosrun faultline watch_alarms.py [--rig RIG]          until Ctrl-C
  rosrun faultline watch_alarms.py --until-replay-ends  until whatever publishes /clock is gone

Times count from the first sample of the bag that --bag names, else from the first message. It subscribes to the alarms
alone: the player and the nodes wait for subscribers of samples and estimates, and a listener must not be taken for one
of them. Exit: 0; 1 if no verdict came at all; 2 for bad usage or bad input.
"""
import argparse
import os
import signal
import socket
import sys
import threading
import time
import xmlrpc.client

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.dont_write_bytecode = True

from report_units import decimals_for, show, words  # noqa: E402

QUIET = 0.5  # s without a message, after the replay ended: nothing is on its way any more


def named(alarm):
    """False: something changed, and there are candidates, none likely enough to be named."""
    return alarm.kind != "unknown" or not alarm.equivalent


def sentence(alarm, start):
    """One line for a person: what, where, how much, since when."""
    if not named(alarm):
        return "something changed, since {:.2f} s; candidates: {}".format(
            alarm.since.to_sec() - start, ", ".join(alarm.equivalent)
        )
    what = words(alarm.effect) if alarm.effect else words(alarm.kind)
    parts = [what + (" at " + alarm.port if alarm.port else "")]
    if alarm.has_size:
        unit = "" if alarm.size_unit == "1" else " " + alarm.size_unit
        decimals = decimals_for(alarm.size) if 1e-4 <= abs(alarm.size) < 1e6 else None
        parts.append(
            "{} {}{} (90 %: {} to {})".format(
                words(alarm.size_name),
                show(alarm.size, decimals=decimals),
                unit,
                show(alarm.size_low, decimals=decimals),
                show(alarm.size_high, decimals=decimals),
            ).strip()
        )
    parts.append("since {:.2f} s".format(alarm.since.to_sec() - start))
    if alarm.kind in ("fault", "sensor"):
        parts.append(
            "confidence " + ("> 99 %" if alarm.confidence > 0.99 else "{:.0f} %".format(100 * alarm.confidence))
        )
    return ", ".join(parts)


class Watch:
    def __init__(self, tty, start):
        self.tty = tty
        self.lock = threading.Lock()
        self.start = start  # s, of the samples' clock
        self.last = None  # the newest AlarmArray
        self.heard = 0.0  # when it came, monotonic
        self.known = []  # of each alarm: (kind, effect, port), active

    def say(self, text):
        if self.tty:
            sys.stdout.write("\r\033[K")
        print(text, flush=True)

    def alarms(self, message):
        with self.lock:
            now = message.header.stamp.to_sec()
            if self.start is None and now > 0:
                self.start = now
            if self.last is not None and now < self.last.header.stamp.to_sec():  # a replay began anew
                self.known.clear()
            self.last, self.heard = message, time.monotonic()
            start = self.start or 0.0
            for number, alarm in enumerate(message.alarms):
                what, active = self.known[number] if number < len(self.known) else (None, True)
                if what != (alarm.kind, alarm.effect, alarm.port):
                    told = alarm.raised.to_sec() if what is None else now
                    word = alarm.kind.upper() if named(alarm) else "CHANGED"
                    self.say("{:8.2f} s  {:7}  {}".format(told - start, word, sentence(alarm, start)))
                if active and not alarm.active:
                    self.say(
                        "{:8.2f} s  ended    {}".format(alarm.until.to_sec() - start, words(alarm.effect or alarm.kind))
                    )
            self.known = [((alarm.kind, alarm.effect, alarm.port), alarm.active) for alarm in message.alarms]
            if self.tty and now > 0:
                active = sum(alarm.active for alarm in message.alarms)
                sys.stdout.write(
                    "\r\033[K{:8.2f} s  {} active alarm{}".format(
                        now - start, active or "no", "" if active == 1 else "s"
                    )
                )
                sys.stdout.flush()

    def verdict(self):
        with self.lock:
            if self.tty:
                sys.stdout.write("\r\033[K")
            if self.last is None:
                return 1
            print("verdict: " + self.last.verdict)
            for alarm in self.last.alarms:
                if alarm.active:
                    print("         " + sentence(alarm, self.start or 0.0))
            sys.stdout.flush()
            return 0


def first_sample(path, rig):
    """s: stamp of the first sample in a bag; None where it has none."""
    import rosbag

    with rosbag.Bag(path) as bag:
        for _, message, _ in bag.read_messages(topics=["/{}/sample".format(rig)]):
            return message.header.stamp.to_sec()
    return None


def main():
    parser = argparse.ArgumentParser(prog="watch_alarms.py", description="Prints the alarms of a rig as they appear.")
    parser.add_argument("--rig", required=True, help="rig to watch; `faultline rigs` lists them")
    parser.add_argument("--bag", help="the session that is replayed: times count from its first sample")
    parser.add_argument("--until-replay-ends", action="store_true", help="stop when what publishes /clock is gone")
    parser.add_argument(
        "--timeout", type=float, default=0, metavar="S", help="give up after so many seconds without an alarm message"
    )
    parser.add_argument("--ready", metavar="FILE", help="create FILE once subscribed")
    chosen = parser.parse_args()

    try:
        import rosbag
        import rosgraph
        import rospy
        from faultline.msg import AlarmArray
    except ImportError as missing:
        print(
            "watch_alarms: {}; build with ./faultline build, then use ./faultline shell".format(missing),
            file=sys.stderr,
        )
        return 2
    start = None
    if chosen.bag:
        try:
            start = first_sample(chosen.bag, chosen.rig)
        except (OSError, rosbag.ROSBagException) as error:
            print(
                "watch_alarms: {}: cannot be read as a bag: {}".format(chosen.bag, str(error).replace("\n", " ")),
                file=sys.stderr,
            )
            return 2
    master = rosgraph.Master("/watch_alarms")
    try:
        master.getPid()
    except (OSError, xmlrpc.client.Error, rosgraph.MasterException):
        print(
            "watch_alarms: no ROS master at {}; start the graph first: ./faultline shell roslaunch faultline ..."
            .format(os.environ.get("ROS_MASTER_URI", "ROS_MASTER_URI, which is not set")),
            file=sys.stderr,
        )
        return 2

    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    rospy.init_node("watch_alarms", anonymous=True, disable_signals=True)
    watch = Watch(sys.stdout.isatty(), start)
    rospy.Subscriber("/{}/alarms".format(chosen.rig), AlarmArray, watch.alarms)
    if chosen.ready:
        open(chosen.ready, "w").close()

    began, played = time.monotonic(), False
    while not stop.wait(0.1):
        silent = time.monotonic() - max(watch.heard, began)
        if chosen.timeout and silent > chosen.timeout:
            break
        if not chosen.until_replay_ends:
            continue
        try:
            publishers = dict(master.getSystemState()[0])
        except (OSError, xmlrpc.client.Error, rosgraph.MasterException, socket.error):
            break  # the master went with the replay
        if publishers.get("/clock"):
            played = True
        elif played and silent > QUIET:
            break
    result = watch.verdict()
    if result:
        print(
            "watch_alarms: no alarm message came on /{}/alarms; is the graph running?".format(chosen.rig),
            file=sys.stderr,
        )
    rospy.signal_shutdown("done")
    return result


if __name__ == "__main__":
    sys.exit(main())
