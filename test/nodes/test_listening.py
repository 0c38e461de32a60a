"""Who can reach a node: what its sockets are bound to under ROS_IP=127.0.0.1, and the network namespace that
docs/nodes.md recommends."""

import os
import pathlib
import tempfile
import time
import unittest

from graph import Graph

RIG = "servo_actuator"
LISTENING = "0A"  # the state in /proc/net/tcp


def listeners(pid):
    """(address, port) of every TCP socket that the process listens on."""
    own = set()
    for fd in pathlib.Path(f"/proc/{pid}/fd").iterdir():
        try:
            own.add(os.readlink(fd))
        except OSError:  # closed meanwhile
            continue
    found = set()
    for line in pathlib.Path(f"/proc/{pid}/net/tcp").read_text().splitlines()[1:]:
        words = line.split()
        if words[3] == LISTENING and f"socket:[{words[9]}]" in own:
            address, port = words[1].split(":")
            found.add((".".join(str(byte) for byte in reversed(bytes.fromhex(address))), int(port, 16)))
    return found


class Listening(unittest.TestCase):
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
    unittest.main()
