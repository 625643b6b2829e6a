"""Owns the way from a scene to the start of its impact phase: meshes, rigid phase, model, probes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.mesh import Mesh
from warp_mca.model.build import Grouping, build_model
from warp_mca.model.model import Model
from warp_mca.model.paths import Found, Probes, locate
from warp_mca.model.sensors import NO_SENSORS, Sensors, locate_sensors
from warp_mca.phases.arguments import Progress
from warp_mca.phases.meshing import mesh
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handoff import HandOff, hand_off
from warp_mca.scene import Scene
from warp_mca.watch.table import told_before


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
    """

    scene: Scene
    meshes: Mapping[str, Mesh]
    start: HandOff
    model: Model
    probes: Probes
    sensors: Sensors = NO_SENSORS
    warnings: tuple[str, ...] = ()


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


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A scene with its meshes, and where its bodies stand when finite elements take over.

    Attributes:
        scene: as it was asked for.
        meshes: of its bodies, by name.
        masses: lumped nodal masses [kg] by body, each shape (node_count,), float64; none without a rigid phase.
        sensors: its probes and sections.
        start: the hand-off.
        places: of paths that were found so far, see `locate`.
    """

    scene: Scene
    meshes: Mapping[str, Mesh]
    masses: Mapping[str, NDArray[np.float64]]
    sensors: Sensors
    start: HandOff
    places: Found = field(default_factory=dict)

    def ready(
        self,
        X: Mapping[str, NDArray[np.float64]],
        V: Mapping[str, NDArray[np.float64]],
        time: float = 0.0,
        *,
        start: HandOff | None = None,
        grouping: Grouping | None = None,
        watched: Sequence[tuple[str, int]] = (),
        said: bool = True,
    ) -> Prepared:
        """Assemble the model of bodies with these positions [m] and velocities [m/s], at a time from the release [s].

        Args:
            X, V: of the nodes by body, each shape (node_count, 3), float64.
            time: from the release [s].
            start: what results say of the hand-off, if not that of this scene.
            grouping, watched: as in `build_model`.
            said: whether its meshes are warned of.

        Raises:
            RequestError: the scene cannot be built as written.
        """
        scene, meshes = self.scene, self.meshes
        model = build_model(scene, meshes, X, V, watched, chain=self.start.chain, start=time, grouping=grouping)
        probes = locate(scene, model, meshes, self.places)
        warnings = told_before(scene, meshes, model) if said else ()
        return Prepared(scene, meshes, start or self.start, model, probes, self.sensors, warnings)


def place(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    clock: Clock,
    tell: Progress,
    *,
    by: Callable[..., HandOff] = hand_off,
    found: Found | None = None,
    made: dict[object, Mesh] | None = None,
) -> Placed:
    """Mesh a scene, unless its `meshes` are given, and place its bodies `by` a hand-off.

    `found` as in `locate`, `made` as in `mesh`.

    Raises:
        RequestError: the scene cannot be meshed, or does not swing as written.
    """
    tell("mesh", 0.0)
    meshes = mesh(scene, made, meshes)
    masses = nodal_masses(scene, meshes) if scene.rigid else {}
    clock.lap("mesh")
    tell("rigid", 0.0)
    start = by(scene, meshes, masses)
    clock.lap("rigid")
    sensors = locate_sensors(scene, meshes)
    return Placed(
        scene=scene, meshes=meshes, masses=masses, sensors=sensors, start=start, places={} if found is None else found
    )


def prepare(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    clock: Clock,
    tell: Progress,
    found: Found | None = None,
    made: dict[object, Mesh] | None = None,
    grouping: Grouping | None = None,
) -> Prepared:
    """A scene at its first touch, or where its bodies start without a rigid phase; arguments as in `place` and `ready`.

    Raises:
        RequestError: the scene cannot be built as written.
    """
    placed = place(scene, meshes, clock, tell, found=found, made=made)
    start = placed.start
    ready = placed.ready(start.positions, start.velocities, start.t_contact or 0.0, grouping=grouping)
    clock.lap("mesh")
    return ready
