"""Elements of the user's own with any number of integration points: each has rows of the history, none has others'."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from impacts import begun, finished, result_of
from linear_tet import LinearTet
from linear_tet_kernels import formulation

import warp_mca as mca
from warp_mca.kernels.elements.formulation import Formulation, force_kernel
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.kernels.materials.laws import FLOW_HISTORY, row_count
from warp_mca.physics.elements.stage import ElementStage

METAL = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=50e6, E_t=1e9)
LAST = 8  # point that flows
HISTORY_SIZE = row_count(FLOW_HISTORY)


@wp.func
def last_place(g: int):
    return LAST


def last_point(precision: str, law_name: str, finite: bool) -> Formulation:
    """`linear_tet`, whose history is that of point LAST."""
    return replace(formulation(precision, law_name, finite), place=last_place)


KERNELS = SimpleNamespace(
    force_kernel=partial(force_kernel, last_point),
    energy_kernel=partial(energy_kernel, last_point),
    stress_kernel=partial(stress_kernel, last_point),
)


def scene(register: Callable[..., object], points: int) -> mca.Scene:
    """A bar that flows where it strikes a wall, of elements with so many points."""

    class Own(LinearTet):
        name = f"own{points}"

        def stage(self, block, X, precision):
            return ElementStage(block, precision, KERNELS, points=points)

    register(Own())
    box = mca.Box(size=(0.02, 0.005, 0.005), divisions=(8, 2, 2))
    bar = mca.Body(name="bar", geometry=box, material=METAL, element=Own.name, velocity=(30.0, 0.0, 0.0))
    wall = mca.RigidPlane(point=(0.02, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall)
    impact = mca.ImpactPhase(duration=6e-6, output_interval=1e-6)
    return mca.Scene(name="bar", bodies=(bar,), contacts=(contact,), impact=impact)


def test_a_point_has_rows_of_its_own(register: Callable[..., object]):
    """However many points there are besides; all that reads the history finds it there."""
    impacts = [finished(scene(register, points)) for points in (LAST + 1, 27)]
    summaries = [result_of(impact).summary for impact in impacts]
    first, second = (impact.state.elements[0].history.numpy() for impact in impacts)
    rows = slice(LAST * HISTORY_SIZE, (LAST + 1) * HISTORY_SIZE)
    assert len(first) == rows.stop and len(second) == 27 * HISTORY_SIZE
    assert not np.delete(first, np.r_[rows], axis=0).any() and not np.delete(second, np.r_[rows], axis=0).any()
    assert np.array_equal(first[rows], second[rows])
    assert summaries[0]["max_plastic_strain"] == first[-1].max() > 1e-3
    assert summaries[1]["max_plastic_strain"] == first[-1].max()
    assert summaries[0]["energy"] == summaries[1]["energy"]
    assert summaries[0]["energy"]["plastic"] > 0.0 and summaries[0]["energy_error"] < 1e-2


@pytest.mark.parametrize("points", [1, LAST])
def test_a_point_without_rows_stops_the_run(points: int, register: Callable[..., object]):
    with pytest.raises(mca.GuardError, match="not a number"):
        mca.run(scene(register, points))


def test_plastic_strains_of_all_points_turn_with_the_element(register: Callable[..., object]):
    """A quarter turn about z exchanges xx and yy, and yz takes the place of xz."""
    stage = begun(scene(register, 3)).solver.elements[0]
    history = np.arange(1.0, 3.0 * HISTORY_SIZE + 1.0)[:, None] * [[1.0, 2.0]]
    turned = stage.rotated(history, np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]] * 2))
    xx, yy, xy, yz, xz, p = history.reshape(3, HISTORY_SIZE, 2).transpose(1, 0, 2)
    expected = np.stack([yy, xx, -xy, xz, -yz, p], axis=1).reshape(history.shape)
    np.testing.assert_allclose(turned, expected, atol=1e-12)
