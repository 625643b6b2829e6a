"""The same bars, elastic and plastic, with each code that is installed: `python -m benchmarks.peers -o FILE.json`.

`--python PATH` is the interpreter that has Akantu and Kratos, where that is another one. A code that is missing is
skipped. Each runs three times; the median rate counts.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
PEERS = ("akantu", "kratos", "calculix")


def run(python: str, words: list[str], repeats: int) -> dict[str, Any]:
    """The run with the median rate, or why there is none."""
    rows = []
    for _ in range(repeats):
        command = [python, str(HERE / words[0]), *words[1:]]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        lines = [line for line in done.stdout.splitlines() if line.startswith('{"problem"')]
        if done.returncode or not lines:
            return {"skipped": (done.stderr.strip().splitlines() or ["no result"])[-1]}
        rows.append(json.loads(lines[-1]))
    return sorted(rows, key=lambda row: row["rate"])[len(rows) // 2]


def main() -> None:
    """Run all, print and store."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the other codes")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    args = parser.parse_args()
    runs = [(sys.executable, ["warp_mca_bar.py", element]) for element in ("hex8", "hex8r")]
    runs += [(args.python, [f"{name}_bar.py"]) for name in PEERS]
    found: list[dict[str, Any]] = []
    for problem in ("elastic", "plastic"):
        first = None
        for python, words in runs:
            row = run(python, [*words, problem], args.repeats)
            if "skipped" in row:
                print(f"{problem} {words[0]}: skipped, {row['skipped']}", flush=True)
                continue
            first = first or row
            found.append(row | {"slower": first["rate"] / row["rate"]})
            print(
                f"{problem} {row['code']:10}{row['version']:14}{row['element']:24}{row['rate'] / 1e6:8.3f} M "
                f"element-steps/s{found[-1]['slower']:7.1f} times slower{100 * row['error']:8.2f} % error",
                flush=True,
            )
    if args.output:
        args.output.write_text(json.dumps({"peers": found}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
