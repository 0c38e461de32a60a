#!/usr/bin/env python3
"""Every figure and table of docs/cooling_circuit.md: simulates the cooling circuit, diagnoses the recordings with the
detectors under study, writes pictures and prints tables in Markdown. Recordings have parameters off the datasheet,
nuisance effects and noise, with seeds that no threshold was set with.

    ./faultline shell scripts/studies/cooling_circuit/study.py [paper] [points] [delay] [isolation]
        [--out docs/pictures] [--seeds N]"""
import argparse
import concurrent.futures
import csv
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import tempfile

import matplotlib

matplotlib.use('Agg')
import matplotlib.pyplot as plt  # noqa: E402
import matplotlib.ticker  # noqa: E402
import numpy as np  # noqa: E402
import yaml  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ.get('FAULTLINE_PROGRAM', str(ROOT / 'catkin_ws/devel/lib/faultline/faultline'))
SHEET = {
    **yaml.safe_load((ROOT / 'config/cooling_circuit/rig.yaml').read_text()),
    **yaml.safe_load((ROOT / 'config/cooling_circuit/stages.yaml').read_text()),
}
LEAK = 'orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=30,to=50,swells=2'
EXCURSION = 'clogging@restriction.t_orifice:fraction=0.005,from=24.5,to=26.5,swells=1'
FIRING = (12.0, 54.5)  # s of the profile `paper` in which the bench fires steadily
COLOURS = {
    'redline': '#4d4d4d',
    'CUSUM on c': '#1f5f99',
    'CUSUM, Kalman as printed': '#d1741b',
    'CUSUM, Kalman exact': '#2f8f5b',
    'CUSUM, unscented': '#8d4fa8',
    'isolation': '#c0362c',
}


def run(*words):
    done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f'{" ".join(map(str, words))}: {done.stderr}')
    return done.stdout


def written(folder, name, **sections):
    """The datasheet with some sections replaced, as a file."""
    path = pathlib.Path(folder) / f'{name}.yaml'
    path.write_text(yaml.safe_dump({**SHEET, **sections}, sort_keys=False, allow_unicode=True, width=1000))
    return path


def simulate(folder, seed, effects=(), profile='paper', duration=60, sheet=None):
    path = pathlib.Path(folder) / f'{seed}_{abs(hash((tuple(effects), profile, str(sheet))))}.bag'
    words = f'simulate cooling_circuit --profile {profile} --duration {duration} --seed {seed}'.split()
    words += [*'--off-nominal --nuisance --compression none --quiet -o'.split(), path]
    for effect in effects:
        words += ['--effect', effect]
    run(*words, *(['--config', sheet] if sheet else []))
    return path


def diagnose(bag, sheet=None, series=None):
    words = ['diagnose', bag, '--json', '-'] + (['--config', sheet] if sheet else [])
    return json.loads(run(*words, *(['--series', series] if series else [])))


def columns(path):
    with open(path) as file:
        rows = list(csv.reader(file))
    data = np.array([[float(cell) for cell in row] for row in rows[1:]])
    return {name: data[:, i] for i, name in enumerate(rows[0])}


def estimators():
    """The shipped stages, the filter as printed, and an unscented one."""
    shipped = {stage['name']: stage for stage in SHEET['estimators']}
    exact = shipped['branch_filter']
    printed = {
        **exact,
        'name': 'printed_filter',
        'scheme': 'euler',
        'residual': 'after',
        'outlet_noise': math.sqrt(2e5),
        'pressure_walk': 0,
        'coefficient_walk': 1e-6,
    }
    return [shipped['balances'], exact, printed, {**exact, 'name': 'unscented_filter', 'type': 'unscented_kalman'}]


def watch(name, kind, **settings):
    return {
        'name': re.sub('[^a-z0-9]+', '_', name.lower()),
        'type': kind,
        'kind': 'unknown',
        'withholds_faults': 'no',
        'text': name,
        'stage': 'balances',
        'minimum_time': 0,
        'release_time': 0.5,
        **settings,
    }


ARMED = {'armed_by': 'steady_time', 'armed_above': 1.0}


