#!/usr/bin/python3
"""The networks of Kilic et al. (2014) as virtual pressure sensors: Table 3, Table 5, the networks' column of Table 6,
Figs 15, 18 and 21 to 26, training times, and the coupled estimate over ten minutes.

    scripts/studies/pump_cylinder/networks.py --work FOLDER [--output docs/pictures]
        [--only noe,narx,structured,long,shipped] [--architectures 1,2,3,4,5,6,7,8,9] [--epochs 1000]

What is there in FOLDER is not made again, and a training that was stopped goes on. `--ship FILE` writes the decoupled
network as the rig's datasheet names it. shipped: that network on runs that chose nothing: the rig of the paper, seeds
21 and 22, and rigs off their datasheet in motions that it was not trained on.

Black box: the nine NARX architectures on the run that stands for Fig 6, pressures smoothed without phase (see
one_step.py); NOE from the weights of architecture 7, its outputs begun anew from what is measured every 10 ms, then
every 100 ms, then never. Structured: pre-training on the nominal plant (speeds of Fig 17, and positions under varied
pressure sums), decoupled; then 10 epochs on the rig's chirp alone, as in the paper, or 15 on it and a further run of
the rig (profile validation, seed 4), decoupled and coupled. The validation runs train nothing and choose nothing.
"""

import argparse
import json
import pathlib
import resource
import shutil

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import scipy.signal

from paper_runs import BLUE, GREY, ORANGE, PRESSURES, RIG, RUNS, errors, paper_run, published
from rig_runs import datasheet, diagnose, faultline, read_table, write_datasheet

STAGE = "virtual_pressures"
SETTLE = 1000  # samples that are left out
INPUTS = {"inputs": "pump1_speed, pump2_speed, position.smooth, position.rate", "cut_off": 15}
OUTPUTS = {"outputs": ", ".join(PRESSURES.values())}
BOTH = ", ".join(PRESSURES.values())
STRUCTURED = {
    "hidden": 20,
    "chamber_a_pressure_sum": f"pump1_speed, pump2_speed, {BOTH}",
    "chamber_a_pressure_beside": "position.rate, position.smooth",
    "chamber_a_pressure_gain": 0.3,
    "chamber_b_pressure_sum": f"pump2_speed, {BOTH}",
    "chamber_b_pressure_beside": "position.rate, position.smooth",
    "chamber_b_pressure_gain": 0.3,
}
NARX = [(lags, hidden) for lags in (1, 2, 3) for hidden in (10, 20, 30)]
# A coupled network begins from its mean again and again, lest it learns the time since the start, with which the oil
# warms.
COUPLED = {"plant": ["--horizon", 2, "--cold", 0.7], "rig": ["--horizon", 10, "--cold", 0.7]}
SHIPPED = {
    "validation 21": ["--fault", "paper_rig", "--profile", "validation", "--seed", 21],
    "validation 22": ["--fault", "paper_rig", "--profile", "validation", "--seed", 22],
    "steps 12": ["--off-nominal", "--profile", "steps", "--seed", 12, "--duration", 20],
    "cycle 13": ["--off-nominal", "--profile", "cycle", "--seed", 13, "--duration", 20],
    "multisine 14": ["--off-nominal", "--profile", "multisine", "--seed", 14, "--duration", 20],
}
NOE_HORIZONS = [(0.01, 4), (0.1, 3), (0, 3)]  # s, epochs
NOE_FROM = 7


class Work:
    """A folder with recordings, weights and answers; makes what is not there."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.tables = {}

    def run(self, name):
        """The recording of a paper's run, by its name."""
        bag = self.folder / f"{name}.bag"
        if not bag.exists():
            paper_run(self.folder, name)
        return bag

    def table(self, name):
        if name not in self.tables:
            self.run(name)
            self.tables[name] = read_table(self.folder / f"{name}.csv")
        return self.tables[name]

    def simulated(self, name, *arguments):
        file = self.folder / name
        if not file.exists():
            faultline("simulate", RIG, "--quiet", *arguments, "-o", file)
        return file

    def smoothed(self):
        """The chirp with pressures smoothed forwards and backwards, 50 Hz."""
        file = self.folder / "training_smooth.csv"
        if not file.exists():
            self.run("training")
            source = self.folder / "training.csv"
            with open(source) as text:
                head = text.readline().strip()
            table = np.loadtxt(source, delimiter=",", skiprows=1)
            names = [name.split("[")[0] for name in head.split(",")]
            sections = scipy.signal.butter(2, 50, fs=1000, output="sos")
            for channel in PRESSURES.values():
                column = names.index(channel)
                table[:, column] = scipy.signal.sosfiltfilt(sections, table[:, column])
            np.savetxt(file, table, delimiter=",", header=head, comments="", fmt="%.10g")
        return file

    def config(self, name, settings, weights="none"):
        stage = {"name": STAGE, "type": "network", "weights": str(weights), **INPUTS, **OUTPUTS, **settings}
        sheet = {**datasheet(RIG), "estimators": [stage], "detectors": [], "isolators": []}
        return write_datasheet(sheet, self.folder / f"{name}.yaml")

    def train(self, name, settings, runs, *arguments):
        """Weights, and what the program told of the training."""
        weights, told = self.folder / f"{name}.txt", self.folder / f"{name}.json"
        if not told.exists():
            resume = ["--resume"] if weights.exists() else []
            config = self.config(name, settings, weights)
            faultline("train", RIG, *runs, "--config", config, "-o", weights, "--json", told, *resume, *arguments)
        return weights, json.loads(told.read_text())

    def estimate(self, name, settings, weights, recording):
        """The network's pressures over a recording, by the estimator stage itself."""
        stored = self.folder / f"{name}.npz"
        if not stored.exists():
            config = self.config("estimate", settings, weights)
            _, course = diagnose(recording, "--rig", RIG, "--config", config, "--series-rows", 1000000, series=True)
            np.savez(stored, **{channel: course[f"q.{channel}_network"] for channel in PRESSURES.values()})
        return dict(np.load(stored))


