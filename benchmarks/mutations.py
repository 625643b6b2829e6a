"""What the verification notices: `python -m benchmarks.mutations [NAME ...]`, stored in mutations.json.

The file is in docs/measurements/.

Makes each deliberate error of `benchmarks.deliberate` in a copy of the package and runs, at the quick level, the
cases that say they catch it: a row of each must then be out of its tolerance or order. The copy runs without the guard
on the balance of energy, which would stop many of them first; other guards may.
Without names, pairs are run whose error, case or changed file is not as it was when they last were.
"""

from __future__ import annotations

import argparse
import hashlib
import inspect
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.deliberate import CATCHES, MUTATIONS
from benchmarks.deliberate.mutation import Mutation
from benchmarks.measurements import FOLDER, note
from warp_mca.verify import cases
from warp_mca.verify.case import Case

ROOT = Path(__file__).parent.parent
STORE = FOLDER / "mutations.json"
GUARD = ("warp_mca/scene/phases.py", "energy_tolerance: float = 0.01", "energy_tolerance: float = 1e9")
TREES = {"warp_mca": "warp_mca", "kernels": "warp_mca/kernels", "scenes": "warp_mca/scenes"}


def copy(folder: Path, mutation: Mutation) -> None:
    """The package with the error in it, and without the guard on energy.

    Raises:
        ValueError: the text to change does not stand there once.
    """
    for tree, place in TREES.items():
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / tree, folder / place, ignore=ignore, dirs_exist_ok=True)
    for path, old, new in ((mutation.file, mutation.old, mutation.new), GUARD):
        tree, _, name = path.partition("/")
        file = folder / TREES[tree] / name
        text = file.read_text(encoding="utf-8")
        if text.count(old) != 1:
            raise ValueError(f"{path} holds {old!r} {text.count(old)} times")
        file.write_text(text.replace(old, new), encoding="utf-8")


def check_origin(folder: Path) -> None:
    """Makes sure that Python takes the package from the copy.

    Raises:
        RuntimeError: it does not.
    """
    text = (
        "import warp_mca.kernels.materials.j2 as a, warp_mca.physics.elements as b, warp_mca.scenes as c; "
        "print(*map(origin, (a, b, c)))"
    )
    command = [sys.executable, "-c", f"origin = lambda module: module.__file__; {text}"]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.split()
    elsewhere = [file for file in said if folder.resolve() not in Path(file).resolve().parents]
    if elsewhere:
        raise RuntimeError(f"the copy in {folder} is not what runs: Python imports {', '.join(elsewhere)}")


def caught(name: str, case: str) -> str:
    """What of `case` fails in a copy with the error `name`: its first line out of tolerance; empty if it goes unseen.

    Raises:
        RuntimeError: the case broke down, which is no finding.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy(Path(folder), MUTATIONS[name])
        check_origin(Path(folder))
        command = [sys.executable, "-m", "warp_mca", "verify", case, "--element", MUTATIONS[name].element]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    found = [line.strip() for line in done.stdout.splitlines() if line.startswith("  ")]
    found = [line for line in found if line.endswith(": NOT MET") or line.startswith(("stopped: ", "gave nothing"))]
    if done.returncode not in (0, 1) or bool(found) != (done.returncode == 1):
        raise RuntimeError(f"{case} with {name} broke down: {done.stdout}{done.stderr}")
    return found[0] if found else ""


def state(name: str, case: Case) -> str:
    """A digest of the error, the file that it changes and the file of the case."""
    mutation = MUTATIONS[name]
    texts = [repr(mutation), (ROOT / mutation.file).read_text(encoding="utf-8")]
    texts.append(Path(inspect.getfile(case.measure)).read_text(encoding="utf-8"))
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def run_pair(name: str, case: Case) -> dict[str, str]:
    """One row of the store: the error, the case, the element, what failed, with which Warp, and the state of both."""
    import warp

    row = {"error": name, "case": case.name, "element": MUTATIONS[name].element, "failed": caught(name, case.name)}
    print(f"{name}: {case.name} ({row['element']}) {row['failed'] or 'DOES NOT NOTICE'}", flush=True)
    return row | {"what": MUTATIONS[name].what, "warp": warp.__version__, "state": state(name, case)}


def main() -> None:
    """Run pairs of error and case, store what they gave; exit 1 if an error goes unnoticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *MUTATIONS])
    parser.add_argument("--all", action="store_true", help="run every pair, also those that are as they were")
    args = parser.parse_args()
    stored = json.loads(STORE.read_text(encoding="utf-8")) if STORE.exists() else []
    known = {(row["error"], row["case"]): row for row in stored}
    rows = []
    for case in cases():
        for name in CATCHES[case.name]:
            old = known.get((name, case.name))
            stale = old is None or not old["failed"] or old["state"] != state(name, case)
            wanted = name in args.names if args.names else args.all or stale
            rows += [run_pair(name, case)] if wanted else [old] if old else []
            rest = [row for pair, row in known.items() if pair not in {(r["error"], r["case"]) for r in rows}]
            STORE.write_text(json.dumps(rows + rest, indent=1) + "\n", encoding="utf-8")  # in case it is stopped
    STORE.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    note(STORE, "cpu")
    sys.exit(any(not row["failed"] for row in rows))


if __name__ == "__main__":
    main()
