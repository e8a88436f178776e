#!/usr/bin/env python3
"""The same block in Peridyne and in LAMMPS, one core each, in turns: A B A B ...

Both run their own program on their own input (block.yaml, block.lammps): the same lattice, horizon, material and step, no bond breaks. What
counts is the time of the loop over steps as each program reports it. Printed are the ratios of the rounds, not of medians of
separate runs: a machine that drifts slows both alike.
"""
import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAIRS = [("bond-based", "pmb"), ("linear-solid", "lps"), ("correspondence", "pmb")]


def bonds(cells):
    """Directed bonds within 3 spacings, counted by lattice vectors."""
    reach = range(-3, 4)
    near = [(a, b, c) for a in reach for b in reach for c in reach if 0 < a * a + b * b + c * c <= 9]
    return sum((cells[0] - abs(a)) * (cells[1] - abs(b)) * (cells[2] - abs(c)) for a, b, c in near)


def on_one_core():
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def call(command, environment, folder):
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, preexec_fn=on_one_core)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def ours(options, run, folder):
    sizes = [f"--set={name}={value}" for name, value in zip(("nx", "ny", "nz", "steps"), (*options.cells, options.steps))]
    call([options.peridyne, "run", HERE / "block.yaml", "--run", run, "--threads", "1", "--quiet", "--out", "ours", *sizes], os.environ.copy(), folder)
    summary = json.loads((Path(folder) / "ours" / "summary.json").read_text())
    if summary["sizes"]["directed_bonds"] != bonds(options.cells):
        sys.exit(f"Peridyne has {summary['sizes']['directed_bonds']} directed bonds, not {bonds(options.cells)}")
    seconds = next(t["seconds"] for t in summary["timings"] if t["name"] == "solver")
    # the force at the start is within it: one evaluation more than there are steps
    return seconds / (options.steps + 1)


def theirs(options, style, folder):
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    program = Path(options.lammps).expanduser()
    library = program.resolve().parent.parent / "lib"
    environment["LD_LIBRARY_PATH"] = f"{library}:{environment.get('LD_LIBRARY_PATH', '')}"
    variables = dict(zip(("NX", "NY", "NZ", "STEPS"), (*options.cells, options.steps))) | {"STYLE": style}
    arguments = [a for name, value in variables.items() for a in ("-var", name, str(value))]
    text = call([program, "-in", HERE / "block.lammps", "-log", "none", *arguments], environment, folder)
    total = int(re.findall(r"total # of bonds\s*=\s*(\d+)", text)[-1])
    # LAMMPS counts from both ends, as we do
    if total != bonds(options.cells):
        print(f"   LAMMPS says {total} bonds; the lattice has {bonds(options.cells)} directed ones", file=sys.stderr)
    damage = float(re.findall(r"worst damage (\S+)", text)[-1])
    if damage != 0:
        sys.exit("bonds broke in LAMMPS")
    return float(re.findall(r"Loop time of (\S+)", text)[-1]) / options.steps


def spread(values, form):
    return f"{format(statistics.median(values), form)} [{format(min(values), form)}, {format(max(values), form)}]"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peridyne", default=HERE.parent.parent / "target/release/peridyne", help="the program (default: target/release/peridyne)")
    parser.add_argument("--lammps", required=True, help="the program lmp, in the bin folder of its virtual environment")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=40, help="steps of a timing")
    parser.add_argument("--cells", type=int, nargs=3, default=[50, 50, 40], help="points along the sides")
    options = parser.parse_args()
    options.peridyne = Path(options.peridyne).resolve()
    n = bonds(options.cells)
    print(f"{' x '.join(map(str, options.cells))} points, {n} directed bonds, {options.steps} steps, {options.rounds} rounds, one core")
    times = {pair: ([], []) for pair in PAIRS}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(options.rounds):
            for run, style in PAIRS:
                a, b = times[run, style]
                a.append(ours(options, run, folder))
                b.append(theirs(options, style, folder))
            ratios = ", ".join(f"{run} {b[-1] / a[-1]:.2f}" for (run, _), (a, b) in times.items())
            print(f"   round {k + 1}: {ratios}", file=sys.stderr)
    print(f"{'Peridyne':16} {'LAMMPS':10} {'ns per directed bond and step: Peridyne':>42} {'LAMMPS':>24} {'ratio of the rounds':>26}")
    for run, style in PAIRS:
        a, b = times[run, style]
        ns = lambda t: spread([x * 1e9 / n for x in t], ".2f")
        print(f"{run:16} {'peri/' + style:10} {ns(a):>42} {ns(b):>24} {spread([y / x for x, y in zip(a, b)], '.2f'):>26}")


if __name__ == "__main__":
    main()
