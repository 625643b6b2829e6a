"""Owns what recorders see of a machine's run: its links at samples of each swing, and each impact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import mean_pose, mean_spin
from warp_mca.kernels.records.output import SLIP, STICK
from warp_mca.phases.division import divide
from warp_mca.recorders.frames import Recording, skins
from warp_mca.recorders.recorder import (
    CONTACT,
    PATHS,
    SURFACE,
    VOLUME,
    Cadence,
    Frame,
    FramesOnly,
    Recorder,
    RunInfo,
)
from warp_mca.robots.cast import Part, cast, parts_of, placed
from warp_mca.robots.machine import Machine
from warp_mca.scene import Body

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot
    from warp_mca.robots.swing import RobotSwing

Fields = Mapping[tuple[str, str], NDArray]


class RobotFilm:
    """The recorders of a machine's run. Times count from the first touch.

    Attributes:
        said: what they warned of.
        beside: bodies beside the machine at the start of the latest swing, by name.
        recording: what passes frames on to them.
    """

    def __init__(self, robot: Robot, machine: Machine, swing: RobotSwing, recorders: Sequence[Recorder], t_end: float):
        """Start the recorders of a run to t_end [s], whose first swing is over.

        Raises:
            RequestError: an output cannot be made, or a flexible link fails, whose surface a film does not follow.
        """
        for name, body in robot.flexible.items():
            if body.fails:
                remedy = "films of machines do not follow failing surfaces; record the scene of Robot.strike instead"
                raise bad_value(f"Robot.flexible[{name!r}].material", "failure", remedy)
        self.origin, self._machine = swing.t_end, machine
        machine.advance(np.concatenate([swing.qpos, swing.qvel, np.zeros(2)]))
        self.parts = parts_of(robot, machine)
        if not self.parts:
            raise bad_value("recorders", "given", "the machine has neither geoms nor flexible links to be drawn")
        ready = cast(robot, machine, self.parts, swing.t_end)
        self.model, self.said = ready.model, []
        self.surfaces = skins(ready.model, ready.meshes)
        self.needs: frozenset[str] = frozenset().union(*(recorder.needs for recorder in recorders))
        steps, length, told = divide(ready.scene, ready.model, 1e-3), t_end - self.origin, self.said.append
        info = RunInfo(ready.scene, ready.model, self.surfaces, {}, steps.dt, steps.interval, length, told, phases=True)
        self.recording = Recording(recorders, info, 0, steps.per_interval, None)

    def swing(self, robot: Robot, swing: RobotSwing, start: float, first: bool, following: bool) -> None:
        """Show a robot's swing that began at a time of the run [s]; an impact shows where it began, or follows."""
        self.beside = {item.name: item for item in robot.against if isinstance(item, Body)}
        rows = range(len(swing.t))[slice(0 if first else 1, -1 if following else None)]
        if not rows:
            return
        interval = float(swing.t[1] - swing.t[0]) if len(swing.t) > 1 else 1.0
        self.recording.follow(start + float(swing.t[rows[0]]) - self.origin, interval, len(rows) - 1)
        for number, row in enumerate(rows):
            self.recording.show(number, lambda _, row=row: self._swinging(swing, row))

    def impact(self, swing: RobotSwing, start: float) -> Recorder:
        """What records the impact after a swing that began at a time of the run [s]."""
        return _ImpactFilm(self, start + swing.t_end, self._place(swing, len(swing.t) - 1))

    def finish(self, ok: bool) -> None:
        """Close the recorders of a run that ended as it should, or did not."""
        self.recording.finish(ok)

    def _place(self, swing: RobotSwing, row: int) -> dict[str, tuple[Array, Array]]:
        """Positions [m] and velocities [m/s] of all parts at a sample of a swing."""
        machine = self._machine
        machine.advance(np.concatenate([swing.qpos_t[row], swing.qvel_t[row], np.zeros(2)]))
        now = [part._replace(beside=part.beside and self.beside[part.beside.name]) for part in self.parts]
        return {part.name: placed(part.mesh, part.motion(machine, float(swing.t[row]))) for part in now}

    def _swinging(self, swing: RobotSwing, row: int) -> Fields:
        x, v = np.zeros_like(self.model.X), np.zeros_like(self.model.X)
        for name, (points, rates) in self._place(swing, row).items():
            own = slice(self.model.node_start[name], self.model.node_start[name] + len(points))
            x[own], v[own] = points, rates
        return self.fields(x, v)

    def fields(self, x: Array, v: Array, stress: Mapping[str, NDArray] | None = None, touch: Fields | None = None):
        """Arrays of a frame as an `Output` has them: nodes at x [m] with v [m/s], unstressed if not given."""
        count = len(x)
        shown = {name: np.zeros(count) for name in ("von_mises", "plastic_strain")} | dict(stress or {})
        tensor = shown.pop("stress", np.zeros((count, 6)))
        skin = np.concatenate([surface.nodes for surface in self.surfaces.values()])
        volume = {"displacement": x - self.model.X, "velocity": v, "stress": tensor, **shown}
        found: dict[tuple[str, str], NDArray] = {(VOLUME, name): a.astype(np.float32) for name, a in volume.items()}
        found |= {(SURFACE, name): a[skin].astype(np.float32) for name, a in {"points": x, **shown}.items()}
        found[PATHS, "von_mises"] = np.zeros(0, np.float32)
        found |= {(CONTACT, "points"): np.zeros((0, 3)), (CONTACT, "state"): np.zeros(0, np.int32)}
        return found | dict(touch or {})


