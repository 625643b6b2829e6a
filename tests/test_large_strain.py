"""Internal modes at large strain: a cube that is pulled or pressed explicitly stays homogeneous, whatever its mesh."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from impacts import finished, result_of
from test_elements import held_of

import warp_mca as mca
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quality import scaled_jacobian
from warp_mca.kernels.elements.hex8i_vectors import LOOSE

E, RHO, CELLS, SHAKE = 200e9, 8000.0, 3, 0.02  # SHAKE: of inner nodes, over the length of a cell


def cube() -> Mesh:
    """Of 1 m, its inner nodes shaken."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(CELLS,) * 3).build()
    inner = ((box.points > 1e-9) & (box.points < 1.0 - 1e-9)).all(axis=1)
    shake = SHAKE / CELLS * np.random.default_rng(5).uniform(-1.0, 1.0, box.points.shape)
    return dataclasses.replace(box, points=box.points + shake * inner[:, None])


def driven(element: str, material: mca.Elastic | mca.J2Bilinear, stretch: float) -> mca.Scene:
    """The cube between smooth plates, one of which moves at a hundredth of the speed of sound."""
    v = np.copysign(0.01 * np.sqrt(E / RHO), stretch - 1.0)
    duration = (stretch - 1.0) / v
    pulled = {"body": "cube", "nodes": "xmax", "axis": "x", "times": (0.0, 0.1 * duration)}
    return mca.Scene(
        name="cube",
        bodies=(mca.Body(name="cube", geometry=cube(), material=material, element=element, kinematics="finite"),),
        fixed=(mca.Fixed(body="cube", nodes="xmin", axes="x"),),
        prescribed=(mca.Prescribed(**pulled, velocities=(0.0, v / 0.95)),),
        impact=mca.ImpactPhase(
            duration=duration, output_interval=duration / 100.0, time_step_scale=0.25 if stretch < 1.0 else 0.6
        ),
    )


@pytest.mark.parametrize("stretch", [0.3, 3.0])
@pytest.mark.parametrize("nu", [0.3, 0.49])
@pytest.mark.parametrize("hardens", [False, True], ids=["elastic", "metal"])
@pytest.mark.parametrize("element", ["hex8i", "hex8w"])
def test_hourglass_motion_does_not_grow(element: str, hardens: bool, nu: float, stretch: float):
    """Nodes stay within 1.5 times the shaking of a linear field, cells as good as they were, and energy is kept.

    The metal hardens so much that it does not neck; a neck is no matter of elements.
    """
    common = {"E": E, "nu": nu, "rho": RHO}
    material = mca.J2Bilinear(**common, sigma_y=400e6, E_t=4e9) if hardens else mca.Elastic(**common)
    scene = driven(element, material, stretch)
    impact = finished(scene)
    X, u = impact.solver.model.X, impact.state.u.numpy()
    linear = np.column_stack([X, np.ones(len(X))])
    left = u - linear @ np.linalg.lstsq(linear, u, rcond=None)[0]
    assert np.ptp((X + u)[:, 0]) == pytest.approx(stretch, rel=3e-3)
    assert np.abs(left).max() < 1.5 * SHAKE / CELLS
    assert scaled_jacobian(dataclasses.replace(scene.bodies[0].geometry, points=X + u)).min() > 0.95
    energy = result_of(impact).summary["energy"]
    assert abs(energy["error"]) < 1e-4 * (energy["elastic"] + energy["plastic"])


def test_vectors_of_crushed_cells_that_flow_are_held():
    """Down to a fifth they follow what bends a cell; beyond a tenth, where the tangent modulus is below the stress,
    they keep to what they are."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    metal = mca.J2Bilinear(E=E, nu=0.3, rho=RHO, sigma_y=400e6, E_t=1e8)
    held, x = held_of(box, "hex8i", "finite", material=metal), box.points - 0.5
    first = 8 * 6
    moved = []
    for least in (0.25, 0.07):
        for height in np.geomspace(1.0 if least == 0.25 else 0.25, least, 400):
            held.forces(x * [height, height**-0.5, height**-0.5] - x)
        before = held.state.elements[0].history.numpy()[first : first + 9].copy()
        bend = np.outer(x[:, 0] * x[:, 1], [1.0, 0.0, 0.0])
        for k in range(10):
            held.forces(x * [least, least**-0.5, least**-0.5] - x + 1e-4 * k * bend)
        moved.append(np.abs(held.state.elements[0].history.numpy()[first : first + 9] - before).max())
        share = 1.0 - held.state.elements[0].history.numpy()[first + 9, 0]
        assert share == pytest.approx(1.0 if least == 0.25 else LOOSE)
    assert moved[1] < 0.1 * moved[0]