def paper_detectors():
    found = []
    for b in ('v2', 't'):
        for delta, factor in ((0.005, 3), (0.01, 5)):
            found.append(
                watch(
                    f'c_{b}_{int(1000 * delta)}',
                    'cusum',
                    quantity=f'{b}_c',
                    relative_change=delta,
                    threshold_changes=factor,
                    learn=2,
                    **ARMED,
                )
            )
        # Kalman quantities come from another stage, which has no steady_time: the whole firing is judged, learnt mean
        # zero.
        found.append(
            watch(
                f'kalman_{b}',
                'cusum',
                quantity=f'{b}_pressure_residual',
                stage='printed_filter',
                change=10,
                threshold_changes=3,
                reference=0,
            )
        )
    for b in SHEET['branches']:
        for channel in ('inlet_pressure', 'outlet_pressure', 'mass_flow'):
            found.append(
                watch(
                    f'redline_{b}_{channel}',
                    'redline',
                    quantity=f'{b}_{channel}',
                    relative_margin=0.05,
                    learn=0.2,
                    armed_by='steady_time',
                    armed_above=2,
                    minimum_time=0.2,
                )
            )
        for channel in ('inlet_temperature', 'outlet_temperature'):
            found.append(
                watch(
                    f'redline_{b}_{channel}',
                    'redline',
                    quantity=f'{b}_{channel}',
                    margin=5,
                    learn=0.2,
                    armed_by='steady_time',
                    armed_above=2,
                    minimum_time=0.2,
                )
            )
    for entry in found:
        if entry['type'] == 'redline':
            entry['minimum_time'] = 0.2
    return found


def flags(answer, name):
    """When a detector was active within steady firing: [(from, to)]."""
    return [
        (alarm['raised'], alarm['until'])
        for alarm in answer['alarms']
        if alarm['text'] == name and FIRING[0] <= alarm['raised'] <= FIRING[1]
    ]


def style(axes):
    axes.set_axisbelow(True)
    axes.grid(color='#e6e9ed', linewidth=0.7)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)


