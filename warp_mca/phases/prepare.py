"""Owns the way from a scene to the start of its impact phase: meshes, rigid phase, model, probes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.mesh import Mesh
from warp_mca.model.build import build_model
from warp_mca.model.paths import Probes, locate
from warp_mca.model.sensors import NO_SENSORS, Sensors, locate_sensors
from warp_mca.phases.arguments import Progress
from warp_mca.phases.meshing import mesh
from warp_mca.phases.rate_groups import grouping
from warp_mca.phases.settings import Settings
from warp_mca.phases.stress_rows import Room
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.body_motion import held_axes
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.handoff import HandOff, hand_off
from warp_mca.rigid.placement import Placement
from warp_mca.scene import RigidPhase, Scene, Surface
from warp_mca.system.model import Model
from warp_mca.system.precision import check_range
from warp_mca.watch.table import told_before

if TYPE_CHECKING:
    from warp_mca.phases.checkpoint import Checkpoint
    from warp_mca.phases.motion import Motion
    from warp_mca.recorders.recorder import Recorder
    from warp_mca.watch.held import Home
    from warp_mca.watch.skins import Skin


@dataclass(frozen=True)
class Prepared:
    """A scene at the start of its impact phase.

    Attributes:
        scene: as it was asked for.
        meshes: of its bodies, by name.
        start: the hand-off.
        model: assembled.
        probes: of its paths.
        sensors: its probes and sections.
        warnings: what is told before the run.
        skins: of its bodies, as `skins_of`; empty where the impact makes them.
        home: where a helper holds it, too; None without one.
        masses: what `body_report` says of its bodies, where it was computed.
        room: gives memory for its rows of stress; None where they get it as they come.
    """

    scene: Scene
    meshes: Mapping[str, Mesh]
    start: HandOff
    model: Model
    probes: Probes
    sensors: Sensors = NO_SENSORS
    warnings: tuple[str, ...] = ()
    skins: Sequence[Skin] = ()
    home: Home | None = None
    masses: Mapping[str, Mapping[str, float | None]] | None = None
    room: Room | None = None

    def stress_room(self) -> NDArray[np.float32] | None:
        """Memory for first rows of its stress [Pa], shape (row_count, probe_count, 6), float32, where there is some."""
        return self.room.take(len(self.probes.corner)) if self.room else None

    def with_model(self, model: Model) -> Prepared:
        """With other passes of contact; it has no home where one is another, or becomes another in the run."""
        passes = [id(item) for item in self.model.passes]
        same = passes == [id(item) for item in model.passes] and not model.fails
        return replace(self, model=model, home=self.home if same else None)


@dataclass
class Clock:
    """Wall-clock seconds by stage, `wall`, and when the `last` one ended."""

    wall: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("rigid", "mesh", "compile", "fe", "output"), 0.0)
    )
    last: float = field(default_factory=time.perf_counter)

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self.wall[stage] += now - self.last
        self.last = now

    def share(self, stages: Mapping[str, float]) -> None:
        """Count the time since the last lap to stages in proportion to these numbers."""
        now, whole = time.perf_counter(), sum(stages.values())
        for stage, part in stages.items():
            self.wall[stage] += (now - self.last) * part / whole
        self.last = now


@dataclass(frozen=True, kw_only=True)
class Request:
    """How scenes are run, and who is told.

    Attributes:
        span: time that an impact lasts, the longest with `t_end` [s].
        settings: device, precision, threads, groups of elements.
        tell: told of stages.
        recorders: of a lone scene.
        store: where a lone scene stores its state, and from which it goes on; None for never.
        number: of the impact in a run of several, see `Course`; None in a run of one.
        clock: wall time by stage.
        begun: told of the scene, its model and its meshes by body, each time a model is assembled.
        paths: whether stress along paths is recorded, on which no figure and no warning depends.
    """

    span: float
    settings: Settings
    tell: Progress = lambda stage, done: None
    recorders: Sequence[Recorder] = ()
    store: Checkpoint | None = None
    number: int | None = None
    clock: Clock = field(default_factory=Clock)
    begun: Callable[[Scene, Model, Mapping[str, Mesh]], None] = lambda scene, model, meshes: None
    paths: bool = True


@dataclass(frozen=True, kw_only=True)
class Setup:
    """A scene with its meshes, and where its bodies stand when finite elements take over.

    Attributes:
        scene: as it was asked for.
        meshes: of its bodies, by name.
        masses: lumped nodal masses [kg] by body, each shape (node_count,), float64; none without a rigid phase.
        sensors: its probes and sections.
        start: the hand-off.
        request: how it is run.
    """

    scene: Scene
    meshes: Mapping[str, Mesh]
    masses: Mapping[str, Array]
    sensors: Sensors
    start: HandOff
    request: Request

    def ready(
        self,
        X: Mapping[str, Array],
        V: Mapping[str, Array],
        time: float = 0.0,
        *,
        start: HandOff | None = None,
        watched: Sequence[tuple[str, int]] = (),
        said: bool = True,
    ) -> Prepared:
        """Assemble the model of bodies with these positions [m] and velocities [m/s], at a time from the release [s].

        Args:
            X, V: of the nodes by body, each shape (node_count, 3), float64.
            time: from the release [s].
            start: what results say of the hand-off, if not that of this scene.
            watched: as in `build_model`.
            said: whether its meshes are warned of.

        Raises:
            RequestError: the scene cannot be built as written.
        """
        scene, meshes, settings, span = self.scene, self.meshes, self.request.settings, self.request.span
        if scene.t_end is not None:
            span = min(span, scene.t_end - time)
        groups = grouping(scene, span, settings.device, settings.multi_rate)
        model = build_model(scene, meshes, X, V, watched, chain=self.start.chain, start=time, grouping=groups)
        probes = locate(scene, model, meshes)
        warnings = told_before(scene, meshes, model) if said else ()
        check_range(model, settings.precision)
        self.request.begun(scene, model, meshes)
        self.request.clock.lap("mesh")
        return Prepared(scene, meshes, start or self.start, model, probes, self.sensors, warnings)

    @property
    def rigid(self) -> RigidPhase:
        """The rigid phase."""
        assert self.scene.rigid is not None
        return self.scene.rigid

    @property
    def t_end(self) -> float:
        """Time from the release at which the run ends [s]."""
        assert self.scene.t_end is not None
        return self.scene.t_end

    @property
    def chain(self) -> Chain:
        """Rigid links, without deformation."""
        assert self.start.chain is not None
        return self.start.chain

    @cached_property
    def held(self) -> Mapping[str, NDArray[np.bool_]]:
        """Axes of nodes that are fixed, by body, each shape (node_count, 3), bool."""
        return held_axes(self.scene, self.meshes)

    def others(self, placements: Mapping[str, Placement]) -> float:
        """Kinetic energy of the bodies that are no links [J]."""
        links = {link.body for link in self.chain.links}
        moving = {name: p.place(self.meshes[name].points)[1] for name, p in placements.items() if name not in links}
        return float(sum(0.5 * self.masses[name] @ (V**2).sum(axis=1) for name, V in moving.items()))

    def slaves(self) -> dict[str, NDArray[np.int32]]:
        """Nodes of each link that a contact keeps out of the target."""
        target, found = self.rigid.target, {}
        for slave, master in self.scene.surface_pairs():
            sides = [(slave, master)]
            if isinstance(master, Surface):
                sides.append((master, slave))
            for own, other in sides:
                meets = other == target or (
                    isinstance(other, Surface) and isinstance(target, Surface) and other.body == target.body
                )
                if meets and isinstance(own, Surface):
                    nodes = np.unique(self.meshes[own.body].surface(own.nodes)[0])
                    found[own.body] = np.union1d(found.get(own.body, nodes), nodes)
        return found

    def kinetic(self, V: Mapping[str, Array]) -> float:
        """Kinetic energy of the nodes [J]."""
        return float(sum(0.5 * self.masses[name] @ (v**2).sum(axis=1) for name, v in V.items()))

    def carriage_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the carriage [J]."""
        _, velocities = self.chain.moved_to(motion.t).hinges(motion.theta, motion.theta_dot)
        return float(0.5 * self.chain.carriage_mass * (velocities[0] ** 2).sum())

    def rigid_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the chain and the other bodies [J]."""
        chain = motion.chain.moved_to(motion.t)
        return chain.kinetic_energy(motion.theta, motion.theta_dot) + self.others(motion.placements)

    def link_ends(self, name: str) -> tuple[int, int]:
        """Nodes of a link whose motion tells its angle: at its inbound hinge, and farthest from it."""
        link = next(link for link in self.chain.links if link.body == name)
        away = np.linalg.norm(self.meshes[name].points[:, :2] - np.asarray(link.hinge_in), axis=1)
        return int(away.argmin()), int(away.argmax())


def place(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    request: Request,
    *,
    by: Callable[..., HandOff] = hand_off,
    made: dict[object, Mesh] | None = None,
) -> Setup:
    """Mesh a scene, unless its `meshes` are given, and place its bodies `by` a hand-off.

    `made` as in `mesh`.

    Raises:
        RequestError: the scene cannot be meshed, or does not swing as written.
    """
    request.tell("mesh", 0.0)
    meshes = mesh(scene, {} if made is None else made, meshes)
    masses = nodal_masses(scene, meshes) if scene.rigid else {}
    request.clock.lap("mesh")
    request.tell("rigid", 0.0)
    start = by(scene, meshes, masses)
    request.clock.lap("rigid")
    own = {"scene": scene, "meshes": meshes, "masses": masses, "start": start, "request": request}
    return Setup(**own, sensors=locate_sensors(scene, meshes))


def prepare(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    request: Request,
    made: dict[object, Mesh] | None = None,
) -> Prepared:
    """A scene at its first touch, or where its bodies start without a rigid phase; arguments as in `place`.

    Raises:
        RequestError: the scene cannot be built as written.
    """
    setup = place(scene, meshes, request, made=made)
    start = setup.start
    return setup.ready(start.positions, start.velocities, start.t_contact or 0.0)
