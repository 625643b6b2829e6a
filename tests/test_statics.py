"""The static study of elements: stiffness by colours is that by columns, bars stretch and yield as they must."""

from __future__ import annotations

import json

import numpy as np
import pytest

import warp_mca as mca
from benchmarks.elements import STORE, measure, problems, render
from benchmarks.measurements import FOLDER
from warp_mca.physics.elements import ELEMENTS
from warp_mca.verify.case import Setup
from warp_mca.verify.small_meshes import Array, brick
from warp_mca.verify.statics import Imposed, Statics, area_shares, stiffness

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)


def shaken(x: Array) -> Array:
    """Inner nodes moved a little."""
    inside = (x > 1e-9).all(axis=1) & (x < [0.39, 0.29, 0.19]).all(axis=1)
    return x + 0.01 * inside[:, None] * np.random.default_rng(2).uniform(-1.0, 1.0, x.shape)


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_stiffness_by_colours_is_that_by_columns(element: str):
    """Also where averages over neighbours couple elements that share a node."""
    body = Imposed(
        Setup(element=element, precision="float64"), brick(element, (3, 2, 2), (0.4, 0.3, 0.2), shaken), STEEL
    )
    K, h = stiffness(body).toarray(), 1e-7
    for column in range(0, len(K), 5):
        u = np.zeros(len(K))
        u[column] = h
        way = u.reshape(-1, 3)
        slope = (body.nodal(body.settled(-way)) - body.nodal(body.settled(way))) / (2.0 * h)
        assert K[:, column] == pytest.approx(slope.ravel(), abs=1e-7 * np.abs(K).max())
    assert np.abs(K - K.T).max() < 1e-7 * np.abs(K).max()


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("element", list(ELEMENTS))
def test_a_bar_stretches_by_hooke(element: str, precision: str):
    statics = Statics(Setup(element=element, precision=precision), brick(element, (4, 2, 2), (0.4, 0.3, 0.2)), STEEL)
    X = statics.body.X
    far = X[:, 0] > 0.4 - 1e-9
    share = area_shares(statics.body.mesh, far)
    assert share.sum() == pytest.approx(0.06, rel=1e-12)
    given = np.zeros_like(X)
    given[far, 0] = 4e-4
    u = statics.solve(np.zeros_like(X), (X < 1e-9) | (far[:, None] & [True, False, False]), given)
    assert u == pytest.approx(X * [1e-3, -3e-4, -3e-4], abs={"mixed": 1e-9, "float64": 1e-13}[precision])


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_a_bar_pulled_far_beyond_yield_carries_its_yield_stress(element: str):
    metal = mca.J2Bilinear(E=1.0, nu=0.3, rho=1.0, sigma_y=1e-6, E_t=0.0)
    statics = Statics(Setup(element=element, precision="float64"), brick(element, (2, 1, 1), (0.4, 0.3, 0.2)), metal)
    far = statics.body.X[:, 0] > 0.4 - 1e-9
    held = (statics.body.X < 1e-9) | (far[:, None] & [True, False, False])
    force = statics.drive(held, np.outer(far, [5e-6 * 0.4, 0.0, 0.0]), increments=50)
    assert force[far, 0].sum() == pytest.approx(1e-6 * 0.06, rel=1e-4)


def test_page_is_rendered_from_what_was_stored():
    stored = json.loads(STORE.read_text(encoding="utf-8"))
    rows = [row for _, rows, _ in problems() for row in rows.split("|")]
    assert len(set(rows)) == len(rows)
    assert list(stored) == list(ELEMENTS)
    assert all(list(found) == rows for found in stored.values())
    assert (FOLDER / "elements.md").read_text(encoding="utf-8") == render()


def test_command_measures_every_row(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("benchmarks.elements.problems", lambda: [p for p in problems() if "cells 1.6 : 1" in p[1]][:1])
    found = measure("hex8i")
    assert found == {"cells 1.6 : 1": pytest.approx(0.0, abs=2e-3)}
