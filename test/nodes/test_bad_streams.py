"""What sources of samples do wrong is told on /diagnostics by its name, and no longer once it is over. In simulated
time, which the source of samples publishes."""

import json
import pathlib
import subprocess
import time
import unittest

from graph import ROOT, Graph

RIG = "servo_actuator"
HERE = pathlib.Path(__file__).resolve().parent
SHEET = ROOT / "config" / RIG / "rig.yaml"
STAGE = "leak_filter"


class Source:
    def __init__(self, graph, name, *more):
        self.process = subprocess.Popen(
            ["python3", str(HERE / "stream_source.py"), str(SHEET), name, STAGE, *more],
            env=graph.environment,
            stdin=subprocess.PIPE,
            text=True,
        )

    def say(self, word):
        self.process.stdin.write(word + "\n")
        self.process.stdin.flush()

    def end(self):
        if self.process.poll() is None:
            self.process.stdin.close()
            self.process.wait(20)


class BadStreams(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.graph = Graph().__enter__()
        cls.addClassCleanup(cls.graph.__exit__)
        cls.graph.set("/use_sim_time", True)
        cls.heard = cls.graph.path / "heard"
        cls.graph.start(["python3", str(HERE / "listen.py"), RIG, "600", str(cls.heard), "diagnostics", "alarms"])
        cls.graph.node("alarm_node", "alarms", rig=RIG)
        cls.graph.node("isolator_node", "isolator", rig=RIG)
        cls.graph.node("kalman_node", "kalman", rig=RIG)
        cls.source = Source(cls.graph, "source", "clock")
        cls.addClassCleanup(cls.source.end)
        cls.source.say("described")

    def messages(self, since, name):
        entries = [json.loads(line) for line in self.heard.read_text().splitlines()[since:] if line.endswith("}")]
        return [
            (status["level"], status["message"], status["values"])
            for entry in entries
            if entry["topic"] == "diagnostics"
            for status in entry["status"]
            if status["name"].startswith(f"{RIG}: verdict" if name == "verdict" else f"{RIG}/{name}:")
        ]

    def wait_for(self, holds, name="kalman"):
        since = len(self.heard.read_text().splitlines()) if self.heard.exists() else 0
        limit = time.monotonic() + 40
        told = []
        while time.monotonic() < limit:
            told = self.messages(since, name) if self.heard.exists() else []
            for status in told:
                if holds(status):
                    return status
            time.sleep(0.1)
        self.fail(f"told: {told[-3:]}")

    def wait_for_words(self, words, name="kalman"):
        return self.wait_for(lambda status: words in status[1] and status[0] > 0, name)

    def wait_until_well(self):
        self.wait_for(lambda status: status[0] == 0 and status[1] == "samples arrive")

    def test_each_trouble_is_named_and_told_no_longer_when_it_is_over(self):
        self.source.say("good")
        self.wait_until_well()
        for kind, words in (
            ("zero", "stamps are 0"),
            ("rate", "samples come every 0.01 s, the rig's datasheet says 0.001 s"),
            ("jitter", "stamps jitter"),
            ("uncounted", "do not count (all are 7)"),
            ("down", "numbers count down"),
            ("by_tens", "numbers count in steps of 10"),
            ("at_random", "numbers jump about"),
            ("short", "a sample has 11 values, its description names 12 channels"),
        ):
            with self.subTest(kind):
                self.source.say(kind)
                self.wait_for_words(words)
                self.source.say("good")
                self.wait_until_well()

    def test_stamps_of_zero_are_not_healthy(self):
        self.source.say("good")
        self.wait_until_well()
        self.source.say("zero")
        self.wait_for_words("Not judged yet", "verdict")
        since = len(self.heard.read_text().splitlines())
        self.source.say("good")
        self.wait_until_well()
        # Samples came all the time: their stamps went on from 0 to the present, but nobody was silent.
        self.wait_for(lambda status: "Not judged yet" not in status[1], "verdict")
        lines = [json.loads(line) for line in self.heard.read_text().splitlines()[since:] if line.endswith("}")]
        told = {alarm["text"] for entry in lines if entry["topic"] == "alarms" for alarm in entry["alarms"]}
        self.assertFalse([text for text in told if "no sample" in text], told)

    def test_the_end_of_a_source_is_told_though_its_last_samples_are_never_judged(self):
        for kind in ("short", "zero"):
            with self.subTest(kind):
                self.source.say("good")
                self.wait_until_well()
                self.wait_for(lambda status: "Not judged" not in status[1] and "no sample" not in status[1], "verdict")
                self.source.say(kind)
                self.wait_for_words("Not judged yet", "verdict")
                self.source.say("silent")
                self.wait_for_words("no sample for more than 0.1 s", "verdict")
        self.source.say("good")
        self.wait_until_well()
        self.wait_for(lambda status: "no sample" not in status[1], "verdict")

    def test_a_description_of_another_rate(self):
        self.source.say("good")
        self.source.say("described_at_half_the_rate")
        self.wait_for_words("the description says a sample every 0.002 s, the rig's datasheet 0.001 s")
        self.source.say("described")
        self.wait_until_well()

    def test_words_that_do_not_fit_warn_once_and_are_counted_for_good(self):
        self.source.say("good")
        self.wait_until_well()
        for name, well in (("isolator", "estimates arrive"), ("alarms", "judgements arrive")):
            self.wait_for(lambda status: status[:2] == (0, well), name)
        since = len(self.heard.read_text().splitlines())
        self.source.say("unfit")
        for name, words, well in (
            ("isolator", "some estimates do not fit this rig", "estimates arrive"),
            ("alarms", "some judgements do not fit this rig", "judgements arrive"),
        ):
            self.wait_for(lambda status: status[:2] == (0, well) and status[2]["not understood"] == "1", name)
            told = [message for _, message, _ in self.messages(since, name)]
            self.assertEqual(sum(words in message for message in told), 1, told)

    def test_a_second_publisher_is_left_out_and_told(self):
        self.source.say("good")
        self.wait_until_well()
        second = Source(self.graph, "second")
        self.addCleanup(second.end)
        _, _, values = self.wait_for_words("/second sends samples too and is left out")
        restarts = values["restarts"]
        second.say("described_otherwise")
        _, _, values = self.wait_for_words("the descriptions of /source and /second contradict each other")
        self.assertEqual(values["restarts"], restarts)  # none of its samples came in between
        second.end()
        self.wait_until_well()


if __name__ == "__main__":
    unittest.main()
