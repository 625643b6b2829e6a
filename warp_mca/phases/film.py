"""Owns what recorders see of a run of many phases: rigid motion at the rows of each swing, and each impact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.division import divide
from warp_mca.phases.history_rows import Rows
from warp_mca.phases.impact import Impact
from warp_mca.phases.motion import Part, Stress, SwingPart
from warp_mca.phases.prepare import Prepared, Setup
from warp_mca.recorders.frames import Recording, skins
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME, Recorder, RunInfo

Array = NDArray[np.float64]
COMPONENTS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])  # of a tensor among xx, yy, zz, xy, yz, xz


class Film:
    """The recorders of a run of many phases. Times count from the first touch, as those of the history.

    Attributes:
        needs: of the recorders.
        surfaces: of bodies that they show, by body.
        said: what they warned of.
        failed: names of those that failed.
    """

    def __init__(self, setup: Setup, recorders: Sequence[Recorder], ready: Prepared, origin: float) -> None:
        """Start the recorders; `ready` is the scene at its first touch, at the time `origin` from the release [s].

        Raises:
            RequestError: an output cannot be made.
        """
        self.setup, self.model, self.origin = setup, ready.model, origin
        self.said: list[str] = []
        self.needs: frozenset[str] = frozenset().union(*(recorder.needs for recorder in recorders))
        self.surfaces = skins(ready.model, ready.meshes)
        steps, paths = divide(ready.scene, ready.model, setup.request.span), ready.probes.position
        length, told = setup.t_end - self.origin, self.said.append
        info = RunInfo(
            ready.scene, ready.model, self.surfaces, paths, steps.dt, steps.interval, length, told, phases=True
        )
        self.recording = Recording(recorders, info, 0, steps.per_interval, None)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of recorders that failed."""
        return tuple(self.recording.failed)

    def watch(self, impact: Impact, start: float) -> None:
        """Take the frames of an impact that begins at a time from the release [s]."""
        steps, model = impact.steps, impact.ready[0].model
        shift = np.asarray(model.X - self.model.X, dtype=np.float32)
        begin, output = start - self.origin, impact.solver.output
        self.recording.follow(begin, steps.interval, steps.intervals, output=output, shift=shift)
        impact.recording = self.recording

    def take(self, part: Part, kept: slice, rows: Rows) -> None:
        """Show a phase that is over: the frames of a swing, at the samples `kept`, and the `rows` of the history."""
        if isinstance(part, SwingPart):
            self._show(part, kept)
        self.recording.history(lambda: rows.history)

    def finish(self, ok: bool) -> None:
        """Close the recorders of a run that ended as it should, or did not."""
        self.recording.finish(ok)

    def _show(self, part: SwingPart, kept: slice) -> None:
        """The frames of a swing."""
        run = part.swing
        rows = range(len(run.t))[kept]
        if not rows:
            return
        interval = float(run.t[1] - run.t[0]) if len(run.t) > 1 else 1.0
        self.recording.follow(float(run.t[rows[0]]) - self.origin, interval, len(rows) - 1)
        for number, row in enumerate(rows):
            self.recording.show(number, lambda needs, row=row: self._frame(part, row, needs))

    def _frame(self, part: SwingPart, row: int, needs: frozenset[str]) -> dict[tuple[str, str], NDArray]:
        """Arrays of a frame as an `Output` has them: bodies without vibration, and nothing touches."""
        motion, model, placed = part.motion, self.model, part.placements(row)
        x, v, rest = np.zeros_like(model.X), np.zeros_like(model.X), motion.rest or _no_stress(len(model.X))
        stress = rest.stress.copy()
        for name, mesh in self.setup.meshes.items():
            own = slice(model.node_start[name], model.node_start[name] + len(mesh.points))
            x[own], v[own] = placed[name].place(motion.points(name, mesh.points))
            if name in rest.rotations:
                stress[own] = _turned(stress[own], placed[name].rotation @ rest.rotations[name].T)
        shown = {"von_mises": rest.von_mises, "plastic_strain": rest.plastic_strain}
        skin = np.concatenate([surface.nodes for surface in self.surfaces.values()])
        probes = sum(len(position) for position in self.recording.info.paths.values())
        volume = {"displacement": x - model.X, "velocity": v, "stress": stress, **shown}
        fields: dict[str, dict[str, NDArray]] = {
            SURFACE: {"points": x[skin], **{name: field[skin] for name, field in shown.items()}},
            CONTACT: {"points": np.zeros((0, 3)), "state": np.zeros(0, dtype=np.int32)},
            PATHS: {"von_mises": np.zeros(probes)},
            VOLUME: volume,
        }
        wanted = ((need, name, field) for need in needs for name, field in fields[need].items())
        return {(need, name): field if need == CONTACT else field.astype(np.float32) for need, name, field in wanted}


def _no_stress(count: int) -> Stress:
    """What recorders show of bodies of so many nodes that nothing has deformed."""
    none = np.zeros(count, dtype=np.float32)
    return Stress(stress=np.zeros((count, 6), dtype=np.float32), von_mises=none, plastic_strain=none, rotations={})


def _turned(stress: NDArray[np.float32], rotation: Array) -> NDArray[np.float32]:
    """R s R^T of tensors with components xx, yy, zz, xy, yz, xz, shape (count, 6)."""
    turned = rotation @ stress[:, COMPONENTS] @ rotation.T
    return np.asarray(turned[:, (0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2)], dtype=np.float32)
