"""Owns the comparison of two checkouts: whether every built-in scene gives the same history, bit for bit.

    python -m benchmarks.histories OLD NEW --out table.md

OLD and NEW are folders of checkouts, or revisions of this repository. Kernels and scenes are those of each checkout.
Scenes that only one of them has are left out. On a CPU the table takes some three minutes.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import warp as wp

ROOT = Path(__file__).resolve().parents[1]
FAST = {"two_link": {"duration": 2e-4}, "taylor_bar": {"duration": 2e-5}}  # shorter runs of scenes that take long
RUN = """
import sys
import numpy as np
import warp_mca as mca
out, name, duration, *kinds = sys.argv[1:]
for kind in kinds:
    device, precision = kind.split()
    result = mca.run(mca.make_scene(name), device=device, precision=precision, duration=float(duration) or None)
    np.savez(f"{out}/{kind}.npz", **result.history)
"""

History = dict[str, np.ndarray]


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


def histories(folder: Path, scene: str, kinds: Sequence[str]) -> list[History]:
    """Histories of a scene on each device with each precision, run in a process of its own.

    Args:
        folder: of the checkout.
        scene: its name.
        kinds: device and precision, as "cpu mixed".

    Raises:
        SystemExit: the scene does not run; says why.
    """
    duration = FAST.get(scene, {}).get("duration", 0.0)
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-P", "-c", RUN, out, scene, repr(duration), *kinds]
        paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        done = subprocess.run(command, cwd=folder, env=env, check=False, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{scene} of {folder} fails:\n{done.stderr}")
        found = []
        for kind in kinds:
            with np.load(Path(out) / f"{kind}.npz") as arrays:
                found.append(dict(arrays))
        return found


def difference(old: History, new: History) -> str:
    """Whether all columns have the same bits, or the greatest difference of one, over what is greatest of its kind [-].

    Components of a velocity are of one kind, and so are energies and forces: rounding of one that should be zero is
    then no difference worth naming.
    """
    columns = [name for name in {**old, **new} if name not in old or name not in new]
    columns += [name for name in old if name in new and new[name].shape != old[name].shape]
    if columns:
        return f"columns differ: {', '.join(columns)}"
    most = {kind: max(_greatest(old[name]) for name in old if _kind(name) == kind) for kind in map(_kind, old)}
    unlike = {
        name: _share(old[name], new[name], most[_kind(name)])
        for name in old
        if old[name].tobytes() != new[name].tobytes()
    }
    if not unlike:
        return "equal"
    worst = max(unlike, key=lambda name: unlike[name])
    return f"{unlike[worst]:.1e} ({worst})"


def _kind(column: str) -> str:
    """What columns of the same kind have in common: the point whose velocity they hold, or the first letters."""
    stem, _, axis = column.rpartition("_v")
    return stem if axis in ("x", "y", "z") else column[:2] if column[:2] in ("E_", "F_") else column


def _greatest(column: np.ndarray) -> float:
    return float(np.nanmax(np.abs(column), initial=0.0))


def _share(old: np.ndarray, new: np.ndarray, most: float) -> float:
    """Greatest difference over `most` [-]; inf where only one of the two is a number."""
    if not np.array_equal(np.isnan(old), np.isnan(new)):
        return np.inf
    return _greatest(new - old) / most if most > 0.0 else np.inf


def _scene_names(folder: Path) -> list[str]:
    """Built-in scenes of a checkout: each has a file of its name."""
    return sorted(file.stem for file in (folder / "scenes").glob("*.py") if not file.stem.startswith("_"))


def compare(old: str, new: str, kinds: Sequence[str], scenes: Sequence[str], workers: int = 1) -> list[str]:
    """Rows of the table, printed as they come, of so many scenes side by side.

    Raises:
        SystemExit: a scene does not run.
    """
    rows = ["| scene | " + " | ".join(kinds) + " |", "|---" * (1 + len(kinds)) + "|"]
    print("\n".join(rows), flush=True)
    with checkout(old) as before, checkout(new) as after:
        known = _scene_names(before)

        def row(scene: str) -> str:
            pairs = zip(*(histories(folder, scene, kinds) for folder in (before, after)), strict=True)
            return f"| {scene} | " + " | ".join(difference(*pair) for pair in pairs) + " |"

        with ThreadPoolExecutor(workers) as pool:
            for text in pool.map(row, scenes or [name for name in _scene_names(after) if name in known]):
                rows.append(text)
                print(text, flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description="compare the histories of two checkouts bit for bit")
    parser.add_argument("old", help="folder or revision")
    parser.add_argument("new", help="folder or revision")
    parser.add_argument("--device", nargs="+", help="(default: cpu, and cuda:0 where there is one)")
    parser.add_argument("--precision", nargs="+", default=["mixed", "float64"])
    parser.add_argument("--scenes", nargs="+", default=[], help="(default: all that both have)")
    parser.add_argument("--workers", type=int, default=1, help="scenes that run side by side (default: 1)")
    parser.add_argument("--out", type=Path, help="file for the table")
    args = parser.parse_args()
    devices = args.device or (["cpu", "cuda:0"] if wp.is_cuda_available() else ["cpu"])
    kinds = [f"{device} {precision}" for device in devices for precision in args.precision]
    rows = compare(args.old, args.new, kinds, args.scenes, args.workers)
    if args.out:
        args.out.write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
