#!/usr/bin/env python3
"""Samples lost between a DAQ and the alarms: simulator -> LCM over UDP multicast -> driver -> kalman_node ->
isolator_node -> alarm_node at 1 kHz.

    ten_minutes.py [--seconds 600] [--build FOLDER] [--json FILE]

Runs in a network namespace of its own (loopback with a multicast route), in real time, and leaves nothing running.
Counted by the nodes themselves from the sequence numbers and read from /diagnostics at the end; UDP drops by the
kernel, for this namespace. Exit code 0 if nothing was lost, 1 if something was.
"""

import argparse
import json
import os
import pathlib
import resource
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
    given = words.parse_args()
    if given.seconds < 5:
        words.error("--seconds: at least 5")
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
    whole = all(counts and counts["lost"] == 0 and counts["received"] > 0 for counts in answer["nodes"].values())
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())