def off(run, estimate):
    return errors({k: v[SETTLE:] for k, v in run.items()}, {k: v[SETTLE:] for k, v in estimate.items()})


def told_time(told):
    """Of a training that was resumed only the last part tells its time; an epoch's is the same."""
    if not told["epochs"]:  # it had ended when it was resumed
        return {"samples": told["samples"], "epochs": told["best_epoch"]}
    epochs = told["epochs"][-1]["epoch"]
    seconds = float(np.mean([epoch["processor_seconds"] for epoch in told["epochs"]]))
    return {"samples": told["samples"], "epochs": epochs, "processor seconds": epochs * seconds}


def narx(work, epochs, numbers):
    """Table 3: one row per architecture."""
    rows = []
    for number in numbers:
        lags, hidden = NARX[number - 1]
        settings = {"feedback": "none", "lags": lags, "hidden": hidden}
        _, told = work.train(f"narx{number}", settings, [work.smoothed()], "--epochs", epochs)
        pressures = [output["training_rms"] / 1e6 for output in told["outputs"]]
        rows.append({"lags": lags, "hidden": hidden, "weights": told["weights"], "MPa": pressures, **told_time(told)})
    return rows


def noe(work, epochs, output):
    """NOE from the weights of a NARX network, and Fig 15."""
    lags, hidden = NARX[NOE_FROM - 1]
    settings = {"feedback": "all", "lags": lags, "hidden": hidden}
    weights, _ = work.train(f"narx{NOE_FROM}", {**settings, "feedback": "none"}, [work.smoothed()], "--epochs", epochs)
    times = []
    for horizon, more in NOE_HORIZONS:
        arguments = ["--from", weights, "--epochs", more] + (["--horizon", horizon] if horizon else [])
        weights, told = work.train(f"noe_{horizon:g}", settings, [work.smoothed()], *arguments)
        times.append(told_time(told))
    found = {"trainings": times, "processor seconds": sum(t["processor seconds"] for t in times)}
    for name in RUNS:
        estimate = work.estimate(f"noe_{name}", settings, weights, work.run(name))
        found[name] = off(work.table(name), estimate)
    estimate = work.estimate("noe_validation1", settings, weights, work.run("validation1"))
    pressures_picture(
        work.table("validation1"), estimate, "Fig 15: NOE on a validation run", output / "cylinder_figure_15.png"
    )
    return found


def pretrained(work):
    settings = {**STRUCTURED, "feedback": "own"}
    nominal = [
        work.simulated("nominal_training.csv", "--no-noise", "--profile", "training", "--duration", 10),
        work.simulated("nominal_varied.csv", "--no-noise", "--profile", "varied_steps", "--seed", 5),
    ]
    other = work.simulated("nominal_validation.csv", "--no-noise", "--profile", "validation", "--seed", 5)
    more = ["--validate", other, "--patience", 20]
    return nominal, more, work.train("pretrained", settings, nominal, *more, "--epochs", 60)


def tuned(work, feedback, alone=False):
    """Decoupled or coupled, from the pre-trained weights; alone: on the chirp only."""
    settings = {**STRUCTURED, "feedback": feedback}
    _, _, (weights, _) = pretrained(work)
    name = {"own": "decoupled", "all": "coupled"}[feedback] + ("_chirp" if alone else "")
    runs = [work.run("training")]
    if not alone:
        common = ["--fault", "paper_rig", "--nuisance", "--compression", "none"]
        runs.append(work.simulated("further.bag", "--profile", "validation", "--seed", 4, *common))
    more = ["--from", weights, "--epochs", 10 if alone else 15, *(COUPLED["rig"] if feedback == "all" else [])]
    weights, told = work.train(name, settings, runs, *more)
    return name, settings, weights, told


