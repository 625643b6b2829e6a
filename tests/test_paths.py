"""Probes of a path: the cell around each point, its weights there, and points that lie outside."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.model.build import build_model
from warp_mca.model.paths import Probes, locate
from warp_mca.verify.small_meshes import mixed_cube

STEEL = mca.Elastic(E=2e11, nu=0.3, rho=7850.0)


def probes(mesh: mca.Mesh, start: tuple, end: tuple, spacing: float = 0.03) -> Probes:
    """Those of a line through one body."""
    line = mca.Line(body="it", start=start, end=end)
    scene = mca.Scene(
        name="one",
        bodies=(mca.Body(name="it", geometry=mesh, material=STEEL),),
        paths=(mca.Path(name="path", lines=(line,), spacing=spacing),),
        impact=mca.ImpactPhase(duration=1e-6),
    )
    meshes = {"it": mesh}
    model = build_model(scene, meshes, {"it": mesh.points}, {"it": np.zeros_like(mesh.points)})
    return locate(scene, model, meshes)


def bent(divisions: tuple[int, int, int]) -> mca.Mesh:
    """A unit cube whose inner nodes are moved."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=divisions).build()
    inner = ((box.points > 0.0) & (box.points < 1.0)).all(axis=1)
    move = np.random.default_rng(0).uniform(-0.1, 0.1, box.points.shape) / np.array(divisions)
    return dataclasses.replace(box, points=box.points + move * inner[:, None])


MESHES = {
    "cells": bent((6, 5, 7)),
    "long cells": bent((1, 9, 40)),
    "mixed": mixed_cube(),
    "tetrahedra": tetrahedral(mixed_cube()),
}
LINES = {
    "inside": ((0.05, 0.9, 0.1), (0.9, 0.2, 0.95)),
    "along an axis": ((0.0, 0.3, 0.4), (1.0, 0.3, 0.4)),
    "edge": ((0.0, 1.0, 0.0), (0.0, 1.0, 1.0)),
}


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("mesh", MESHES)
def test_weights_give_the_point_back(mesh: str, line: str):
    start, end = (np.array(p) for p in LINES[line])
    found = probes(MESHES[mesh], *LINES[line])
    along = found.position["path"] / np.linalg.norm(end - start)
    at = start + along[:, None] * (end - start)
    np.testing.assert_allclose(np.einsum("pa,pai->pi", found.weight, MESHES[mesh].points[found.corner]), at, atol=1e-9)
    np.testing.assert_allclose(found.weight.sum(axis=1), 1.0, rtol=1e-12)
    assert found.weight.min() > -1e-9


@pytest.mark.parametrize("mesh", MESHES)
def test_a_line_that_leaves_the_body_is_refused(mesh: str):
    for start, end in (((0.5, 0.5, 0.5), (0.5, 1.5, 0.5)), ((2.0, 0.5, 0.5), (2.0, 0.6, 0.5))):
        far = max(start[0] - 1.0, end[1] - 1.0)
        with pytest.raises(mca.RequestError, match=f"Path path.lines.* {far:.3g} m outside the body"):
            probes(MESHES[mesh], start, end)


def test_a_line_just_outside_takes_the_nearest_cell():
    """As on curved surfaces, whose faces are flat: the place in the cell is off by a tenth of the distance at most."""
    found = probes(MESHES["cells"], (0.1, 1.002, 0.3), (0.9, 1.002, 0.3))
    place = np.einsum("pa,pai->pi", found.weight, MESHES["cells"].points[found.corner])
    np.testing.assert_allclose(place[:, 1], 1.0, atol=1e-12)
    np.testing.assert_allclose(place[:, 0], 0.1 + found.position["path"], atol=2e-4)


def test_more_probes_than_a_line_can_have_are_refused():
    cube = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    with pytest.raises(RequestError, match=r"Path path\.spacing = 1e-14: a line of 1 m would have 1e"):
        probes(cube, (0.0, 0.5, 0.5), (1.0, 0.5, 0.5), spacing=1e-14)
