#!/usr/bin/env python3
"""Runs the suite (and, given --lammps, the comparison) and puts what they print into PERFORMANCE.md."""
import argparse
import datetime
import platform
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "PERFORMANCE.md"


def put(mark, command):
    print(" ".join(map(str, command)), file=sys.stderr)
    text = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.rstrip()
    when = f"{datetime.date.today()}, {platform.system()} {platform.release()}"
    page = PAGE.read_text()
    block = f"<!-- {mark} -->\n{when}\n\n```text\n{text}\n```\n<!-- /{mark} -->"
    page, found = re.subn(rf"<!-- {mark} -->.*?<!-- /{mark} -->", lambda _: block, page, flags=re.S)
    if found != 1:
        sys.exit(f"PERFORMANCE.md has no place for `{mark}`")
    PAGE.write_text(page)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lammps", help="the program lmp; see benches/peers/README.md")
    parser.add_argument("--only-peers", action="store_true")
    parser.add_argument("suite", nargs="*", help="further arguments of the suite, after --")
    options = parser.parse_args()
    if not options.only_peers:
        put("suite", ["cargo", "bench", "-q", "-p", "peridyne-benches", "--bench", "suite", "--", "--csv", "speed.csv", *options.suite])
    if options.lammps:
        put("peers", [sys.executable, "benches/peers/peers.py", "--lammps", options.lammps])


if __name__ == "__main__":
    main()
