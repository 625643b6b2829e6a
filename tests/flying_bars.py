"""Two bars in free flight, for tests of recorders without a run: what a recorder is told, and its frames."""

from __future__ import annotations

from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.model.build import build_model
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.recorders.frames import skins
from warp_mca.recorders.recorder import Frame, RunInfo, Volume
from warp_mca.rigid.handoff import hand_off

DT = 1.4e-9  # rerun stores whole nanoseconds
STEPS = 1000  # between two frames


class FlyingBars:
    """Two elastic bars side by side that fly along x; stress grows with time. Options are those of the scene.

    Attributes:
        info: of the run.
        said: warnings that recorders gave.
    """

    def __init__(self, **options: Any) -> None:
        steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
        box = mca.Box(size=(0.1, 0.01, 0.01), divisions=(10, 1, 1))
        one, other = (
            mca.Body(name=name, geometry=box, material=steel, position=at, velocity=(3.0, 0.0, 0.0))
            for name, at in (("upper bar", (0.0, 0.02, 0.0)), ("lower", (0.0, 0.0, 0.0)))
        )
        options = {"name": "bars", **options}
        scene = mca.Scene(bodies=(one, other), impact=mca.ImpactPhase(duration=1e-5), **options)
        meshes = mca.mesh(scene)
        start = hand_off(scene, meshes, nodal_masses(scene, meshes))
        model = build_model(scene, meshes, start.positions, start.velocities)
        self.said: list[str] = []
        self.info = RunInfo(
            scene=scene,
            model=model,
            surfaces=skins(model, meshes),
            paths={"Path 1": np.linspace(0.0, 0.1, 11)},
            dt=DT,
            output_interval=1e-6,
            duration=1e-5,
            warn=self.said.append,
        )

    def positions(self, step: int) -> np.ndarray:
        """Of all nodes [m] after `step` steps."""
        return self.info.model.X + step * DT * self.info.model.V

    def frame(self, index: int) -> Frame:
        """The bars after `index` times STEPS steps."""
        step = STEPS * index
        X = self.positions(step)
        points = {body: X[surface.nodes].astype(np.float32) for body, surface in self.info.surfaces.items()}
        count = len(X)
        return Frame(
            index=index,
            step=step,
            time=step * DT,
            points=points,
            von_mises={body: np.full(len(x), 1e6 * index, dtype=np.float32) for body, x in points.items()},
            plastic_strain={body: np.full(len(x), 1e-3 * index, dtype=np.float32) for body, x in points.items()},
            contact_points=X[: index % 3].astype(np.float32),
            contact_stick=np.array([True, False][: index % 3]),
            path_stress={"Path 1": np.linspace(0.0, 1e6 * index, 11, dtype=np.float32)},
            volume=Volume(
                displacement=(X - self.info.model.X).astype(np.float32),
                velocity=self.info.model.V.astype(np.float32),
                stress=np.outer(np.arange(count), [1, 0, 0, 0, 0, 0]).astype(np.float32) * np.float32(1e6 * index),
                von_mises=(1e6 * index * np.arange(count)).astype(np.float32),
                plastic_strain=np.full(count, 1e-3 * index, dtype=np.float32),
            ),
        )