def paper(folder, out, seed=501):
    sheet = written(folder, 'paper', estimators=estimators(), detectors=paper_detectors(), isolators=[])
    bag = simulate(folder, seed, [LEAK, EXCURSION])
    series = pathlib.Path(folder) / 'paper.csv'
    answer = diagnose(bag, sheet, series)
    shipped = diagnose(bag)
    s = columns(series)
    t, steady = s['t'], (s['t'] > 14) & (s['t'] < 24)
    print('\n| | paper | here |\n|---|---|---|')
    for b, told in (('v2', 0.0042), ('t', 0.0018)):
        c = s[f'q.{b}_c']
        print(
            f'| c of {b.upper()} in steady state | {told} | {np.mean(c[steady]):.5f}, every sample within '
            f'{100 * np.max(np.abs(c[steady] / np.mean(c[steady]) - 1)):.2f} % |'
        )
    c = s['q.t_c']
    low = np.min(c[(t > 30) & (t < 50)]) / np.mean(c[steady]) - 1
    print(f'| c of T while it leaks | about 1 % | {100 * low:.2f} % |')
    # The last stage of that name wins in the table of columns; names repeat over the filters, so each is diagnosed
    # alone.
    for name, words in (
        ('printed_filter', 'as printed'),
        ('branch_filter', 'exact'),
        ('unscented_filter', 'unscented'),
    ):
        stage = [e for e in estimators() if e['name'] in (name,)]
        for residual in ('before', 'after'):
            alone = written(
                folder,
                f'{name}_{residual}',
                estimators=[{**stage[0], 'residual': residual}],
                detectors=[],
                isolators=[],
            )
            diagnose(bag, alone, series)
            k = columns(series)
            line = []
            for b in ('v2', 't'):
                during = (k['t'] > 14) & (k['t'] < 54)
                part = np.max(np.abs(k[f'q.{b}_pressure_residual'][during]) / k[f'{b}_outlet_pressure'][during])
                line.append(f'{b.upper()} {100 * part:.3f} %')
            print(
                f'| Kalman filter {words}, largest residual {residual} correction | '
                f'{"< 1 %" if residual == "before" else "< 0.1 %"} | {", ".join(line)} |'
            )
            if (name, residual) == ('printed_filter', 'after'):
                printed = k
    for name, words, told in (
        ('c_t_5', 'CUSUM on c of T, 0.5 %, 3 delta', 'at the leak, and at 25 s'),
        ('c_t_10', 'CUSUM on c of T, 1 %, 5 delta', 'at the leak only'),
        ('c_v2_5', 'CUSUM on c of V2, 0.5 %, 3 delta', 'silent'),
        ('c_v2_10', 'CUSUM on c of V2, 1 %, 5 delta', '-'),
        ('kalman_t', 'CUSUM on the residual of T, 10 Pa, 3 delta', 'while the pressure moves, both ways'),
        ('kalman_v2', 'CUSUM on the residual of V2, 10 Pa, 3 delta', 'silent'),
    ):
        found = flags(answer, name)
        text = '; '.join(f'{a:.2f} to {b:.2f} s' for a, b in found[:4]) or 'silent'
        print(f'| {words} | {told} | {text}{f"; {len(found)} flags in all" if len(found) > 4 else ""} |')
    redlines = [alarm for alarm in answer['alarms'] if alarm['text'].startswith('redline')]
    print(f'| redlines, 25 channels, 5 % and 5 K | silent | {len(redlines)} flags |')
    for alarm in (a for a in shipped['alarms'] if a['kind'] != 'model'):
        print(
            f'| isolation | c cannot say which variable | {alarm["raised"]:.2f} to {alarm["until"]:.2f} s: '
            f'{alarm["effect"]}@{alarm["port"]} {alarm["size"] and "%.3g" % alarm["size"]["value"]} '
            f'{alarm["equivalent"] or ""} |'
        )

    figure, axes = plt.subplots(4, 2, figsize=(10.6, 9.2), sharex=True, constrained_layout=True)
    for column, b, title in ((0, 'v2', 'chamber section V2'), (1, 't', 'nozzle T')):
        top, middle, low, last = axes[:, column]
        top.plot(t, s[f'{b}_inlet_pressure'] / 1e5, color='#1f5f99', linewidth=0.6, label='inlet')
        top.plot(t, s[f'{b}_outlet_pressure'] / 1e5, color='#c0362c', linewidth=0.6, label='outlet')
        top.set_title(f'{title}: pressures (Figs 6, 7)', fontsize=9.5)
        top.set_ylabel('bar')
        top.legend(frameon=False, fontsize=8.5, loc='lower center')
        middle.plot(t, s[f'q.{b}_c'], color='#1f5f99', linewidth=0.7)
        mean = np.mean(s[f'q.{b}_c'][steady])
        middle.set_ylim(0.975 * mean, 1.02 * mean)
        middle.set_title('c by least squares (Fig 8)', fontsize=9.5)
        for row, (name, colour, words) in enumerate(
            ((f'c_{b}_5', '#d1741b', '0.5 %, 3 δ'), (f'c_{b}_10', '#c0362c', '1 %, 5 δ'))
        ):
            for a, z in flags(answer, name):
                low.broken_barh([(a, max(z - a, 0.1))], (row - 0.35, 0.7), color=colour)
        for a, z in flags(answer, f'kalman_{b}'):
            low.broken_barh([(a, max(z - a, 0.1))], (1.65, 0.7), color='#8d4fa8')
        low.set_yticks([0, 1, 2], ['c: 0.5 %, 3 δ', 'c: 1 %, 5 δ', 'Kalman: 10 Pa, 3 δ'])
        low.set_ylim(-0.6, 2.6)
        low.set_title('flags in steady firing (Figs 9, 10, 13)', fontsize=9.5)
        last.plot(printed['t'], printed[f'q.{b}_pressure_residual'], color='#8d4fa8', linewidth=0.6)
        last.set_ylim(-60, 60)
        last.set_ylabel('Pa')
        last.set_title('residual after correction, filter as printed (Figs 11, 12)', fontsize=9.5)
        last.set_xlabel('s')
        for a in axes[:, column]:
            style(a)
    figure.savefig(out / 'cooling_paper.png', dpi=110)


