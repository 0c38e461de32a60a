"""Starts a ROS master and nodes of the build for a test, on 127.0.0.1 and a port of their own, and ends them."""

import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import tempfile
import time
import uuid
import xmlrpc.client

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("FAULTLINE_BUILD", ROOT / "catkin_ws/build"))


def devel_space():
    cache = (BUILD / "CMakeCache.txt").read_text()
    return pathlib.Path(re.search(r"^CATKIN_DEVEL_PREFIX:\w+=(.*)$", cache, re.M).group(1))


def built_environment():
    script = f'set +u; source "{devel_space()}/setup.bash"; env -0'
    said = subprocess.run(["bash", "-c", script], stdout=subprocess.PIPE, check=True).stdout.decode()
    values = dict(line.split("=", 1) for line in said.split("\0") if "=" in line)
    values["PATH"] = "/usr/bin:/bin:/usr/sbin:/sbin:" + values.get("PATH", "")
    return values


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Graph:
    """A master and what was started beside it; `with Graph() as graph:` ends it all."""

    def __init__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="faultline_graph_")
        self.path = pathlib.Path(self.folder.name)
        self.environment = built_environment()
        self.environment.update(
            {
                "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
                "ROS_IP": "127.0.0.1",
                "ROS_HOME": str(self.path),
                "ROS_LOG_DIR": str(self.path / "log"),
            }
        )
        self.environment.pop("ROS_HOSTNAME", None)
        self.processes = []

    def __enter__(self):
        port = self.environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
        self.start(["rosmaster", "--core", "-p", port])
        master = xmlrpc.client.ServerProxy(self.environment["ROS_MASTER_URI"])
        limit = time.monotonic() + 60
        while True:
            try:
                master.getPid("/test")
                break
            except OSError:
                if time.monotonic() > limit:
                    raise
                time.sleep(0.05)
        self.master = master
        self.set("/run_id", str(uuid.uuid1()))  # else several roslaunch quarrel about it
        return self

    def __exit__(self, *problem):
        for process in reversed(self.processes):
            self.end(process)
        self.folder.cleanup()

    def set(self, key, value):
        self.master.setParam("/test", key, value)

    def start(self, command, name=None):
        output = open(self.path / f"{len(self.processes)}.out", "w+")
        process = subprocess.Popen(
            command, env=self.environment, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
        )
        process.output = output
        self.processes.append(process)
        return process

    def node(self, program, name, **parameters):
        """Starts a node of the package in its rig's namespace, as the launch files do; its parameters go through the
        parameter server, so that their types hold."""
        rig = parameters.get("rig")
        space = f"/{rig}" if isinstance(rig, str) else ""
        try:
            self.master.deleteParam("/test", f"{space}/{name}")
        except xmlrpc.client.Fault:
            pass
        for key, value in parameters.items():
            self.set(f"{space}/{name}/{key}", value)
        words = [f"__name:={name}"] + ([f"__ns:={space}"] if space else [])
        return self.start([str(devel_space() / "lib/faultline" / program), *words])

    def wait(self, process, seconds):
        return process.wait(seconds), self.said(process)

    @staticmethod
    def said(process):
        return pathlib.Path(process.output.name).read_text(errors="replace")

    @staticmethod
    def end(process):
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        process.output.close()


SYNC = 0xEDA1DA01


def read_lcm_log(path):
    """Events of an LCM log as (time in us, channel, data)."""
    raw = pathlib.Path(path).read_bytes()
    events, at = [], 0
    while at + 28 <= len(raw):
        sync, _, stamp, channel_length, data_length = struct.unpack_from(">IqqII", raw, at)
        assert sync == SYNC, f"no event at byte {at}"
        at += 28
        channel = raw[at : at + channel_length].decode()
        events.append((stamp, channel, raw[at + channel_length : at + channel_length + data_length]))
        at += channel_length + data_length
    return events


def write_lcm_log(path, events):
    with open(path, "wb") as file:
        for number, (stamp, channel, data) in enumerate(events):
            name = channel.encode()
            file.write(struct.pack(">IqqII", SYNC, number, stamp, len(name), len(data)) + name + data)
