"""Who can reach a node: what its sockets are bound to under ROS_IP=127.0.0.1, what address:= opens, LCM's socket, and
the network namespace that docs/nodes.md recommends."""

import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client

from graph import BUILD, Graph

RIG = "servo_actuator"
LISTENING = "0A"  # the state in /proc/net/tcp
OUTSIDE = "10.9.8.7"  # in a namespace of the test's own: the machine's address on a network
LCM_PORT = 7667
HERE = pathlib.Path(__file__).resolve()


def listeners(pid, protocol="tcp"):
    """(address, port) of every TCP socket that the process listens on, or of its UDP sockets."""
    own = set()
    for fd in pathlib.Path(f"/proc/{pid}/fd").iterdir():
        try:
            own.add(os.readlink(fd))
        except OSError:  # closed meanwhile
            continue
    found = set()
    for line in pathlib.Path(f"/proc/{pid}/net/{protocol}").read_text().splitlines()[1:]:
        words = line.split()
        if (protocol == "udp" or words[3] == LISTENING) and f"socket:[{words[9]}]" in own:
            address, port = words[1].split(":")
            found.add((".".join(str(byte) for byte in reversed(bytes.fromhex(address))), int(port, 16)))
    return found


def reached(address, port):
    with socket.socket() as probe:
        probe.settimeout(5)
        return probe.connect_ex((address, port)) == 0


def inside(launches):
    """In the namespace: starts launch files and prints as JSON, for each of the named nodes, its address and sockets,
    and whether its data port answers at OUTSIDE. `launches`: [[words of roslaunch, names of nodes]...]"""
    for command in (["link", "set", "lo", "up"], ["addr", "add", f"{OUTSIDE}/32", "dev", "lo"]):
        subprocess.run(["ip", *command], check=True)
    subprocess.run(["ip", "route", "add", "224.0.0.0/4", "dev", "lo"], check=True)
    answer = {}
    with Graph() as graph, tempfile.TemporaryDirectory() as folder:
        graph.environment.pop("ROS_IP")  # as in a user's shell
        graph.environment["PWD"] = folder
        started = [graph.start(["roslaunch", "faultline", *words]) for words, _ in launches]
        for launch, (_, names) in zip(started, launches):
            for name in names:
                limit = time.monotonic() + 60
                while True:
                    code, _, uri = graph.master.lookupNode("/test", name)
                    try:
                        pid = xmlrpc.client.ServerProxy(uri).getPid("/test")[2] if code == 1 else None
                    except OSError:
                        pid = None
                    # A node has one socket for XML-RPC, one for data.
                    if pid and len(listeners(pid)) >= 2:
                        break
                    assert launch.poll() is None and time.monotonic() < limit, (name, graph.said(launch))
                    time.sleep(0.1)
                if name.endswith("driver"):
                    while not any(port == LCM_PORT for _, port in listeners(pid, "udp")):
                        assert launch.poll() is None and time.monotonic() < limit, graph.said(launch)
                        time.sleep(0.1)
                host, port = uri.rstrip("/").split("//")[1].rsplit(":", 1)
                data = [[a, p] for a, p in listeners(pid) if p != int(port)]
                answer[name] = {
                    "host": host,
                    "data": sorted({a for a, _ in data}),
                    "udp": sorted([a, p if p == LCM_PORT else 0] for a, p in listeners(pid, "udp")),
                    "reached": sorted({reached(OUTSIDE, p) for _, p in data}),
                }
    print(json.dumps(answer))