class _Rows(Cadence):
    """When a film wants frames of an impact: whenever one of its recorders does."""

    def __init__(self, film: RobotFilm, start: float) -> None:
        for name in ("frames", "seconds", "times"):
            object.__setattr__(self, name, None)
        object.__setattr__(self, "_film", (film, start))

    def rows(self, intervals: int, interval: float) -> NDArray[np.bool_]:
        """Which ends of output intervals are frames; the recorders go on with them."""
        film, start = self._film  # type: ignore[attr-defined]
        film.recording.follow(start - film.origin, interval, intervals)
        return np.any([rows for _, rows in film.recording.rows] or [np.zeros(intervals + 1, bool)], axis=0)


class _ImpactFilm(FramesOnly):
    """Shows frames of an impact's scene as those of the film.

    Flexible bodies are as the impact has them. Others, of which it may have other meshes or only a brick with their
    inertia, move as the nodes that it has of them.
    """

    name = "film"

    def __init__(self, film: RobotFilm, start: float, before: Mapping[str, tuple[Array, Array]]) -> None:
        """Of an impact that begins at a time of the run [s]; positions and velocities of all parts then."""
        self._film, self._start, self._before, self.cadence = film, start, before, _Rows(film, start)
        self.needs = frozenset({SURFACE, *film.needs} - {PATHS})

    def start(self, info: RunInfo) -> None:
        """Note the scene of the impact."""
        self._info = info

    def history(self, rows: Mapping[str, NDArray[np.float64]]) -> None:
        """Pass rows on, with the time of the run."""
        shifted = {**rows, "time_s": rows["time_s"] + self._start - self._film.origin}
        self._film.recording.history(lambda: shifted)

    def frame(self, frame: Frame) -> None:
        """Pass a frame on."""
        row = round(frame.time / self._info.output_interval)
        self._film.recording.show(row, lambda _: self._fields(frame))

    def _fields(self, frame: Frame) -> Fields:
        film, model = self._film, self._film.model
        x, v = np.zeros_like(model.X), np.zeros_like(model.X)
        shown = {"von_mises": np.zeros(len(x)), "plastic_strain": np.zeros(len(x)), "stress": np.zeros((len(x), 6))}
        for part in film.parts:
            own = slice(model.node_start[part.name], model.node_start[part.name] + len(part.mesh.points))
            points, rates = self._before[part.name]
            if part.deforms:
                x[own], v[own] = points, rates
                self._deformed(part, frame, own.start, (x, v), shown)
            else:
                x[own], v[own] = self._moved(part, frame, points, rates)
        points = frame.contact_points
        touch = {(CONTACT, "points"): points, (CONTACT, "state"): np.where(frame.contact_stick, STICK, SLIP)}
        return film.fields(x, v, shown, touch)

    def _deformed(
        self, part: Part, frame: Frame, first: int, nodes: tuple[Array, Array], shown: dict[str, NDArray]
    ) -> None:
        """Take positions and stresses of a flexible body: on its skin, or everywhere if they are there."""
        skin = self._info.surfaces[part.name].nodes - self._info.model.node_start[part.name] + first
        nodes[0][skin] = frame.points[part.name]
        for name in ("von_mises", "plastic_strain"):
            shown[name][skin] = getattr(frame, name)[part.name]
        if frame.volume is not None:
            there = self._info.model.node_start[part.name] + np.arange(len(part.mesh.points))
            here = first + np.arange(len(there))
            nodes[0][here] = self._info.model.X[there] + frame.volume.displacement[there]
            nodes[1][here] = frame.volume.velocity[there]
            for name in ("stress", "von_mises", "plastic_strain"):
                shown[name][here] = getattr(frame.volume, name)[there]

    def _moved(self, part: Part, frame: Frame, points: Array, rates: Array) -> tuple[Array, Array]:
        """Positions and velocities of a rigid body that the impact moves; as they were of one that it does not have."""
        surface = self._info.surfaces.get(part.name)
        if surface is None:
            return points, rates
        X, x = self._info.model.X[surface.nodes], np.asarray(frame.points[part.name], dtype=np.float64)
        weights = np.ones(len(X))
        before, after, turned = mean_pose(X, x, weights)
        moved = after + (points - before) @ turned.T
        if frame.volume is None:
            return moved, rates
        own = np.asarray(frame.volume.velocity[surface.nodes], dtype=np.float64)
        return moved, own.mean(axis=0) + np.cross(mean_spin(x, own, weights), moved - after)
