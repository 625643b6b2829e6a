"""Owns the masses in the summary of a run: those of bodies, how far meshes miss them, and what mass scaling added."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.geometry.quality import volumes
from warp_mca.geometry.shape_volume import of_cells
from warp_mca.model.mass_scaling import added_shares, peak_error, striking_body
from warp_mca.physics.elements.cells import densities

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Body, PointMass, Scene
    from warp_mca.system.model import Model


def body_report(
    bodies: Sequence[Body], meshes: Mapping[str, Mesh], points: Sequence[PointMass] = ()
) -> dict[str, dict[str, float | None]]:
    """Mass [kg] of each body, without what mass scaling adds, and error [-] of the mass of its cells, by its name.

    The error is None where nothing is known of the shape that the mesh stands for, and where the mass is given.
    `points` count as mass alone. Where a body has places of finer cells, the least size of these is there [m].
    """
    found: dict[str, dict[str, float | None]] = {}
    for body in bodies:
        mesh = meshes[body.name]
        mass = densities(body, mesh) * volumes(mesh)
        ratio = of_cells(mesh)
        cells, shape = (mass / ratio, mass) if body.exact_mass else (mass, mass * ratio)
        error = float(cells.sum() / shape.sum()) - 1.0 if len(mesh.volume_ratio) else None
        carried = sum(item.mass for item in points if item.body == body.name)
        own, error = (float(mass.sum()), error) if body.mass is None else (body.mass, None)
        found[body.name] = {"mass": own + carried, "mass_error": error}
        if finer := getattr(body.geometry, "finer", ()):
            found[body.name]["finer_size"] = min(place.size for place in finer)
    return found


def mass_report(scene: Scene, model: Model) -> dict[str, object]:
    """Keys of the summary of a scene with mass scaling; none without.

    Args:
        scene: of the run.
        model: of that scene alone.
    """
    scaling = model.scaling
    if scaling is None:
        return {}
    shares = added_shares(scene, model.node_start, model.mass, scaling.added)
    speed = np.linalg.norm(model.V, axis=1)
    plain = model.mass - scaling.added

    def changed(power: int) -> float:
        """Change of the sum of m v^power at the start, as a share of it [-]; 0 at rest."""
        before = float(plain @ speed**power)
        return float(scaling.added @ speed**power) / before if before > 0.0 else 0.0

    body = striking_body(scene, shares)
    return {
        "mass_added": shares,
        "mass_scaling": {
            "asked": scene.impact.mass_scaling,
            "plain_stable_dt": scaling.plain_dt,
            "elements": scaling.elements,
            "greatest": max(shares.values()),
            "striking_body": body,
            "striking": shares[body],
            "momentum": changed(1),
            "kinetic_energy": changed(2),
            "F_n_first_peak": peak_error(scene, model.node_start, model.mass, scaling.added),
        },
    }
