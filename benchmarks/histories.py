"""Owns the comparison of two checkouts: whether every built-in scene gives the same history, bit for bit.

    python -m benchmarks.histories OLD NEW --device cpu cuda:0 --out table.md

OLD and NEW are folders of checkouts, or revisions of this repository. Kernels and scenes are those of each checkout.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FAST = {"two_link": {"duration": 2e-4}, "taylor_bar": {"duration": 2e-5}}  # shorter runs of scenes that take long
RUN = """
import sys
import numpy as np
import warp_mca as mca
name, device, precision, duration, out = sys.argv[1:]
result = mca.run(mca.make_scene(name), device=device, precision=precision, duration=float(duration) or None)
np.savez(out, **result.history)
"""


@contextmanager
def checkout(name: str) -> Iterator[Path]:
    """A folder from which `import warp_mca` takes that checkout: package, kernels and scenes."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder)
        if Path(name).is_dir():
            for part in ("warp_mca", "kernels", "scenes"):
                subprocess.run(["cp", "-r", str(Path(name) / part), str(target / part)], check=True)
        else:
            archive = subprocess.run(["git", "-C", str(ROOT), "archive", name], check=True, capture_output=True).stdout
            subprocess.run(["tar", "-xf", "-", "-C", folder], input=archive, check=True)
        for part in ("kernels", "scenes"):
            link = target / "warp_mca" / part
            link.unlink(missing_ok=True)  # of an editable install
            link.symlink_to(target / part)
        yield target


def _python(folder: Path, code: str, *arguments: str) -> str:
    env = {**os.environ, "PYTHONPATH": str(folder)}
    command = [sys.executable, "-P", "-c", code, *arguments]
    done = subprocess.run(command, cwd=folder, env=env, check=True, capture_output=True, text=True)
    return done.stdout


def histories(folder: Path, scene: str, device: str, precision: str) -> dict[str, np.ndarray]:
    """The history of a scene, run in a process of its own."""
    duration = FAST.get(scene, {}).get("duration", 0.0)
    with tempfile.TemporaryDirectory() as out:
        file = Path(out) / "history.npz"
        _python(folder, RUN, scene, device, precision, repr(duration), str(file))
        with np.load(file) as arrays:
            return {key: arrays[key] for key in arrays.files}


def difference(old: dict[str, np.ndarray], new: dict[str, np.ndarray]) -> str:
    """Whether the columns of the old history are the same in the new one, or the greatest difference of one [-]."""
    missing = [name for name in old if name not in new or new[name].shape != old[name].shape]
    if missing:
        return f"columns differ: {', '.join(missing)}"
    worst, where = 0.0, ""
    for name, values in old.items():
        if np.array_equal(values, new[name], equal_nan=True):
            continue
        share = float(np.nanmax(np.abs(new[name] - values)) / np.nanmax(np.abs(values)))
        if share >= worst:
            worst, where = share, name
    return f"{worst:.1e} ({where})" if where else "equal"


def _scene_names(folder: Path) -> list[str]:
    """Built-in scenes of a checkout: each has a file of its name."""
    return sorted(file.stem for file in (folder / "scenes").glob("*.py") if not file.stem.startswith("_"))


def compare(old: str, new: str, devices: Sequence[str], precisions: Sequence[str], scenes: Sequence[str]) -> list[str]:
    """Rows of the table, printed as they come."""
    rows = ["| scene | " + " | ".join(f"{d}, {p}" for d in devices for p in precisions) + " |"]
    rows.append("|---" * (1 + len(devices) * len(precisions)) + "|")
    with checkout(old) as before, checkout(new) as after:
        for scene in scenes or _scene_names(after):
            cells = [
                difference(*(histories(folder, scene, device, precision) for folder in (before, after)))
                for device in devices
                for precision in precisions
            ]
            rows.append(f"| {scene} | " + " | ".join(cells) + " |")
            print(rows[-1], flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description="compare the histories of two checkouts bit for bit")
    parser.add_argument("old", help="folder or revision")
    parser.add_argument("new", help="folder or revision")
    parser.add_argument("--device", nargs="+", default=["cpu"])
    parser.add_argument("--precision", nargs="+", default=["mixed", "float64"])
    parser.add_argument("--scenes", nargs="+", default=[], help="(default: all built-in ones)")
    parser.add_argument("--out", type=Path, help="file for the table")
    args = parser.parse_args()
    rows = compare(args.old, args.new, args.device, args.precision, args.scenes)
    if args.out:
        args.out.write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
