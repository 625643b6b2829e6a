"""Owns the stress that a run recorded along its paths (paths.npz)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from warp_mca.model.paths import Probes
from warp_mca.results.npz import load_histories, save_histories

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PathHistory:
    """Stress along one path in every output interval.

    Attributes:
        name: of the path.
        position: of the probes along the path [m], shape (probe_count,), float64.
        stress: xx, yy, zz, xy, yz, xz in the world frame [Pa], shape (row_count, probe_count, 6), float32.
    """

    name: str
    position: Array
    stress: NDArray[np.float32]

    @property
    def von_mises(self) -> NDArray[np.float32]:
        """Equivalent stress [Pa], shape (row_count, probe_count), float32."""
        xx, yy, zz, xy, yz, xz = np.moveaxis(self.stress, -1, 0)
        direct = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2)
        return np.sqrt(direct + 3.0 * (xy**2 + yz**2 + xz**2))

    def at(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> PathHistory:
        """The same in some output intervals: their numbers, shape (count,), or whether each is, shape (row_count,)."""
        return PathHistory(self.name, self.position, self.stress[rows])


def path_histories(probes: Probes, rings: Sequence[NDArray[np.float32]]) -> tuple[PathHistory, ...]:
    """The paths of a run from what all probes recorded [Pa], each shape (row_count, probe_count, 6)."""
    if not probes.position:
        return ()
    ends = np.cumsum([len(position) for position in probes.position.values()])
    whole = rings[0] if len(rings) == 1 else np.concatenate(rings)
    parts = np.split(whole, ends[:-1], axis=1)
    return tuple(PathHistory(name, at, s) for (name, at), s in zip(probes.position.items(), parts, strict=True))


def save_paths(file: FilePath, time: Array, paths: Sequence[PathHistory]) -> None:
    """Write time_s, and for each path NAME/position_m, NAME/stress_Pa and NAME/von_mises_Pa, as an npz archive."""
    columns = {
        path.name: {"position_m": path.position, "stress_Pa": path.stress, "von_mises_Pa": path.von_mises}
        for path in paths
    }
    save_histories(file, time, columns)


def load_paths(file: str | os.PathLike[str]) -> tuple[PathHistory, ...]:
    """The paths that `save_paths` wrote."""
    found = load_histories(file, "position_m", "stress_Pa")
    return tuple(PathHistory(name, *columns) for name, columns in found.items())
