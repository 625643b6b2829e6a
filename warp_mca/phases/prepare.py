"""Owns the way from a scene to the start of its impact phase: meshes, rigid phase, model, probes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

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


def prepare(
    scene: Scene,
    meshes: Mapping[str, Mesh] | None,
    clock: Clock,
    tell: Progress,
    found: Found | None = None,
    made: dict[object, Mesh] | None = None,
    grouping: Grouping | None = None,
) -> Prepared:
    """Mesh a scene, unless its `meshes` are given, run its rigid phase and assemble its model.

    `found` as in `locate`, `made` as in `mesh`, `grouping` as in `build_model`.

    Raises:
        RequestError: the scene cannot be built as written.
    """
    tell("mesh", 0.0)
    meshes = mesh(scene, made, meshes)
    clock.lap("mesh")
    tell("rigid", 0.0)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes) if scene.rigid else {})
    clock.lap("rigid")
    X, V = start.positions, start.velocities
    model = build_model(scene, meshes, X, V, chain=start.chain, start=start.t_contact or 0.0, grouping=grouping)
    probes = locate(scene, model, meshes, found)
    clock.lap("mesh")
    sensors = locate_sensors(scene, meshes)
    return Prepared(scene, meshes, start, model, probes, sensors, told_before(scene, meshes, model))
