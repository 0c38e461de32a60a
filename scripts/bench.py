#!/usr/bin/env python3
"""./faultline bench: the times of docs/benchmarks.md as one table. Runs faultline_bench (the core on one core of the
processor), then measures the latency over ROS with test/bench/latency.py on samples of `faultline simulate`. With
arguments of Google Benchmark (--benchmark_...) only faultline_bench runs, and prints what it prints."""
import argparse
import json
import os
import subprocess
import sys
import tempfile

ROWS = [  # benchmark, what it is, aim
    ('filter_step_second_order', 'filter step, second order, six states', '<= 3 us'),
    ('filter_step_first_order', 'filter step, first order, six states', ''),
    ('filter_step_unscented', 'filter step, unscented, six states', ''),
    ('filter_step_extended', 'filter step, extended, six states', ''),
    ('peer_kalman_step', 'peer: plain Kalman step, six states', ''),
    ('estimator_stage', 'estimator stage per sample', ''),
    ('alarm_stage', 'alarm stage per sample', ''),
    ('detector/leak', '  detector leak', ''),
    ('detector/band', '  detector band', ''),
    ('detector/consistency', '  detector consistency', ''),
    ('offline_diagnosis', 'offline diagnosis per sample', '<= 2 us, 500 x'),
    ('simulator/no_effects', 'simulator, no effects, per sample', ''),
    ('simulator/five_effects', 'simulator, five effects, per sample', '300 x'),
    ('least_squares_step/scalar', 'least squares step, one parameter', '<= 0.2 us'),
    ('least_squares_step/three', 'least squares step, three parameters', ''),
    ('one_detector/cusum', 'CUSUM step', '<= 0.010 us'),
    ('one_detector/redline', 'redline step', '<= 0.010 us'),
    ('balances', 'cooling circuit: 26 least squares', ''),
    ('branch_filters/extended', 'cooling circuit: extended Kalman, 5 branches', ''),
    ('branch_filters/unscented', 'cooling circuit: unscented, 5 branches', ''),
    ('whole_circuit/healthy', 'cooling circuit: whole diagnosis per sample', '<= 50 us: 5 % of a core'),
    ('whole_circuit/leaking', '  the same while it leaks', ''),
]


def core_table(program):
    text = subprocess.run([program, '--benchmark_format=json', '--benchmark_repetitions=3',
                           '--benchmark_report_aggregates_only=true'],
                          check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
    found = {run['run_name']: run for run in json.loads(text)['benchmarks'] if run.get('aggregate_name') == 'median'}
    print(f'{"":46s} {"time":>10s} {"x real time":>12s} {"allocations":>12s}   aim')
    for name, title, aim in ROWS:
        run = found[name]
        print(f'{title:46s} {run["cpu_time"] / 1e3:7.3f} us {run_rate(run):12.0f} '
              f'{round(run["allocations"], 2):12g}   {aim}')
    ratio = found['filter_step_second_order']['cpu_time'] / found['peer_kalman_step']['cpu_time']
    print(f'{"filter step, second order, over its peer":46s} {ratio:10.2f}')


def run_rate(run):
    return 1e6 / run['cpu_time']  # a sample stands for 1 ms = 1e6 ns


def latency(root, programs, duration):
    with tempfile.TemporaryDirectory() as folder:
        samples = os.path.join(folder, 'samples.csv')
        subprocess.run([os.path.join(programs, 'faultline'), 'simulate', 'servo_actuator', '--profile', 'random',
                        '--duration', '10', '-o', samples], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        print(f'\nover ROS at 1 kHz for {duration:g} s (aim: p99 <= 3 ms)', flush=True)
        return subprocess.run([sys.executable, os.path.join(root, 'test/bench/latency.py'), '--programs', programs,
                               '--csv', samples, '--sheet', os.path.join(root, 'config/servo_actuator'),
                               '--duration', str(duration)]).returncode


def main():
    parser = argparse.ArgumentParser(prog='./faultline bench', description=__doc__)
    parser.add_argument('--duration', type=float, default=30, help='s of the latency measure; 0: without it')
    parser.add_argument('--programs', help='folder of the programs (default: the workspace of this repository)')
    arguments, rest = parser.parse_known_args()
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    programs = arguments.programs or os.path.join(root, 'catkin_ws/devel/lib/faultline')
    program = os.path.join(programs, 'faultline_bench')
    if not os.path.exists(program):
        parser.exit(2, f'./faultline bench: {program} is not there; build it with ./faultline bench\n')
    if rest:
        if not all(word.startswith('--benchmark_') for word in rest):
            parser.error(f'unknown argument {rest[0]}; there are --duration, --programs and --benchmark_...')
        os.execv(program, [program] + rest)
    core_table(program)
    return latency(root, programs, arguments.duration) if arguments.duration > 0 else 0


if __name__ == '__main__':
    sys.exit(main())