def structured(work, output):
    nominal, judged, (weights, told) = pretrained(work)
    found = {"pre-training": {**told_time(told), "outputs": told["outputs"]}}
    coupled = {**STRUCTURED, "feedback": "all"}
    more = ["--from", weights, "--epochs", 20, *COUPLED["plant"]]
    weights, told = work.train("pretrained_coupled", coupled, nominal, *judged, *more)
    found["pre-training, coupled"] = told_time(told)
    plant = work.simulated("nominal_chirp.csv", "--no-noise", "--profile", "chirp", "--seed", 1)
    exact, estimate = read_table(plant), work.estimate("nominal_chirp", coupled, weights, plant)
    found["Fig 18"] = off(exact, estimate)
    pressures_picture(exact, estimate, "Fig 18: simulated plant, coupled", output / "cylinder_figure_18.png", "plant")

    for feedback, alone in (("own", True), ("all", True), ("own", False), ("all", False)):
        name, settings, weights, told = tuned(work, feedback, alone)
        found[name] = {"training": told_time(told)}
        for run in RUNS:
            estimate = work.estimate(f"{name}_{run}", settings, weights, work.run(run))
            found[name][run] = off(work.table(run), estimate)
    for figure, run in ((21, "training"), (22, "validation1"), (23, "validation2")):
        estimate = dict(np.load(work.folder / f"decoupled_{run}.npz"))
        title = f"Fig {figure}: {run}, decoupled (the other pressure is measured)"
        run_picture(work.table(run), estimate, title, output / f"cylinder_figure_{figure}.png")
    estimates = {run: dict(np.load(work.folder / f"coupled_{run}.npz")) for run in RUNS}
    error_picture(work, estimates, output / "cylinder_figure_24.png")
    return found


def long(work, minutes=10):
    """Errors of the coupled network, minute by minute."""
    _, settings, weights, _ = tuned(work, "all")
    arguments = ["--fault", "paper_rig", "--nuisance", "--profile", "validation", "--seed", 6, "--compression", "none"]
    bag = work.simulated("long.bag", *arguments, "--duration", 60 * minutes)
    estimate = work.estimate("long", settings, weights, bag)
    table = bag.with_suffix(".csv")
    if not table.exists():
        faultline("export", bag, "-o", table)
    run = read_table(table)
    found = []
    for minute in range(minutes):
        part = slice(60000 * minute + (SETTLE if minute == 0 else 0), 60000 * (minute + 1))
        piece = [{c: x[c][part] for c in PRESSURES.values()} for x in (run, estimate)]
        worst = {s: float(np.max(np.abs(piece[0][c] - piece[1][c]))) / 1e6 for s, c in PRESSURES.items()}
        found.append({"minute": minute + 1, "rms": errors(*piece), "largest": worst})
    return found


def shipped(work):
    """RMS in MPa of the network that the datasheet names, and of EKF and network against what they say of it: the share
    of samples within 1.645 of the standard deviation that is told (network) or told with the noise (guarded filter)."""
    config = write_datasheet({**datasheet(RIG), "detectors": [], "isolators": []}, work.folder / "shipped.yaml")
    noise = {c["name"]: c["noise_std"] for c in datasheet(RIG)["channels"]}
    found = {}
    for name, arguments in SHIPPED.items():
        bag = work.simulated(f"shipped_{name.replace(' ', '_')}.bag", "--nuisance", "--compression", "none", *arguments)
        _, course = diagnose(bag, "--config", config, "--series-rows", 1000000, series=True)
        course = {column: values[course["t"] > 1] for column, values in course.items()}
        found[name] = {}
        for symbol, channel in PRESSURES.items():
            for kind, extra in (("network", 0), ("virtual", noise[channel])):
                off = course[channel] - course[f"q.{channel}_{kind}"]
                told = np.hypot(course[f"q.{channel}_{kind}.std"], extra)
                found[name][f"{symbol} {kind}"] = {
                    "rms": float(np.sqrt(np.mean(off**2))) / 1e6,
                    "told": float(np.sqrt(np.mean(told**2))) / 1e6,
                    "within": float(np.mean(np.abs(off) < 1.645 * told)),
                }
    return found


