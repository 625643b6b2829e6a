"""Owns the verdict on a run: films its skins, looks how deep they went into each other, and at what the run said."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_scenes.crossing import NAMES, Random
from benchmarks.random_scenes.overlap import Skin, crossings, depth, reversed_share
from warp_mca.recorders.recorder import Cadence, Frame, FramesOnly, RunInfo
from warp_mca.step.shown import SURFACE, VOLUME

Array = NDArray[np.float64]
DEEP = 0.1  # of the least thickness: deeper is an overlap that no contact should leave
THROUGH = 0.5  # of the least thickness, from which on bodies are on their way through
LOOKS = 12  # frames in which skins cross that depth is measured in
STILL = 0.002  # of the greatest impulse, that a frame changes it by at least in contact
QUIET = 6  # frames without contact that end it
CAUSES = {  # parts of sentences that say of a run that bodies went into each other
    "into each other": "went into each other",
    "sank": "sank deeper than half a face",
    "deep": "m thick: contact",
    "missed": "missed",
    "coarse slave": "faces of the slave",
    "outran": "outran the contact search",
    "lists": "contact lists overflowed",
}


class Film(FramesOnly):
    """Keeps the skins of all frames, and the momentum of each body.

    Attributes:
        times: of the frames [s].
        skins: of each frame, by body.
        momentum: of each frame, by body [kg m/s], each shape (3,).
    """

    name = "the judge"
    needs = frozenset({SURFACE, VOLUME})

    def __init__(self, frames: int) -> None:
        self.cadence = Cadence(frames=frames)
        self.times: list[float] = []
        self.skins: list[dict[str, Array]] = []
        self.momentum: list[dict[str, Array]] = []

    def start(self, info: RunInfo) -> None:
        """Take the skins' triangles and the masses."""
        self.triangles = {name: surface.triangles for name, surface in info.surfaces.items()}
        bounds = [*sorted(info.model.node_start.values()), info.model.node_count]
        self.nodes = {n: slice(a, min(b for b in bounds if b > a)) for n, a in info.model.node_start.items()}
        self.mass = info.model.mass

    def frame(self, frame: Frame) -> None:
        """Keep a frame."""
        assert frame.volume is not None
        self.times.append(frame.time)
        self.skins.append({name: np.array(points, dtype=np.float64) for name, points in frame.points.items()})
        velocity = frame.volume.velocity.astype(np.float64)
        self.momentum.append({n: self.mass[own] @ velocity[own] for n, own in self.nodes.items()})

    def pair(self, frame: int) -> list[Skin]:
        """Skins of the two bodies in a frame."""
        return [Skin.of(self.skins[frame][name], self.triangles[name]) for name in NAMES]


def depths(film: Film, found: Random) -> dict[int, tuple[float, Array]]:
    """How deep the bodies lie in each other, and where [m], in frames in which their skins cross, by frame."""
    finite = [k for k, skins in enumerate(film.skins) if all(np.isfinite(x).all() for x in skins.values())]
    crossed = [k for k in finite if any(len(c) for c in _crossed(film, k))]
    chosen = [crossed[int(k)] for k in np.unique(np.linspace(0, len(crossed) - 1, LOOKS).round())] if crossed else []
    rng = np.random.default_rng(found.seed)
    return {k: depth(*film.pair(k), found.direction, rng) for k in chosen}


def _crossed(film: Film, frame: int) -> list[Array]:
    one, other = film.pair(frame)
    return [crossings(one, other)[0], crossings(other, one)[0]]


def seen(film: Film, found: Random) -> dict[str, Any]:
    """What the skins of one frame or more show: depth over the least thickness, and whether bodies changed sides."""
    deep = depths(film, found)
    worst = max(deep, key=lambda k: deep[k][0], default=None)
    share = deep[worst][0] / found.least if worst is not None else 0.0
    last = np.concatenate(list(film.skins[-1].values()))
    beyond = reversed_share(*film.pair(-1), found.direction) if np.isfinite(last).all() else 0.0
    through = share >= THROUGH or (share >= DEEP and beyond > 0.5)
    return {
        "depth": round(float(share), 4),
        "worst_time": None if worst is None else float(f"{film.times[worst]:.4g}"),
        "beyond": round(beyond, 3),
        "seen": "through" if through else "overlap" if share >= DEEP else "apart",
    }


def told(row: Mapping[str, Any]) -> bool:
    """Whether a run was stopped or refused, or warned that bodies went into each other."""
    return row["status"] in ("stopped", "refused") or any(
        part in text for text in row["said"] for part in CAUSES.values()
    )


def silent(row: Mapping[str, Any]) -> bool:
    """Whether bodies went into each other without a word."""
    return row.get("seen", "apart") != "apart" and not told(row)


def impulses(coarse: Film, fine: Film) -> tuple[float, Array, Array]:
    """When the first contact of the fine run is over [s], and the impulse that each run has given by then [N s].

    It is the change of momentum of the first body, which the contact has no part in recording. A contact is over when
    the momentum hardly changes for some frames. Both films have the same times.
    """
    gained = [np.array([m[NAMES[0]] for m in film.momentum]) for film in (coarse, fine)]
    gained = [item - item[0] for item in gained]
    change = np.linalg.norm(np.diff(gained[1], axis=0), axis=1)
    active = change > STILL * np.linalg.norm(gained[1], axis=1).max()
    first = int(np.argmax(active))
    quiet = [k for k in range(first, len(active) - QUIET) if not active[k : k + QUIET].any()]
    end = quiet[0] if quiet else len(active)
    return fine.times[end], gained[0][end], gained[1][end]
