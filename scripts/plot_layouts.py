#!/usr/bin/python3
"""Writes layouts for rqt and PlotJuggler with the numbers of a rig that is running beside view_node.

  rosrun faultline plot_layouts.py --rig RIG [--folder .]

makes RIG.perspective (rqt --perspective-file) and RIG.plotjuggler.xml (plotjuggler --layout): channels by unit, and of
every estimator stage its residuals over sigma and its states. They name the topics that exist now; a stage's exist once
it has spoken. Exit: 0; 1 if no rig is heard; 2 for bad usage.
"""
import argparse
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import roslib.packages
import rosgraph

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
MOST = 8  # plots on a tab


def plots_of(space, topics, units):
    """[(tab, [(title, [topic])])] of topics below /SPACE/plot."""
    channels, stages = {}, {}
    for topic in sorted(topics):
        parts = topic[len("/" + space + "/plot/") :].split("/")
        if parts[0] == "channel":
            channels.setdefault(units.get(parts[1], "1"), []).append(topic)
        elif parts[1] == "residual":
            stages.setdefault(parts[0], {}).setdefault("residual over sigma", []).append(topic)
        elif parts[1] == "state":
            stages.setdefault(parts[0], {})[parts[2]] = [topic]
    tabs = [("channels", sorted(channels.items()))] if channels else []
    for stage, plots in sorted(stages.items()):
        order = sorted(plots.items(), key=lambda plot: plot[0] != "residual over sigma")
        tabs.append((stage, order[:MOST]))
    return tabs


def plotjuggler(tabs):
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(root, "tabbed_widget", name="Main Window", parent="main_window")
    for name, plots in tabs:
        tab = ElementTree.SubElement(window, "Tab", containers="1", tab_name=name)
        sizes = ";".join("{:.6f}".format(1 / len(plots)) for _ in plots)
        container = ElementTree.SubElement(tab, "Container")
        splitter = ElementTree.SubElement(
            container, "DockSplitter", orientation="-", count=str(len(plots)), sizes=sizes
        )
        for title, topics in plots:
            area = ElementTree.SubElement(splitter, "DockArea", name=title)
            plot = ElementTree.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            ElementTree.SubElement(plot, "limitY")
            for i, topic in enumerate(topics):
                ElementTree.SubElement(plot, "curve", name=topic + "/value", color=COLOURS[i % len(COLOURS)])
    ElementTree.SubElement(window, "currentTabIndex", index="0")
    plugin = ElementTree.SubElement(ElementTree.SubElement(root, "Plugins"), "plugin", ID="ROS Topic Subscriber")
    ElementTree.SubElement(plugin, "use_header_stamp", value="true")
    ElementTree.SubElement(plugin, "discard_large_arrays", value="true")
    ElementTree.SubElement(plugin, "max_array_size", value="100")
    ElementTree.SubElement(
        plugin, "selected_topics", value=";".join(topic for _, plots in tabs for _, drawn in plots for topic in drawn)
    )
    ElementTree.SubElement(root, "previouslyLoaded_Datafiles")
    ElementTree.SubElement(root, "previouslyLoaded_Streamer", name="ROS Topic Subscriber")
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def perspective(tabs):
    """One rqt_plot for every plot of the channels and for every stage's residuals."""

    def entry(value):
        return {"repr": repr(value), "type": "repr"}

    drawn = [topics for name, plots in tabs for title, topics in plots if name == "channels" or "residual" in title]
    groups = {
        "plugin__rqt_plot__Plot__{}".format(i): {
            "keys": {},
            "groups": {
                "plugin": {
                    "keys": {"autoscroll": entry(True), "topics": entry([topic + "/value" for topic in topics])},
                    "groups": {},
                }
            },
        }
        for i, topics in enumerate(drawn, 1)
    }
    running = {"rqt_plot/Plot": list(range(1, len(drawn) + 1))}
    manager = {"keys": {"running-plugins": entry(running)}, "groups": groups}
    whole = {"keys": {}, "groups": {"mainwindow": {"keys": {}, "groups": {}}, "pluginmanager": manager}}
    return json.dumps(whole, indent=2) + "\n"


def units_of(rig):
    """{channel: unit}, from the rig's datasheet."""
    program = [path for path in roslib.packages.find_node("faultline", "faultline") if "/lib/" in path][0]
    told = subprocess.run([program, "rigs", rig, "--json", "-"], stdout=subprocess.PIPE, check=True).stdout
    return {channel["name"]: channel["unit"] for channel in json.loads(told)["rigs"][0]["channels"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rig", required=True, help="its namespace: the rig's name, or what it was launched as")
    parser.add_argument("--folder", default=".", help="where to write")
    arguments = parser.parse_args()
    space = arguments.rig.strip("/")
    master = rosgraph.Master("/plot_layouts")
    try:
        topics = [topic for topic, _ in master.getPublishedTopics("/" + space + "/plot")]
        if not topics:
            print("plot_layouts: nothing below /{}/plot; start view.launch first".format(space), file=sys.stderr)
            return 1
        units = units_of(master.getParam("/" + space + "/view/rig"))
    except (OSError, rosgraph.MasterException) as error:
        print("plot_layouts: {}".format(error), file=sys.stderr)
        return 1
    except subprocess.CalledProcessError:
        return 1
    tabs = plots_of(space, topics, units)
    for ending, text in ((".perspective", perspective(tabs)), (".plotjuggler.xml", plotjuggler(tabs))):
        name = os.path.join(arguments.folder, space.replace("/", "_") + ending)
        with open(name, "w") as file:
            file.write(text)
        print(name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
