#!/usr/bin/env python3
"""Samples lost between a DAQ and the alarms: simulator -> LCM over UDP multicast -> driver -> kalman_node ->
isolator_node -> alarm_node at 1 kHz.

    ten_minutes.py [--seconds 600] [--build FOLDER] [--json FILE]

Runs in a network namespace of its own (loopback with a multicast route), in real time, and leaves nothing running.
Counted by the nodes themselves from the sequence numbers and read from /diagnostics at the end; UDP drops by the
kernel, for this namespace. The delay is that of the isolator's word on a sample (/RIG/hypotheses) behind the stamp that
the simulator gave it, at a listener in Python, which adds its own. Exit code 0 if nothing was lost, 1 if something was.
"""

import argparse
import json
import os
import pathlib
import resource
import signal
import struct
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "nodes"))
RIG = "servo_actuator"
URL = "udpm://239.255.76.67:7667?ttl=0"
COUNTS = ("received", "lost", "duplicate", "out of order", "late", "restarts")


def udp_counts():
    names, values = [
        line.split()[1:] for line in pathlib.Path("/proc/net/snmp").read_text().splitlines() if line.startswith("Udp:")
    ]
    return {name: int(value) for name, value in zip(names, values)}


def cpu_seconds(process):
    words = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def hear_delays(file):
    """Writes the quantiles [s] of the hypotheses' delays at the end; the messages stay packed but for their stamps."""
    import rospy

    delays = []

    def take(message):
        stamp = struct.unpack_from("<II", message._buff, 4)
        delays.append(time.time() - stamp[0] - 1e-9 * stamp[1])

    rospy.init_node("delays", disable_signals=True)
    signal.signal(signal.SIGINT, lambda *_: rospy.signal_shutdown("over"))
    rospy.Subscriber(f"/{RIG}/hypotheses", rospy.AnyMsg, take, queue_size=100000, tcp_nodelay=True)
    while not rospy.is_shutdown():
        time.sleep(0.1)
    delays.sort()
    at = {"median": 0.5, "99 %": 0.99, "99.9 %": 0.999, "most": 1}
    told = {name: delays[int(share * (len(delays) - 1))] for name, share in at.items()} if delays else {}
    pathlib.Path(file).write_text(json.dumps({"messages": len(delays), **told}))


def measure(seconds):
    from graph import Graph

    for command in (["ip", "link", "set", "lo", "up"], ["ip", "route", "add", "224.0.0.0/4", "dev", "lo"]):
        subprocess.run(command, check=True)
    with Graph() as graph:
        heard = graph.path / "heard"
        listen = [
            "python3",
            str(HERE.parents[1] / "nodes/listen.py"),
            RIG,
            str(seconds + 60),
            str(heard),
            "diagnostics",
        ]
        listener = graph.start(listen)
        nodes = {
            "alarms": graph.node("alarm_node", "alarms", rig=RIG),
            "isolator": graph.node("isolator_node", "isolator", rig=RIG, wait_for="alarms"),
            "kalman": graph.node("kalman_node", "kalman", rig=RIG, wait_for="isolator"),
            "driver": graph.node("rig_driver_node", "driver", rig=RIG, lcm_url=URL, wait_for="kalman"),
        }
        delays = graph.path / "delays"
        ear = graph.start(["/usr/bin/python3", str(HERE), "--hear", str(delays)])
        time.sleep(3)  # LCM keeps nothing for a listener that comes late
        nodes["simulator"] = graph.node(
            "rig_simulator_node", "simulator", rig=RIG, output="lcm", lcm_url=URL, nuisance=True
        )
        begin, loads, cpu = time.monotonic(), [], {}
        while time.monotonic() < begin + seconds:
            time.sleep(min(10, max(0.0, begin + seconds - time.monotonic())))
            loads.append(os.getloadavg()[0])
            for name, process in nodes.items():
                if process.poll() is not None:
                    raise SystemExit(f"{name} ended early: {graph.said(process)}")
                cpu[name] = cpu_seconds(process)
        graph.end(nodes["simulator"])
        time.sleep(2.5)  # the last report on /diagnostics
        for name in ("driver", "kalman", "isolator", "alarms"):
            graph.end(nodes[name])
        graph.end(listener)
        graph.end(ear)
        last = {}
        for line in heard.read_text().splitlines():
            for status in json.loads(line)["status"]:
                last[status["name"]] = status
        answer = {
            "seconds": seconds,
            "load": {"least": min(loads), "mean": sum(loads) / len(loads), "most": max(loads)},
            "cpu_share": {name: used / seconds for name, used in cpu.items()},
            "receive_buffer": (
                int(pathlib.Path("/proc/sys/net/core/rmem_default").read_text())
                if pathlib.Path("/proc/sys/net/core/rmem_default").exists()
                else None
            ),
            "udp": udp_counts(),
            "delay": json.loads(delays.read_text()),
            "nodes": {},
        }
        for name in ("driver", "kalman", "isolator", "alarms"):
            values = [
                status["values"]
                for title, status in last.items()
                if title.startswith(f"{RIG}/{name}:") and "received" in status["values"]
            ]
            answer["nodes"][name] = {key: int(values[0][key]) for key in COUNTS} if values else None
        print(json.dumps(answer))


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--seconds", type=int, default=600)
    words.add_argument("--build", help="build folder; default: catkin_ws/build of this clone")
    words.add_argument("--json", help="writes the answer to this file too")
    words.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    words.add_argument("--hear", help=argparse.SUPPRESS)
    given = words.parse_args()
    if given.seconds < 5:
        words.error("--seconds: at least 5")
    if given.hear:
        hear_delays(given.hear)
        return 0
    if given.inside:
        measure(given.seconds)
        return 0
    environment = dict(os.environ, PYTHONPATH=str(HERE.parents[1] / "nodes"))
    if given.build:
        environment["FAULTLINE_BUILD"] = str(pathlib.Path(given.build).resolve())
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    unshare = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
    ran = subprocess.run(
        [*unshare, sys.executable, str(HERE), "--inside", "--seconds", str(given.seconds)],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    if ran.returncode:
        return ran.returncode
    answer = json.loads(ran.stdout.splitlines()[-1])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer["cpu_seconds"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if given.json:
        pathlib.Path(given.json).write_text(json.dumps(answer, indent=1) + "\n")
    print(
        f"{answer['seconds']} s at 1 kHz; load average {answer['load']['least']:.1f} to {answer['load']['most']:.1f}, "
        f"mean {answer['load']['mean']:.1f}, on {os.cpu_count()} cores"
    )
    for name, counts in answer["nodes"].items():
        told = ", ".join(f"{key} {value}" for key, value in counts.items()) if counts else "nothing told"
        print(f"  {name:8s} {told}; {100 * answer['cpu_share'][name]:.1f} % of a core")
    print(
        f"  UDP: {answer['udp']['InDatagrams']} datagrams in, receive buffer overrun"
        f" {answer['udp']['RcvbufErrors']} times"
    )
    told = ", ".join(f"{name} {1e3 * t:.1f} ms" for name, t in answer["delay"].items() if name != "messages")
    print(f"  delay of {answer['delay']['messages']} words of the isolator: {told}")
    whole = all(counts and counts["lost"] == 0 and counts["received"] > 0 for counts in answer["nodes"].values())
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())
