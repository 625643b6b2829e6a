"""Tests of what is said of the springs of flat contacts: as much as finer meshes show, nothing where waves run on."""

from __future__ import annotations

import math
from functools import cache

import pytest

import warp_mca as mca

SIDE = 0.01
STEEL, SOFT = mca.Elastic(E=200e9, nu=0.3, rho=7800.0), mca.library.ABS
BAR, LIGHT = mca.Elastic(E=200e9, nu=0.0, rho=7800.0), mca.Elastic(E=70e9, nu=0.0, rho=2700.0)


@cache
def struck(
    contact: str, cells: int, length: float, width: float, one: mca.Elastic = STEEL, other: mca.Elastic = STEEL
) -> mca.Result:
    """A bar strikes the end of another, `width` times as wide and long, until waves are back.

    `cells` lie over the side of each bar, `length` is that of the first one over its side.
    """

    def bar(name: str, wide: float, material: mca.Elastic) -> mca.Body:
        count = round(wide * cells)
        side, long = wide * SIDE, wide * length * SIDE
        box = mca.Box(
            size=(long, side, side),
            divisions=(round(length * count), count, count),
            origin=(1e-7 if name == "one" else -long, -0.5 * side, -0.5 * side),
        )
        speed = -1.0 if name == "one" else 0.0
        return mca.Body(name=name, geometry=box, material=material, velocity=(speed, 0.0, 0.0))

    pair = mca.Contact(slave=mca.Surface(body="one", nodes="xmin"), master=mca.Surface(body="other", nodes="xmax"))
    time = 2.4 * length * SIDE / one.wave_speeds["bar"]
    scene = mca.Scene(
        name="struck",
        bodies=(bar("one", 1.0, one), bar("other", width, other)),
        contacts=(mca.ContactAll() if contact == "all" else pair,),
        impact=mca.ImpactPhase(duration=time, output_interval=time / 200.0),
    )
    return mca.run(scene)


def loss_of(result: mca.Result) -> float:
    (loss,) = result.summary["contact_spring_loss"].values()
    return -loss


@pytest.mark.parametrize("contact", ["listed", "all"])
@pytest.mark.parametrize(("width", "other"), [(1.0, BAR), (2.0, BAR), (1.0, LIGHT)], ids=["equal", "wide", "light"])
def test_nothing_is_said_of_bars_that_meet(contact: str, width: float, other: mca.Elastic):
    """They press with v / (1 / Z_1 A_1 + 1 / Z_2 A_2), 12 to 20 % of the energy in springs or not."""
    result = struck(contact, 2, 5.0, width, BAR, other)
    Z = [math.sqrt(material.E * material.rho) * area for material, area in ((BAR, 1.0), (other, width**2))]
    force = SIDE**2 * Z[0] * Z[1] / (Z[0] + Z[1])
    assert 0.99 < result.contacts[0].pressure.max() / force < 1.2  # general contact rings
    assert loss_of(result) < 0.01
    assert not any("contact springs held" in text for text in result.warnings)


@pytest.mark.parametrize("contact", ["listed", "all"])
@pytest.mark.parametrize(
    ("width", "material"), [(1.0, STEEL), (2.0, STEEL), (2.0, SOFT)], ids=["cubes", "cube on block", "soft cube"]
)
def test_loss_of_short_bodies_follows_finer_meshes(contact: str, width: float, material: mca.Elastic):
    """It is within a factor of 2 of what cells four times smaller add to the greatest force."""
    coarse, fine = (struck(contact, cells, 1.0, width, material) for cells in (2, 8))
    measured = 1.0 - coarse.contacts[0].pressure.max() / fine.contacts[0].pressure.max()
    assert 0.5 < loss_of(coarse) / measured < 2.0
    assert any(f"some {loss_of(coarse):.0%} below that of stiff springs" in text for text in coarse.warnings)


def test_a_mass_on_a_wide_pad_takes_what_series_springs_take():
    """A steel cube on foam four times as wide, in general contact: a third of the loss was said."""
    foam = mca.Elastic(E=5e6, nu=0.0, rho=50.0)
    pad = mca.Box(size=(4.0 * SIDE, 4.0 * SIDE, SIDE), divisions=(8, 8, 2))
    cube = mca.Box(size=(SIDE, SIDE, SIDE), divisions=(2, 2, 2), origin=(1.5 * SIDE, 1.5 * SIDE, SIDE + 1e-6))
    bodies = (
        mca.Body(name="pad", geometry=pad, material=foam),
        mca.Body(name="cube", geometry=cube, material=BAR, velocity=(0.0, 0.0, -1.0)),
    )

    def run(penalty: float | None) -> mca.Result:
        scene = mca.Scene(
            name="pad",
            bodies=bodies,
            contacts=(mca.ContactAll(penalty=penalty),),
            fixed=(mca.Fixed(body="pad", nodes="zmin"),),
            impact=mca.ImpactPhase(duration=2e-3, output_interval=1e-5),
        )
        return mca.run(scene)

    soft, stiff = run(None), run(10.0)
    measured = 1.0 - soft.contacts[0].pressure.max() / stiff.contacts[0].pressure.max() * (1.0 - loss_of(stiff))
    assert loss_of(soft) == pytest.approx(measured, rel=0.2)
