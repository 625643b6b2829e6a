"""The same bars with each code that is installed: `python -m benchmarks.peers -o FILE.json [elastic plastic taylor]`.

`--python PATH` is the interpreter that has Akantu and Kratos, where that is another one. A code that is missing is
skipped. Each runs three times, Taylor's test once; the median rate counts. Problems that are not named keep their
rows in the file.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.measurements import note

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


def runs(problem: str, python: str, mesh: Path) -> list[tuple[str, list[str]]]:
    """Interpreter and words of each run; ours comes first."""
    if problem != "taylor":
        ours = [(sys.executable, ["warp_mca_bar.py", element, problem]) for element in ("hex8", "hex8r")]
        return ours + [(python, [f"{name}_bar.py", problem]) for name in PEERS]
    found = [(sys.executable, ["warp_mca_taylor.py", element, str(mesh)]) for element in ("hex8", "hex8r")]
    found += [(python, [f"{name}_taylor.py", str(mesh)]) for name in PEERS]
    return [*found, (python, ["calculix_taylor.py", "C3D8R", str(mesh)])]


def measure(problem: str, python: str, repeats: int) -> list[dict[str, Any]]:
    """Run and print one problem."""
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "mesh.npz"
        if problem == "taylor":
            sys.path.append(str(HERE))
            from taylor import write_mesh

            write_mesh(mesh)
        for interpreter, words in runs(problem, python, mesh):
            row = run(interpreter, words, 1 if problem == "taylor" else repeats)
            if "skipped" in row:
                print(f"{problem} {words[0]}: skipped, {row['skipped']}", flush=True)
                continue
            found.append(row | {"slower": (found[0] if found else row)["rate"] / row["rate"]})
            print(
                f"{problem} {row['code']:10}{row['version']:14}{row['element']:24}{row['rate'] / 1e6:8.3f} M "
                f"element-steps/s{found[-1]['slower']:7.1f} times slower{100 * row['error']:8.2f} % error",
                flush=True,
            )
    return found


def main() -> None:
    """Run all, print and store."""
    problems = ("elastic", "plastic", "taylor")
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0])
    parser.add_argument("problems", nargs="*", choices=(*problems, []), help="all by default")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the other codes")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    args = parser.parse_args()
    found: list[dict[str, Any]] = []
    if args.output and args.output.exists() and args.problems:
        kept = json.loads(args.output.read_text(encoding="utf-8"))["peers"]
        found = [row for row in kept if row["problem"] not in args.problems]
    for problem in args.problems or problems:
        found += measure(problem, args.python, args.repeats)
        if args.output:
            args.output.write_text(json.dumps({"peers": found}, indent=1) + "\n", encoding="utf-8")
            note(args.output, "cpu")


if __name__ == "__main__":
    main()