class Listening(unittest.TestCase):
    def in_a_namespace(self, *launches):
        unshare = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
        ran = subprocess.run(
            [*unshare, sys.executable, str(HERE), "inside", json.dumps(launches)],
            env=dict(os.environ, FAULTLINE_BUILD=str(BUILD)),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            timeout=150,
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        return json.loads(ran.stdout.splitlines()[-1])

    @staticmethod
    def every_launch_file(*more):
        nodes = [f"/{RIG}/{node}" for node in ("alarms", "isolator", "kalman", "simulator")]
        return (
            [["servo_actuator.launch", *more], nodes],
            [["view.launch", f"rig:={RIG}", "rviz:=false", *more], [f"/{RIG}/view"]],
            [["record.launch", f"rig:={RIG}", "bag:=run.bag", *more], [f"/{RIG}/recorder"]],
            [["diagnostics.launch", *more], ["/diagnostic_aggregator"]],
        )

    def test_the_data_of_no_node_is_reached_from_outside(self):
        nodes = self.in_a_namespace(*self.every_launch_file())
        self.assertEqual(len(nodes), 7)
        for name, node in nodes.items():
            closed = {"host": "127.0.0.1", "data": ["127.0.0.1"], "udp": [["127.0.0.1", 0]], "reached": [False]}
            self.assertEqual(node, closed, name)

    def test_an_address_opens_the_nodes_of_its_launch_file_and_no_others(self):
        launches = self.every_launch_file(f"address:={OUTSIDE}")
        launches[3][0].pop()  # of diagnostics.launch
        nodes = self.in_a_namespace(*launches)
        self.assertEqual(nodes.pop("/diagnostic_aggregator")["reached"], [False])
        self.assertEqual(len(nodes), 6)
        for name, node in nodes.items():
            self.assertEqual((node["host"], node["reached"]), (OUTSIDE, [True]), name)
        nodes = self.in_a_namespace(self.every_launch_file(f"address:={OUTSIDE}")[3])
        self.assertEqual(nodes["/diagnostic_aggregator"]["reached"], [True])

    def test_lcm_listens_on_its_port_at_every_address_and_only_where_it_is_used(self):
        others = [f"/{RIG}/{node}" for node in ("alarms", "isolator", "kalman")]
        driver = f"/{RIG}/driver"
        nodes = self.in_a_namespace([["servo_actuator.launch", "link:=lcm"], [driver, *others]])
        # One to send from, too.
        self.assertEqual(nodes[driver]["udp"], [["0.0.0.0", 0], ["0.0.0.0", LCM_PORT], ["127.0.0.1", 0]])
        for name in others:
            self.assertEqual(nodes[name]["udp"], [["127.0.0.1", 0]], name)
        for name, node in nodes.items():
            self.assertEqual((node["host"], node["reached"]), ("127.0.0.1", [False]), name)

    def test_data_on_the_loopback_and_xmlrpc_of_roscpp_everywhere(self):
        with Graph() as graph:
            node = graph.node("alarm_node", "alarms", rig=RIG)
            limit = time.monotonic() + 30
            while True:
                try:
                    uri = graph.master.lookupNode("/test", f"/{RIG}/alarms")[2]
                except OSError:
                    uri = ""
                bound = listeners(node.pid)
                if uri and len(bound) >= 2:
                    break
                self.assertLess(time.monotonic(), limit, graph.said(node))
                time.sleep(0.1)
            self.assertTrue(uri.startswith("http://127.0.0.1:"), uri)
            xmlrpc = int(uri.rstrip("/").rsplit(":", 1)[1])
            self.assertEqual({port for address, port in bound if address == "0.0.0.0"}, {xmlrpc}, bound)
            self.assertEqual({address for address, port in bound if port != xmlrpc}, {"127.0.0.1"}, bound)
            self.assertEqual({address for address, _ in listeners(graph.processes[0].pid)}, {"127.0.0.1"})

    def test_every_launch_file_binds_its_nodes(self):
        with Graph() as graph, tempfile.TemporaryDirectory() as folder:
            graph.environment.pop("ROS_IP", None)  # as in a user's shell
            # A replay that was ended left this; a live rig has no /clock.
            graph.set("/use_sim_time", True)
            started = [
                graph.start(["roslaunch", "faultline", *words])
                for words in (
                    ("servo_actuator.launch",),
                    ("view.launch", f"rig:={RIG}", "rviz:=false"),
                    ("record.launch", f"rig:={RIG}", f"bag:={folder}/run.bag"),
                    ("diagnostics.launch",),
                )
            ]
            limit = time.monotonic() + 60
            for name in (f"/{RIG}/alarms", f"/{RIG}/view", f"/{RIG}/recorder", "/diagnostic_aggregator"):
                code, uri = 0, ""
                while code != 1:
                    self.assertLess(time.monotonic(), limit, [graph.said(launch) for launch in started])
                    time.sleep(0.2)
                    code, _, uri = graph.master.lookupNode("/test", name)
                self.assertTrue(uri.startswith("http://127.0.0.1:"), (name, uri))
            self.assertIs(graph.master.getParam("/test", "/use_sim_time")[2], False)

    def test_in_a_network_namespace_there_is_nothing_but_the_loopback(self):
        inside = "ip link set lo up; exec roslaunch faultline servo_actuator.launch rate:=2 duration:=4"
        with Graph() as graph:
            graph.environment["ROS_MASTER_URI"] = "http://127.0.0.1:11311"
            launch = graph.start(["unshare", "-rn", "bash", "-c", inside])
            devices, limit = "", time.monotonic() + 60
            while "alarms-" not in graph.said(launch) and launch.poll() is None:
                self.assertLess(time.monotonic(), limit, graph.said(launch))
                devices = pathlib.Path(f"/proc/{launch.pid}/net/dev").read_text()
                time.sleep(0.2)
            code, said = graph.wait(launch, 60)
            self.assertEqual(code, 0, said)
            # Some kernels put ends of tunnels, which are down, into every namespace.
            names = {line.split(":")[0].strip() for line in devices.splitlines()[2:]}
            self.assertEqual(names - {"tunl0", "sit0", "ip6tnl0", "gre0", "gretap0", "erspan0", "ip_vti0"}, {"lo"})


if __name__ == "__main__":
    if sys.argv[1:2] == ["inside"]:
        inside(json.loads(sys.argv[2]))
    else:
        unittest.main()
