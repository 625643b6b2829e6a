"""Owns the tests of what results of a batch read from the device: each array once, however many scenes there are."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import warp as wp

import warp_mca as mca
from warp_mca.system.reading import on_host, read_once


def fallen(count: int) -> list[mca.Scene]:
    """Boxes, a rigid one on each, that hit a plane with different speeds."""
    steel = mca.J2Bilinear(E=2e11, nu=0.3, rho=7850.0, sigma_y=3e8, E_t=2e9)
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    at = {"geometry": box, "material": steel, "velocity": (0.0, -1.0, 0.0)}
    low, high = mca.Surface(body="low", nodes="ymax"), mca.Surface(body="high", nodes="ymin")
    scene = mca.Scene(
        name="boxes",
        bodies=(mca.Body(name="low", **at), mca.Body(name="high", position=(0.0, 0.01, 0.0), rigid=True, **at)),
        contacts=(
            mca.Contact(slave=mca.Surface(body="low", nodes="ymin"), master=mca.RigidPlane(normal=(0.0, 1.0, 0.0))),
            mca.Contact(slave=low, master=high),
        ),
        impact=mca.ImpactPhase(duration=2e-6),
    )
    return [scene] * count


def test_an_array_is_read_once_and_anew_afterwards():
    array = wp.zeros(3, dtype=float, device="cpu")
    with read_once():
        first = on_host(array)
        assert on_host(array) is first and on_host(wp.ones(3, dtype=float, device="cpu"))[0] == 1.0
    array.fill_(2.0)
    np.testing.assert_array_equal(on_host(array), 2.0)


def test_results_of_more_scenes_read_no_more_arrays(monkeypatch):
    """On a GPU each reading takes the whole array, of all scenes, to the host."""
    numpy, read = wp.array.numpy, Counter()

    def counted(self: wp.array) -> np.ndarray:
        read[len(scenes)] += self.size >= 8 * len(scenes)  # elements of a scene
        return numpy(self)

    @contextmanager
    def watched() -> Iterator[None]:
        with monkeypatch.context() as patch, read_once():
            patch.setattr(wp.array, "numpy", counted)
            yield

    monkeypatch.setattr("warp_mca.phases.simulate.read_once", watched)
    for scenes in (fallen(2), fallen(5)):
        results = mca.run_batch(scenes)
        assert results[-1].summary["rigid_bodies"]["high"]["mass"] == pytest.approx(7.85e-3)
    assert read[2] >= read[5] > 0  # small arrays of single scenes may count among those of few