def points(folder, out, seed=502):
    print('\n| operating point | supply bar, u, h | c of V2 | within | c of T | within |\n|---|---|---|---|---|---|')
    first = {}
    for name, supply, u, h in (
        ('A', 70, 0.9, 1.0),
        ('B', 60, 0.9, 0.8),
        ('C', 70, 0.7, 1.1),
        ('D', 50, 0.7, 0.6),
        ('E', 80, 1.0, 1.15),
    ):
        inputs = {'supply_pressure': {**SHEET['inputs']['supply_pressure'], 'value': supply * 1e5}}
        controllers = json.loads(json.dumps(SHEET['controllers']))
        controllers['throttling']['heat_level'] = h
        profiles = [{**p, 'value': u} if p['name'] == 'steady' else p for p in SHEET['profiles']]
        sheet = written(folder, f'point_{name}', inputs=inputs, controllers=controllers, profiles=profiles)
        series = pathlib.Path(folder) / 'point.csv'
        answer = diagnose(simulate(folder, seed, profile='steady', duration=20, sheet=sheet), sheet, series)
        s = columns(series)
        steady = s['t'] > 6
        cells = []
        for b in ('v2', 't'):
            c = s[f'q.{b}_c'][steady]
            first.setdefault(b, np.mean(c))
            cells += [
                f'{np.mean(c):.6f} ({100 * (np.mean(c) / first[b] - 1):+.2f} %)',
                f'{100 * np.max(np.abs(c / np.mean(c) - 1)):.2f} %',
            ]
        print(
            f'| {name} | {supply}, {u}, {h} | {" | ".join(cells)} |'
            + (f' {answer["alarms"]}' if answer['alarms'] else '')
        )


def sweep_detectors():
    """Each detector with many thresholds, so that one pass over a recording shows them all."""
    found = []
    for margin in (0.05, 0.02, 0.01, 0.0075, 0.005, 0.003, 0.002, 0.0015, 0.001, 0.0007):
        for channel in ('inlet_pressure', 'outlet_pressure', 'mass_flow'):
            found.append(
                watch(
                    f'redline|{margin}|{channel}',
                    'redline',
                    quantity=f't_{channel}',
                    relative_margin=margin,
                    learn=0.2,
                    armed_by='steady_time',
                    armed_above=2,
                )
                | {'minimum_time': 0.2}
            )
    for delta in (0.0001, 0.0002, 0.0003, 0.0005, 0.001, 0.002, 0.005, 0.01):
        found.append(
            watch(
                f'CUSUM on c|{delta}',
                'cusum',
                quantity='t_c',
                relative_change=delta,
                threshold_changes=3,
                learn=2,
                **ARMED,
            )
        )
    for stage, name, delta in (
        ('printed_filter', 'CUSUM, Kalman as printed', 10),
        ('branch_filter', 'CUSUM, Kalman exact', 4000),
        ('unscented_filter', 'CUSUM, unscented', 4000),
    ):
        for changes in (0.5, 1, 1.5, 2, 3, 5, 10, 30, 100):
            found.append(
                watch(
                    f'{name}|{changes}',
                    'cusum',
                    quantity='t_pressure_residual',
                    stage=stage,
                    change=delta,
                    threshold_changes=changes,
                    reference=0,
                )
            )
    return found


def delay_run(job):
    folder, seed, sheet, leak = job
    bag = simulate(folder, seed, [LEAK] if leak else [])
    answers = [diagnose(bag, sheet), diagnose(bag)]
    os.remove(bag)
    first, false = {}, {}
    for answer, told in ((answers[0], None), (answers[1], 'isolation|shipped')):
        for alarm in answer['alarms']:
            name = told or '|'.join(alarm['text'].split('|')[:2])
            if told and (alarm['text'].startswith('Redline') or alarm['kind'] == 'model'):
                continue
            if alarm['raised'] > FIRING[1] or alarm['until'] < FIRING[0]:
                continue
            if leak and alarm['raised'] < 30 <= alarm['until']:
                first[name] = -1  # was on already: finds nothing
            elif leak and 30 <= alarm['raised'] < 50:
                first[name] = min(first.get(name, math.inf), alarm['raised'] - 30)
            elif not leak:
                false[name] = false.get(name, 0) + 1
    return leak, first, false


