"""Owns what a person looks at: a picture of a scene's first, deepest and last frame, and a script that runs it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.random_scenes.crossing import FAMILIES, NAMES, Random, crossing
from benchmarks.random_scenes.judge import Film, depths
from benchmarks.random_scenes.placing import frame_of

SCRIPT = '''"""Scene {seed} of the random scenes "{family}", from the repository's root."""

import warp_mca as mca
from benchmarks.random_scenes.measure import scene_of

result = mca.run(scene_of("{family}", {seed}))
print(result, *result.warnings, sep="\\n")
'''


def show(family: str, seed: int, folder: Path, device: str) -> str:
    """Write the script and, of two bodies that meet, the picture; say what happened."""
    from benchmarks.random_scenes.measure import run
    from benchmarks.random_scenes.page import line

    stem = folder / f"{family.replace(' ', '_')}_{seed}"
    stem.with_suffix(".py").write_text(SCRIPT.format(family=family, seed=seed), encoding="utf-8")
    if family not in FAMILIES:
        return f"{stem}.py"
    found = crossing(seed, family)
    film = Film(found.frames)
    row, _ = run(found.scene, device, [film])
    deep = depths(film, found) if film.skins else {}
    worst = max(deep, key=lambda k: deep[k][0], default=len(film.skins) // 2)
    share = deep[worst][0] / found.least if deep else 0.0
    if film.skins:
        picture(film, found, (0, worst, len(film.skins) - 1), stem.with_suffix(".png"))
    told = line({"family": family, "seed": seed, **found.facts, **row})
    return f"{told}\n{found.facts}\ndepth {share:.2f} of the least thickness\n" + "\n".join(row["said"])


def picture(film: Film, found: Random, frames: tuple[int, ...], file: Path) -> None:
    """The skins in these frames, seen across the direction of approach, from two sides."""
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5 * len(frames), 9))
    axes = frame_of(found.direction)
    for row, order in enumerate(((0, 2, 1), (1, 2, 0))):
        for column, frame in enumerate(frames):
            plot = figure.add_subplot(2, len(frames), row * len(frames) + column + 1)
            polygons, heights, colours = [], [], []
            for name, colour in zip(NAMES, ((0.3, 0.5, 0.8), (0.9, 0.6, 0.2)), strict=True):
                corners = (film.skins[frame][name] @ axes[list(order)].T)[film.triangles[name]]
                normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                light = 0.4 + 0.6 * np.abs(normal[:, 2]) / (np.linalg.norm(normal, axis=1) + 1e-30)
                polygons += list(corners[:, :, :2])
                heights += list(corners[:, :, 2].mean(axis=1))
                colours += [(*(value * np.array(colour)).tolist(), 0.75) for value in light]
            ranks = np.argsort(heights)
            plot.add_collection(
                PolyCollection(
                    [polygons[k] for k in ranks],
                    facecolors=[colours[k] for k in ranks],
                    edgecolors=(0.0, 0.0, 0.0, 0.25),
                    linewidths=0.3,
                )
            )
            plot.set_aspect("equal")
            plot.autoscale_view()
            plot.set_title(f"{film.times[frame]:.3g} s")
    figure.savefig(file, dpi=70)
