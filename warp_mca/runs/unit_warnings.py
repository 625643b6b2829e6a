"""Owns the warning about parts whose size, weight, density or stable step says that another unit was meant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.geometry import Cad, Mesh, MeshFile
from warp_mca.geometry.quality import volumes

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Body, Scene

LONGEST, SHORTEST = 10.0, 1e-4  # m; parts that explicit finite elements are run on lie between
HEAVIEST = 1e5  # kg
LONGEST_STEP = 1e-4  # s; sound crosses half a metre of steel meanwhile
LIGHTEST = 1e-2  # kg/m^3, a hundredth of air; steel in tonne/mm^3 has 8e-9


def unit_warnings(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> list[str]:
    """One sentence for each body from a file whose figures say another unit than the metre, or density than kg/m^3.

    Args:
        scene: the scene.
        meshes: of its bodies, by name.
        model: assembled of them.
    """
    found = []
    slow = model.stable.dt > LONGEST_STEP
    for body in scene.bodies:
        if not isinstance(body.geometry, Cad | MeshFile | Mesh):
            continue
        mesh = meshes[body.name]
        size, densities = float(np.ptp(mesh.points, axis=0).max()), _densities(body)
        mass = max(densities) * float(volumes(mesh).sum())
        what = f"body {body.name} is {size:.3g} m long and weighs {mass:.3g} kg"
        if min(densities) < LIGHTEST:
            found.append(f"{what} at {min(densities):.3g} kg/m^3: give density in kg/m^3 and stress in Pa")
        elif size > LONGEST or mass > HEAVIEST or (slow and size > 1.0):
            found.append(
                f"{what}, and the stable step is {model.stable.dt:.2g} s: if its file counts in millimetres, give "
                "scale=1e-3"
            )
        elif size < SHORTEST:
            found.append(f"{what}: its scale makes it smaller than a tenth of a millimetre; check it")
    return found


def _densities(body: Body) -> list[float]:
    materials = body.material.values() if isinstance(body.material, Mapping) else [body.material]
    return [material.rho for material in materials]