def delay(folder, out, seeds):
    sheet = written(folder, 'sweep', estimators=estimators(), detectors=sweep_detectors(), isolators=[])
    jobs = [(folder, 600 + k, sheet, leak) for k in range(seeds) for leak in (True, False)]
    with concurrent.futures.ThreadPoolExecutor(2) as workers:
        results = list(workers.map(delay_run, jobs))
    hours = seeds * (FIRING[1] - FIRING[0]) / 3600
    names = []
    for entry in [*sweep_detectors(), {'text': 'isolation|shipped'}]:
        name = '|'.join(entry['text'].split('|')[:2])
        if name not in names:
            names.append(name)
    figure, axes = plt.subplots(figsize=(8.6, 5.2), constrained_layout=True)
    print(
        f'\n| detector | threshold | leaks found of {seeds} | median delay, s | false alarms per hour ({hours:.2f} h) |'
    )
    print('|---|---|---|---|---|')
    curves = {}
    for name in names:
        kind, threshold = name.split('|')
        delays = [first.get(name, math.inf) for leak, first, _ in results if leak]
        delays = [math.inf if delay < 0 else delay for delay in delays]
        alarms = sum(false.get(name, 0) for leak, _, false in results if not leak)
        median = statistics.median(delays)
        curves.setdefault(kind, []).append((alarms / hours, median))
        print(
            f'| {kind} | {threshold} | {sum(map(math.isfinite, delays))} |'
            f' {"%.2f" % median if math.isfinite(median) else "-"} | {alarms / hours:.0f} |'
        )
    floor = 0.5 / hours
    for kind, curve in curves.items():
        seen = [(max(rate, floor), median) for rate, median in curve if math.isfinite(median)]
        axes.plot(
            [rate for rate, _ in seen],
            [median for _, median in seen],
            '--s' if kind == 'CUSUM, unscented' else '-o',
            color=COLOURS[kind],
            label=kind,
            markersize=3 if kind == 'CUSUM, unscented' else 5,
        )
        if not seen:
            axes.plot([], [], 'o-', color=COLOURS[kind], label=f'{kind}: none found')
    axes.axvline(floor, color='#9aa3ad', linewidth=0.7, linestyle=':')
    axes.text(floor, 0.02, ' none seen', color='#5a646e', fontsize=8, transform=axes.get_xaxis_transform())
    axes.set_xscale('log')
    axes.set_yscale('log')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(matplotlib.ticker.FormatStrFormatter('%g'))
        axis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axes.set_yticks([0.5, 1, 2, 4])
    axes.set_xlabel(f'false alarms on the nozzle, per hour of steady firing ({hours:.2f} h)')
    axes.set_ylabel('median delay after the leak begins, s')
    axes.legend(frameon=False, fontsize=8.5)
    style(axes)
    figure.savefig(out / 'cooling_delay.png', dpi=110)


FAULTS = [  # effect, sizes: gross and small; how it grows
    *[
        (f'orifice_leakage@flow.{{b}}_{place}_ambient:coefficient={size}', size, words)
        for place in ('outlet', 'inlet', 'drain')
        for size, words in ((2e-7, 'step'), (1.25e-8, 'ramp'))
    ],
    *[
        (f'clogging@restriction.{{b}}_{place}:fraction={size}', size, words)
        for place in ('orifice', 'feed', 'drain')
        for size, words in ((0.2, 'step'), (0.02, 'ramp'))
    ],
    *[
        (f'offset@sensor.{{b}}_{channel}:value={size}', size, 'step')
        for channel, size in (
            ('inlet_pressure', 2e4),
            ('outlet_pressure', 2e4),
            ('mass_flow', 0.03),
            ('inlet_temperature', 2),
            ('outlet_temperature', 2),
        )
    ],
    *[
        (f'drift@sensor.{{b}}_{channel}:rate={size}', size, 'step')
        for channel, size in (
            ('inlet_pressure', 500),
            ('outlet_pressure', 500),
            ('mass_flow', 0.001),
            ('inlet_temperature', 0.1),
            ('outlet_temperature', 0.1),
        )
    ],
    *[
        (f'stuck@sensor.{{b}}_{channel}:', None, 'step')
        for channel in ('outlet_pressure', 'mass_flow', 'outlet_temperature')
    ],
    *[
        (f'noise@sensor.{{b}}_{channel}:std={size}', size, 'step')
        for channel, size in (('inlet_pressure', 1e4), ('mass_flow', 0.03), ('outlet_temperature', 1))
    ],
    ('ripple@source.{b}_drain:amplitude=2e5,frequency=30', 2e5, 'step'),
    ('scale@heat.{b}_wall:factor=1.3', 1.3, 'step'),
    ('scale@command.heat_load_command:factor=1.3', 1.3, 'step'),
    ('droop@source.supply:resistance=6e7', 6e7, 'ramp'),
    ('clogging@restriction.bench_valve:fraction=0.1', 0.1, 'ramp'),
    ('offset@sensor.supply_pressure:value=2e5', 2e5, 'step'),
]
START, LENGTH = 8.0, 20.0  # s


