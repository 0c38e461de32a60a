#!/usr/bin/env python3
"""./faultline bench: the times of docs/benchmarks.md as tables. Runs faultline_bench (the core, and its numerics
beside what libraries do, on one core of the processor), diagnoses recordings of ten minutes from one end to the
other, then measures the latency over ROS with test/bench/latency.py on samples of `faultline simulate`. With
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
    ('alarm_stage/filter', 'alarm stage per sample, leak filter alone', ''),
    ('alarm_stage/whole', 'alarm stage per sample', ''),
    ('detector/leak', '  detector leak', ''),
    ('detector/band', '  detector band', ''),
    ('detector/consistency', '  detector consistency', ''),
    ('offline_diagnosis/filter', 'offline diagnosis per sample, leak filter alone', '<= 2 us, 500 x'),
    ('offline_diagnosis/whole', 'offline diagnosis per sample', ''),
    ('simulator/no_effects', 'simulator, no effects, per sample', ''),
    ('simulator/five_effects', 'simulator, five effects, per sample', '300 x'),
    ('drive_simulator/no_effects', 'hydraulic drive: simulator, no effects', '300 x'),
    ('drive_simulator/nuisance', '  the same with what recordings carry', '300 x'),
    ('drive_simulator/five_effects', '  the same with five effects', '300 x'),
    ('least_squares_step/scalar', 'least squares step, one parameter', '<= 0.2 us'),
    ('least_squares_step/three', 'least squares step, three parameters', ''),
    ('one_detector/cusum', 'CUSUM step', '<= 0.010 us'),
    ('one_detector/redline', 'redline step', '<= 0.010 us'),
    ('balances', 'cooling circuit: 26 least squares', ''),
    ('branch_filters/extended', 'cooling circuit: extended Kalman, 5 branches', ''),
    ('branch_filters/unscented', 'cooling circuit: unscented, 5 branches', ''),
    ('whole_circuit/healthy', 'cooling circuit: whole diagnosis per sample', '<= 50 us: 5 % of a core'),
    ('whole_circuit/leaking', '  the same while it leaks', ''),
    ('state_variable_filter', 'state variable filter, three signals', ''),
    ('observer_stage/line', 'hydraulic drive: bilinear observer of the line', ''),
    ('observer_stage/shaft', '  of the shaft', ''),
    ('parameter_stage/even', 'hydraulic drive: filter and least squares, whole stage', '<= 0.5 us'),
    ('parameter_stage/uneven', '  the same with uneven stamps', ''),
    ('peer_filter_and_least_squares', 'peer: filter and least squares with Eigen', ''),
    ('cylinder_step/linear', 'pump-controlled cylinder: linear Kalman filter', '<= 0.3 us'),
    ('cylinder_step/extended', '  extended', '<= 1 us'),
    ('cylinder_guarded_stage', '  bank that can do without a transducer', ''),
    ('network_step/structured', '  structured network', ''),
    ('network_step/black_box', '  network of one hidden layer', ''),
]

HISTOGRAMS = [  # benchmark, what one pass of it is, samples a second of that; nine variables a valve
    ('valve/limits', 'a valve, plain limit check', 10),
    ('valve/histograms_floating', 'a valve, histograms', 10),
    ('valve/histograms_integer', 'a valve, histograms in integers', 10),
    ('fleet/histograms_floating/10000', '10 000 valves, histograms', 10),
    ('fleet/histograms_integer/10000', '10 000 valves, histograms in integers', 10),
]

NUMERICS = [  # group of benchmarks, what it is, what it is done with
    ('sparse_lu/nominal', 'LU of 23 states: factors, 4 solutions', 'KLU'),
    ('sparse_lu/lines', 'LU of 29 states: factors, 4 solutions', 'KLU'),
    ('stiff/nominal', 'cooling circuit, 1 ms', 'our RODAS3'),
    ('stiff/lines', 'cooling circuit with six lines, 1 ms', 'our RODAS3'),
    ('explicit/nominal', 'servo actuator, 1 ms', 'odeint_runge_kutta4'),
    ('explicit/effects', 'servo actuator, four effects, 1 ms', 'odeint_runge_kutta4'),
    ('triangle/6x18', 'root of a covariance, 6 x 18', 'our Householder'),
    ('triangle/10x30', 'root of a covariance, 10 x 30', 'our Householder'),
    ('correction/states', 'correction by four states of six', 'our Carlson'),
    ('correction/rows', 'correction by five rows of ten states', 'our Potter'),
]

# Whole recordings through `faultline diagnose`, reading and judging included: what it is, and how it is simulated.
RECORDINGS = [
    ('servo actuator, healthy', ['servo_actuator', '--profile', 'random', '--seed', '11']),
    (
        'servo actuator, leaking from 20 s',
        ['servo_actuator', '--profile', 'random', '--seed', '15']
        + ['--effect', 'orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=20'],
    ),
    ('cooling circuit, healthy', ['cooling_circuit', '--profile', 'steady', '--seed', '43']),
    (
        'cooling circuit, leaking from 15 s',
        ['cooling_circuit', '--profile', 'steady', '--seed', '43']
        + ['--effect', 'orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=15'],
    ),
]

# What the latency is measured on.
SHEET = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), 'config/servo_actuator/rig.yaml')


def measured(program, quick):
    """Benchmarks by name, as Google Benchmark tells them: medians, or one short run each."""
    options = (
        ['--benchmark_min_time=0.001']
        if quick
        else ['--benchmark_repetitions=5', '--benchmark_min_time=0.2', '--benchmark_enable_random_interleaving=true']
    )
    done = subprocess.run(
        [program, '--benchmark_format=json', *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ['nothing said'])[-1]
        sys.exit(f'./faultline bench: {program} ended with {done.returncode}: {last}')
    runs = json.loads(done.stdout)['benchmarks']
    wrong = [f'{run["run_name"]}: {run["error_message"]}' for run in runs if run.get('error_occurred')]
    if wrong:
        sys.exit(f'./faultline bench: {"; ".join(sorted(set(wrong)))}')
    return {run['run_name']: run for run in runs if quick or run.get('aggregate_name') == 'median'}


def core_table(found):
    print(f'{"":48s} {"time":>10s} {"x real time":>12s} {"allocations":>12s}   aim')
    for name, title, aim in ROWS:
        run = found[name]
        print(
            f'{title:48s} {run["cpu_time"] / 1e3:7.3f} us {run_rate(run):12.0f} '
            f'{round(run["allocations"], 2):12g}   {aim}'
        )
    ratio = found['filter_step_second_order']['cpu_time'] / found['peer_kalman_step']['cpu_time']
    print(f'{"filter step, second order, over its peer":48s} {ratio:10.2f}')


def numerics_table(found):
    print(f'\n{"numerics beside libraries":40s} {"with":26s} {"time":>10s} {"ratio":>7s} {"error":>9s}')
    for group, title, ours in NUMERICS:
        used = found[f'{group}/ours']
        others = [name for name in found if name.startswith(f'{group}/') and name != f'{group}/ours']
        for name in [f'{group}/ours', *sorted(others)]:
            run = found[name]
            who = ours if run is used else name.rsplit('/', 1)[1]
            error = f'{run["error"]:9.1e}' if 'error' in run else ''
            print(
                f'{title if run is used else "":40s} {who:26s} {run["cpu_time"] / 1e3:7.3f} us '
                f'{run["cpu_time"] / used["cpu_time"]:7.2f} {error}'.rstrip()
            )
    if not any('sundials' in name for name in found):
        print('without SUNDIALS: install libsundials-dev (6 or later) and build anew to have it compared')


def histogram_table(found):
    head = f'{"monitored variables":40s} {"time":>10s} {"per variable":>13s} {"bytes each":>11s}'
    print(f'\n{head} {"of a core, 10 Hz":>17s}')
    for name, title, rate in HISTOGRAMS:
        run = found[name]
        variables = 9 * int(name.rsplit('/', 1)[1] if name.startswith('fleet/') else 1)
        print(
            f'{title:40s} {run["cpu_time"] / 1e3:7.3f} us {run["cpu_time"] / variables:10.1f} ns '
            f'{run["bytes"]:11.0f} {100 * rate * run["cpu_time"] / 1e9:15.5f} %'
        )


def whole_recordings(programs, seconds):
    """Processor time (user and system) of the whole program: others on the machine count little."""
    print(f'\n{f"faultline diagnose, {seconds:g} s":40s} {"processor":>10s} {"x real time":>12s} {"memory":>8s}   aim')
    program = os.path.join(programs, 'faultline')
    with tempfile.TemporaryDirectory() as folder:
        bag = os.path.join(folder, 'run.bag')
        for title, words in RECORDINGS:
            make = [program, 'simulate', *words, '--off-nominal', '--nuisance', '--compression', 'none', '--quiet']
            subprocess.run([*make, '--duration', str(seconds), '-o', bag], check=True)
            process = subprocess.Popen([program, 'diagnose', bag], stdout=subprocess.DEVNULL)
            status, used = os.wait4(process.pid, 0)[1:]
            if status:
                sys.exit(f'./faultline bench: diagnose ended with {status}: {title}')
            cpu = used.ru_utime + used.ru_stime
            print(f'{title:40s} {cpu:8.2f} s {seconds / cpu:12.0f} {used.ru_maxrss / 1024:5.0f} MB   200 x')
    print(f'load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores')


def run_rate(run):
    return 1e9 * run.get('period', 1e-3) / run['cpu_time']  # a sample stands for so many s, the time is in ns


def latency(root, programs, duration):
    with tempfile.TemporaryDirectory() as folder:
        samples = os.path.join(folder, 'samples.csv')
        subprocess.run(
            [
                os.path.join(programs, 'faultline'),
                'simulate',
                'servo_actuator',
                '--profile',
                'random',
                '--duration',
                '10',
                '-o',
                samples,
            ],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        print(f'\nover ROS at 1 kHz for {duration:g} s (aim: p99 <= 3 ms)', flush=True)
        return subprocess.run(
            [
                sys.executable,
                os.path.join(root, 'test/bench/latency.py'),
                '--programs',
                programs,
                '--csv',
                samples,
                '--sheet',
                SHEET,
                '--duration',
                str(duration),
            ]
        ).returncode


def main():
    parser = argparse.ArgumentParser(prog='./faultline bench', description=__doc__)
    parser.add_argument(
        '--duration', type=float, help='s of the latency measure, 0: without it (default: 30; with --quick 0)'
    )
    parser.add_argument('--quick', action='store_true', help='every benchmark once: shows that all run, not how fast')
    parser.add_argument('--programs', help='folder of the programs (default: the workspace of this repository)')
    arguments, rest = parser.parse_known_args()
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    programs = os.path.abspath(arguments.programs or os.path.join(root, 'catkin_ws/devel/lib/faultline'))
    program = os.path.join(programs, 'faultline_bench')
    if not os.path.exists(program):
        parser.exit(2, f'./faultline bench: {program} is not there; build it with ./faultline bench\n')
    os.chdir(root)  # where the benchmarks find config/
    if rest:
        if not all(word.startswith('--benchmark_') for word in rest):
            parser.error(f'unknown argument {rest[0]}; there are --duration, --quick, --programs and --benchmark_...')
        os.execv(program, [program] + rest)
    found = measured(program, arguments.quick)
    core_table(found)
    numerics_table(found)
    histogram_table(found)
    whole_recordings(programs, 5 if arguments.quick else 600)
    duration = arguments.duration if arguments.duration is not None else 0 if arguments.quick else 30
    return latency(root, programs, duration) if duration > 0 else 0


if __name__ == '__main__':
    sys.exit(main())