def pressures_picture(run, estimate, title, file, what="measured"):
    figure, axes = plt.subplots(2, 1, figsize=(8, 4.6), sharex=True)
    t = np.arange(len(run["position"])) * 1e-3
    for axis, (symbol, channel) in zip(axes, PRESSURES.items()):
        axis.plot(t[::5], run[channel][::5] / 1e6, color=GREY, linewidth=0.5, label=what)
        label = f"network, {off(run, estimate)[symbol]:.3f} MPa off"
        axis.plot(t[::5], estimate[channel][::5] / 1e6, color=BLUE, linewidth=0.6, label=label)
        axis.set(ylabel=f"{symbol}, MPa")
        axis.legend(loc="upper right", fontsize=7, ncol=2, framealpha=0.8)
    axes[0].set_title(title, fontsize=9)
    axes[-1].set(xlabel="time, s")
    figure.savefig(file, dpi=100, bbox_inches="tight")
    plt.close(figure)


def run_picture(run, estimate, title, file):
    """Speeds, position, velocity as the network has it, pressures."""
    figure, axes = plt.subplots(4, 1, figsize=(8, 8), sharex=True)
    t = np.arange(len(run["position"])) * 1e-3
    for name, colour in (("pump1_speed", ORANGE), ("pump2_speed", BLUE)):
        axes[0].plot(t[::5], run[name][::5] / (2 * np.pi), color=colour, linewidth=0.5, label=name.replace("_", " "))
    axes[0].set(ylabel="rev/s")
    axes[0].set_title(title, fontsize=9)
    axes[1].plot(t[::5], run["position"][::5] * 1e3, color=BLUE, linewidth=0.5)
    axes[1].set(ylabel="position, mm")
    low_pass = scipy.signal.butter(2, 15, fs=1000)
    smooth = scipy.signal.lfilter(*low_pass, run["position"] - run["position"][0])
    axes[2].plot(t[::5], np.diff(smooth, prepend=0)[::5] * 1e6, color=BLUE, linewidth=0.5)
    axes[2].set(ylabel="velocity, mm/s")
    for (symbol, channel), colour in zip(PRESSURES.items(), (ORANGE, BLUE)):
        axes[3].plot(t[::5], run[channel][::5] / 1e6, color=GREY, linewidth=0.4, alpha=0.6)
        label = f"{symbol}, {off(run, estimate)[symbol]:.3f} MPa off"
        axes[3].plot(t[::5], estimate[channel][::5] / 1e6, color=colour, linewidth=0.6, label=label)
    axes[3].set(ylabel="pressure, MPa", xlabel="time, s (grey: measured)")
    for axis in (axes[0], axes[3]):
        axis.legend(loc="upper right", fontsize=7, ncol=2, framealpha=0.8)
    figure.savefig(file, dpi=100, bbox_inches="tight")
    plt.close(figure)


def error_picture(work, estimates, file):
    figure, axes = plt.subplots(len(estimates), 1, figsize=(8, 6), sharex=True, sharey=True)
    for axis, (name, estimate), number in zip(axes, estimates.items(), (24, 25, 26)):
        run = work.table(name)
        t = np.arange(len(run["position"])) * 1e-3
        for (symbol, channel), colour in zip(PRESSURES.items(), (ORANGE, BLUE)):
            error = (run[channel] - estimate[channel]) / 1e6
            label = f"{symbol}, rms {off(run, estimate)[symbol]:.3f} MPa"
            axis.plot(t[SETTLE::5], error[SETTLE::5], color=colour, linewidth=0.4, alpha=0.8, label=label)
        axis.set(ylabel="error, MPa")
        axis.set_title(f"Fig {number}: {name}, coupled (no pressure is measured)", fontsize=9)
        axis.legend(loc="upper right", fontsize=7, ncol=2, framealpha=0.8)
    axes[-1].set(xlabel="time, s")
    figure.savefig(file, dpi=100, bbox_inches="tight")
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", required=True)
    parser.add_argument("--output", default="docs/pictures")
    parser.add_argument("--only", default="noe,narx,structured,long,shipped")
    parser.add_argument("--epochs", type=int, default=100, help="of each NARX network")
    parser.add_argument("--architectures", default="1,2,3,4,5,6,7,8,9", help="of Table 3")
    parser.add_argument("--ship", help="where the decoupled network is written to")
    options = parser.parse_args()
    work, output = Work(options.work), pathlib.Path(options.output)
    jobs = {
        "structured": lambda: structured(work, output),
        "noe": lambda: noe(work, options.epochs, output),
        "long": lambda: long(work),
        "narx": lambda: narx(work, options.epochs, [int(n) for n in options.architectures.split(",")]),
        "shipped": lambda: shipped(work),
    }
    printed = published()
    print(json.dumps({"paper": {k: printed[k] for k in ("table3_narx_rms", "noe", "snn", "table6")}}), flush=True)
    for job in options.only.split(","):
        print(json.dumps({job: jobs[job]()}, indent=1), flush=True)
        most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        print(json.dumps({"most memory of the program so far, MiB": most}), flush=True)
    if options.ship:
        shutil.copyfile(tuned(work, "own")[2], options.ship)


if __name__ == "__main__":
    main()