def isolation_run(job):
    folder, fault, branch, seed = job
    effect, size, grows = fault
    effect = effect.format(b=branch)
    spec = (
        effect
        + ('' if effect.endswith(':') else ',')
        + (f'from={START:g},to={START + 4:g}' if grows == 'ramp' else f'from={START:g}')
    )
    bag = simulate(folder, seed, [spec], 'steady', LENGTH)
    answer = diagnose(bag)
    os.remove(bag)
    truth = effect.split(':')[0]
    alarms = [a for a in answer['alarms'] if not a['text'].startswith('Redline') and a['kind'] != 'model']
    redline = min((a['raised'] - START for a in answer['alarms'] if a['text'].startswith('Redline')), default=None)
    before = [a for a in alarms if a['raised'] < START]
    alarms = [a for a in alarms if a['raised'] >= START]
    if not alarms:
        return fault, 'silent', None, None, None, redline, len(before)
    named = [f'{a["effect"]}@{a["port"]}' for a in alarms]
    right = [a for a, name in zip(alarms, named) if name == truth or truth in a['equivalent']]
    last = right[-1] if right else alarms[-1]
    wrong = [name for a, name in zip(alarms, named) if a not in right and a['kind'] != 'unknown']
    if right and not wrong:
        how = 'alone' if not last['equivalent'] else 'in a set'
    elif right:
        how = 'and another'
    else:
        how = 'unknown' if all(a['kind'] == 'unknown' for a in alarms) else 'other: ' + ', '.join(sorted(set(wrong)))
    error = covered = None
    if right and size and last['size'] and f'{last["effect"]}@{last["port"]}' == truth:
        error = last['size']['value'] / size - 1
        covered = last['size']['low'] <= size <= last['size']['high']
    return fault, how, alarms[0]['raised'] - START, error, covered, redline, len(before)


def isolation(folder, out, seeds):
    branches = SHEET['branches']
    jobs = [(folder, fault, branches[k % len(branches)], 700 + k) for fault in FAULTS for k in range(seeds)]
    with concurrent.futures.ThreadPoolExecutor(2) as workers:
        results = list(workers.map(isolation_run, jobs))
    print(
        f'\n| fault ({seeds} runs, over the branches) | named alone | in a set | unknown | other | silent | median'
        ' delay, s | redline, s | median size error | within bounds |\n|---|---|---|---|---|---|---|---|---|---|'
    )
    false = 0
    for fault in FAULTS:
        mine = [r for r in results if r[0] is fault]
        count = {key: sum(r[1] == key for r in mine) for key in ('alone', 'in a set', 'unknown', 'silent')}
        others = [r[1] for r in mine if r[1] not in count]
        delays = [math.inf if r[2] is None else r[2] for r in mine]
        redlines = [math.inf if r[5] is None else r[5] for r in mine]
        errors, covered = [abs(r[3]) for r in mine if r[3] is not None], [r[4] for r in mine if r[4] is not None]
        false += sum(r[6] for r in mine)
        text = lambda value, form: '-' if not math.isfinite(value) else form % value  # noqa: E731
        print(
            f'| {fault[0].rstrip(":")}, {fault[2]} | {count["alone"]} | {count["in a set"]} | {count["unknown"]} |'
            f' {len(others)}{" (" + "; ".join(sorted(set(others))) + ")" if others else ""} | {count["silent"]} |'
            f' {text(statistics.median(delays), "%.3f")} | {text(statistics.median(redlines), "%.2f")} |'
            f' {"%.1f %%" % (100 * statistics.median(errors)) if errors else "-"} |'
            f' {f"{sum(covered)} of {len(covered)}" if covered else "-"} |'
        )
    print(f'\nAlarms before the fault began, over {len(results)} runs: {false}.')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('parts', nargs='*', help='paper, points, delay, isolation; default: all')
    parser.add_argument('--out', type=pathlib.Path, default=ROOT / 'docs/pictures')
    parser.add_argument(
        '--seeds', type=int, default=20, help='runs per fault for isolation (a quarter of it) and delay'
    )
    arguments = parser.parse_args()
    parts = arguments.parts or ['paper', 'points', 'delay', 'isolation']
    with tempfile.TemporaryDirectory() as folder:
        for part in parts:
            if part == 'paper':
                paper(folder, arguments.out)
            elif part == 'points':
                points(folder, arguments.out)
            elif part == 'delay':
                delay(folder, arguments.out, arguments.seeds)
            elif part == 'isolation':
                isolation(folder, arguments.out, max(1, arguments.seeds // 4))
            else:
                parser.error(f'there is no part {part}; there are paper, points, delay, isolation')


if __name__ == '__main__':
    main()
