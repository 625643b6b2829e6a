"""What the verification notices: `python -m benchmarks.mutations [NAME ...]`.

Makes each deliberate error of `warp_mca.verify.mutations` in a copy of the package and runs, at the quick level, the
cases that say they catch it: each must then fail.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from warp_mca.verify import cases
from warp_mca.verify.mutations import MUTATIONS, Mutation

ROOT = Path(__file__).parent.parent
TREES = {"warp_mca": "warp_mca", "kernels": "warp_mca/kernels", "scenes": "warp_mca/scenes"}


def copy(folder: Path, mutation: Mutation) -> None:
    """The package with the error in it.

    Raises:
        ValueError: the text to change does not stand there once.
    """
    for tree, place in TREES.items():
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / tree, folder / place, ignore=ignore, dirs_exist_ok=True)
    tree, _, name = mutation.file.partition("/")
    file = folder / TREES[tree] / name
    text = file.read_text(encoding="utf-8")
    if text.count(mutation.old) != 1:
        raise ValueError(f"{mutation.file} holds {mutation.old!r} {text.count(mutation.old)} times")
    file.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")


def check_origin(folder: Path) -> None:
    """Makes sure that Python takes the package from the copy.

    Raises:
        RuntimeError: it does not.
    """
    text = (
        "import warp_mca.kernels.j2 as a, warp_mca.elements as b, warp_mca.scenes as c; print(*map(origin, (a, b, c)))"
    )
    command = [sys.executable, "-c", f"origin = lambda module: module.__file__; {text}"]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout.split()
    elsewhere = [file for file in said if folder.resolve() not in Path(file).resolve().parents]
    if elsewhere:
        raise RuntimeError(f"the copy in {folder} is not what runs: Python imports {', '.join(elsewhere)}")


def caught(name: str, case: str) -> bool:
    """Whether `case` fails in a copy with the error `name`."""
    with tempfile.TemporaryDirectory() as folder:
        copy(Path(folder), MUTATIONS[name])
        check_origin(Path(folder))
        command = [sys.executable, "-m", "warp_mca", "verify", case, "--element", MUTATIONS[name].element]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr)
    return done.returncode == 1


def main() -> None:
    """Run every pair of error and case; exit 1 if one goes unnoticed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *MUTATIONS])
    args = parser.parse_args()
    missed = 0
    for case in cases():
        for name in case.catches:
            if args.names and name not in args.names:
                continue
            found = caught(name, case.name)
            missed += not found
            verdict = "fails, as it must" if found else "DOES NOT NOTICE"
            print(f"{name}: {case.name} ({MUTATIONS[name].element}) {verdict}", flush=True)
    sys.exit(min(missed, 1))


if __name__ == "__main__":
    main()
