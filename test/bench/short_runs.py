#!/usr/bin/python3
"""How fast `faultline diagnose` is over short recordings in which something happens (docs/benchmarks.md).

    ./faultline shell test/bench/short_runs.py [NAME...]

Simulates each run, diagnoses it and prints the recording's duration over the processor time of the program, with what
was told. NAME: rigs, if not all of them.
"""

import json
import pathlib
import resource
import subprocess
import sys
import tempfile

PROGRAM = pathlib.Path(__file__).resolve().parents[2] / "catkin_ws/devel/lib/faultline/faultline"
RUNS = """
servo_actuator random 60 811 orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=20
servo_actuator steps 60 812 coulomb_friction@force.piston:force=150,from=20
servo_actuator random 60 813 offset@sensor.chamber_a_pressure:value=3e5,from=20
servo_actuator multisine 60 911 orifice_leakage@flow.chamber_a_tank:coefficient=4e-9,from=20
servo_actuator random 60 912 scale@command.valve_command:factor=0.9,from=20
servo_actuator random 60 913 offset@source.supply_pressure:value=-1e6,from=20
servo_actuator steps 60 914
servo_actuator random 60 961 orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=20 \
  orifice_leakage@flow.chamber_a_tank:coefficient=5e-9,from=20
cooling_circuit paper 60 821 orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=30,to=35
cooling_circuit paper 60 822 clogging@restriction.v2_orifice:fraction=0.05,from=25,to=30
cooling_circuit valve_steps 60 921 orifice_leakage@flow.v2_drain_ambient:coefficient=3e-8,from=20
cooling_circuit valve_multisine 60 923
hydraulic_drive paper 60 831 viscous_friction@force.shaft:coefficient=1.3733e-3,from=20
hydraulic_drive paper 60 931 laminar_leakage@flow.motor_in_motor_out:coefficient=3e-13,from=20
hydraulic_drive paper 60 932 scale@transmission.displacement:factor=1.1,from=20
pump_cylinder steps 50 841 laminar_leakage@flow.pump2_a_b:coefficient=4e-13,from=15
pump_cylinder steps 50 941 offset@sensor.chamber_b_pressure:value=3e5,from=15
pump_cylinder varied_steps 50 942
control_valve multisine 120 851 orifice_leakage@flow.cylinder_ambient:coefficient=8e-7,from=30
control_valve multisine 120 951 clogging@restriction.nozzle:fraction=0.08,from=30
control_valve steps 120 952 coulomb_friction@force.valve:force=20,from=30
control_valve multisine 120 953
"""


def main():
    with tempfile.TemporaryDirectory() as folder:
        bag, answer = f"{folder}/run.bag", f"{folder}/run.json"
        for line in RUNS.split("\n"):
            rig, profile, seconds, seed, *effects = line.split() or [None] * 4
            if rig is None or (len(sys.argv) > 1 and rig not in sys.argv[1:]):
                continue
            words = f"simulate {rig} --profile {profile} --duration {seconds} --seed {seed} --off-nominal --nuisance"
            extra = [word for effect in effects for word in ("--effect", effect)]
            subprocess.run([PROGRAM, *words.split(), *extra, "--quiet", "-o", bag], check=True)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([PROGRAM, "diagnose", bag, "--json", answer], check=True, stdout=subprocess.DEVNULL)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
            told = [f"{a['effect']}@{a['port']}" for a in json.loads(pathlib.Path(answer).read_text())["alarms"]]
            print(f"{rig} {' + '.join(effects) or 'healthy'}: {float(seconds) / used:.0f} x; {', '.join(told) or '-'}")


if __name__ == "__main__":
    main()
