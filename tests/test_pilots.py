"""Tests coarse runs by which an accuracy is had: their meshes, the mesh that follows, and the error after the run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import pytest
from fake_run import fake

import warp_mca as mca
from warp_mca.accuracy.pilots import STEP, run_pilots
from warp_mca.accuracy.refinements import Refinements
from warp_mca.accuracy.request import Accuracy

BOUND = ("F_n_first_peak", "impulse", "contact_duration")


@dataclass(frozen=True)
class Plain:
    """A recipe whose cells have a size, and no counts."""

    size: float = 0.01

    def refined(self, factor: float) -> Plain:
        return Plain(self.size / factor)

    def build(self) -> mca.Mesh:
        raise NotImplementedError


@pytest.mark.parametrize("asked", [0.005, 0.01, 0.02])
def test_pilots_find_the_mesh_and_the_error(asked: float):
    scene = mca.make_scene("rod_on_wall")
    found = run_pilots(scene, Accuracy(share=asked), BOUND, fake)
    refine = found.variant.refine
    assert refine is not None
    true = 0.02 * refine**-1.5
    assert 0.25 * asked < true < asked
    estimate = found.estimate(fake(found.variant.applied(scene)))
    assert estimate["F_n_first_peak"] == pytest.approx(true, rel=0.05)
    assert estimate["impulse"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("asked", "ready"), [(0.04, False), (0.2, True)])
def test_the_second_pilot_is_the_run_where_little_is_left_of_it(asked: float, ready: bool):
    """Two meshes cannot tell a series that goes nowhere."""
    found = run_pilots(mca.make_scene("rod_on_wall"), Accuracy(share=asked), BOUND, fake)
    assert (found.result is not None) == ready
    assert (found.variant.refine == pytest.approx(1.0 / found.sizes[1])) == ready


@pytest.mark.parametrize(("order", "known"), [(1.5, True), (0.2, False), (-1.0, False)])
def test_a_figure_that_has_no_limit_has_no_estimate(order: float, known: bool):
    found = run_pilots(mca.make_scene("rod_on_wall"), Accuracy(share=0.05), BOUND, partial(fake, order=order, size=0.3))
    peak = found.estimate(fake(found.variant.applied(found.refinements.scene), order=order, size=0.3))["F_n_first_peak"]
    assert isinstance(peak, float) == known


def test_meshes_are_those_whose_counts_are_multiples():
    """Two cells through a thickness are one, four or six, not two again with others along the bar."""
    refinements = Refinements(mca.make_scene("coaxial_rods"), 1.0)
    assert refinements.near(0.64, 0.3, 1.1) == 1.0
    assert refinements.finer(1.0, STEP, 4.0) == [2.0, 3.0, 4.0]
    assert refinements.unlike(0.64) > 0.3
    assert refinements.meshed(2.0) == pytest.approx(2.0)
    assert Refinements(mca.make_scene("coaxial_rods"), 2.0).unlike(1.5) == 0.0


def test_levels_have_meshes_of_their_own():
    """Few cells of a ball may be those of other values of refine."""
    refinements = Refinements(mca.make_scene("hertz_sphere", section=4), 1.0)
    assert refinements.meshed(refinements.near(0.64, 0.58, 0.99)) < 1.15 * refinements.meshed(0.45)
    second = refinements.near(0.64, 0.58, 0.99, coarser=0.45)
    assert refinements.meshed(second) >= 1.15 * refinements.meshed(0.45)
    assert all(
        refinements.meshed(level) >= 1.15 * refinements.meshed(second) for level in refinements.finer(second, STEP, 4.0)
    )


def test_meshes_that_are_the_same_tell_nothing():
    few = mca.make_scene("rod_on_wall", section=2, axial=2)
    with pytest.raises(mca.RequestError, match="nearly the same"):
        run_pilots(few, Accuracy(share=0.3, typed={"refine": 1.0}), BOUND, fake)
    found = run_pilots(few, Accuracy(share=0.05), BOUND, fake)
    told = replace(found, sizes=(1.0, 0.9)).estimate(fake(found.variant.applied(few)))
    assert "nearly the same" in str(told["impulse"])


def test_a_recipe_without_counts_has_all_levels():
    scene = mca.make_scene("coaxial_rods")
    bodies = tuple(replace(body, geometry=Plain()) for body in scene.bodies)
    refinements = Refinements(replace(scene, bodies=bodies), 1.0)
    assert refinements.near(0.64, 0.3, 1.1) == refinements.meshed(0.64) == 0.64


def test_what_cannot_be_had_is_refused_with_what_can():
    scene = mca.make_scene("rod_on_wall")
    with pytest.raises(mca.RequestError, match=r"about 0\.[0-9]+% can be had in F_n_first_peak"):
        run_pilots(scene, Accuracy(share=0.001), BOUND, fake)
    with pytest.raises(mca.RequestError, match=r"refine = 0\.5"):
        run_pilots(scene, Accuracy(share=0.01, typed={"refine": 0.5}), BOUND, fake)
    soft = Accuracy(share=0.02, typed={"penalty": 0.1})
    with pytest.raises(mca.RequestError, match=r"penalty = 0\.1"):
        run_pilots(scene, soft, BOUND, lambda scene, **options: fake(scene, share=0.5))


def test_springs_are_made_stiffer_than_the_accuracy_needs():
    def springs(scene: mca.Scene, **options: object) -> mca.Result:
        return fake(scene, share=0.1 / float(scene.contacts[0].penalty or 1.0))  # pyright: ignore[reportArgumentType]

    found = run_pilots(mca.make_scene("rod_on_wall", penalty=1.0), Accuracy(share=0.02), BOUND, springs)
    assert found.variant.parameters["penalty"] == pytest.approx(0.3 * 0.1 / (0.3 * 0.02), rel=0.02)


def test_a_guard_that_stiff_springs_trip_leaves_the_scene_its_own():
    def trips(scene: mca.Scene, **options: object) -> mca.Result:
        if scene.contacts[0].penalty != 1.0:
            raise mca.GuardError("too stiff")
        return fake(scene, share=0.01)

    found = run_pilots(mca.make_scene("rod_on_wall", penalty=1.0), Accuracy(share=0.007), BOUND, trips)
    assert "penalty" not in found.variant.knobs


def test_a_guard_that_stops_the_coarsest_mesh_leaves_finer_ones():
    def trips(scene: mca.Scene, **options: object) -> mca.Result:
        if scene.refine < 0.6:
            raise mca.GuardError("contact gave way")
        return fake(scene)

    found = run_pilots(mca.make_scene("rod_on_wall"), Accuracy(share=0.02), BOUND, trips)
    assert found.sizes[0] <= 1.0 / 0.6


def test_a_guard_that_stops_a_pilot_says_so():
    def trips(scene: mca.Scene, **options: object) -> mca.Result:
        raise mca.GuardError("contact gave way")

    with pytest.raises(mca.GuardError, match=r"a coarse run \(refine [0-9.]+\) .* contact gave way"):
        run_pilots(mca.make_scene("rod_on_wall"), Accuracy(share=0.02), BOUND, trips)
