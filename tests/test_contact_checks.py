"""Contact that is not resolved: refused where bodies could cross, said where force and time are not to be trusted."""

import pytest

import warp_mca as mca
from warp_mca.watch.spring_loss import PEAK_LOSS

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)


def said(result: mca.Result, words: str) -> bool:
    return any(words in warning for warning in result.warnings)


def test_springs_that_hold_most_of_the_energy_are_named():
    soft = mca.run(mca.make_scene("hertz_sphere", penalty=0.1, section=4, pole_size=2e-4))
    assert said(soft, "of the energy that bodies had exchanged when the force of sphere–plane was")
    assert not said(mca.run(mca.make_scene("hertz_sphere", section=4, pole_size=2e-4)), "contact springs held")


def test_patch_of_few_cells_is_named():
    """Hertz's radius of contact is 0.47 of a cell at 0.01 m/s, 3 cells at 1 m/s."""
    scenes = [mca.make_scene("hertz_sphere", v=v) for v in (0.01, 1.0)]
    slow, fast = (mca.run(scene, duration=0.6 * scene.impact.duration) for scene in scenes)
    assert said(slow, "less than three cells across")
    assert not said(fast, "cells across")


def test_a_master_too_coarse_to_dent_is_named():
    """A ball on a softer block: Hertz's greatest force is 210.4 N, on a place 3 mm wide."""

    def ball(cell: float | None, rigid: bool = False) -> mca.Result:
        coarse = mca.Box(size=(0.12, 0.06, 0.12), divisions=(6, 3, 6), origin=(-0.06, -0.06, -0.06))
        core = {"core": (8, 8), "core_size": cell or 1e-3, "core_depth": 4, "layers": 8, "extension": 2}
        fine = mca.Plate(length=0.12, width=0.12, height=0.06, **core)
        own, other = (mca.Elastic(E=E, nu=0.3, rho=1000.0) for E in (3e9, 5e8))
        start = {"position": (0.0, 0.010001, 0.0), "rotation": (0.0, 0.0, -1.570796), "velocity": (0.0, -3.0, 0.0)}
        sphere = mca.Sphere(radius=0.01, section=8, ring=4)
        block = mca.Body(name="block", geometry=fine if cell else coarse, material=other, rigid=rigid)
        top, bottom = ("top", "bottom") if cell else ("ymax", "ymin")
        contact = mca.Contact(slave=mca.Surface(body="ball", nodes="pole"), master=mca.Surface(body="block", nodes=top))
        return mca.run(
            mca.Scene(
                name="dent",
                bodies=(mca.Body(name="ball", geometry=sphere, material=own, **start), block),
                fixed=() if rigid else (mca.Fixed(body="block", nodes=bottom),),
                contacts=(contact,),
                impact=mca.ImpactPhase(duration=1.2e-4, output_interval=1e-6),
            )
        )

    words = "cells so large do not dent"
    coarse, fine = ball(None), ball(2.5e-3)
    assert coarse.F_n.max() == pytest.approx(317.0, rel=0.02)
    assert said(coarse, words)
    assert fine.F_n.max() == pytest.approx(210.4, rel=0.05)
    assert not said(fine, words)
    assert not said(ball(None, rigid=True), words)


def test_corner_and_edge_are_named_and_a_face_is_not():
    """An edge of three nodes; springs take force there, whatever a wave on the whole face would give."""

    def drop(turn: tuple[float, float, float], lift: float) -> mca.Result:
        box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2), origin=(-0.005, -0.005, -0.005))
        start = {"position": (0.0, lift, 0.0), "rotation": turn, "velocity": (0.0, -1.0, 0.0)}
        body = mca.Body(name="block", geometry=box, material=STEEL, **start)
        contact = mca.Contact(slave=mca.Surface(body="block", nodes="boundary"), master=mca.RigidPlane())
        impact = mca.ImpactPhase(duration=8e-6, output_interval=2e-7)
        return mca.run(mca.Scene(name="drop", bodies=(body,), contacts=(contact,), impact=impact))

    assert not said(drop((0.0, 0.0, 0.0), 0.005), "a corner or an edge")
    assert said(drop((1.545738, 0.0, -1.545738), 0.008661), "a corner or an edge")  # it stands on one corner
    edge = drop((0.0, 0.0, 0.785398), 0.0070712)
    assert said(edge, "acted on 2.") and said(edge, "a corner or an edge")
    assert said(edge, "until its peak no longer changes")
    (share,), (loss,) = (edge.summary[f"contact_spring_{key}"].values() for key in ("share", "loss"))
    assert loss == -PEAK_LOSS * share


@pytest.mark.parametrize("bound", ["Prescribed", "Fixed", "free"])
def test_nodes_that_are_driven_through_a_plane_are_named(bound: str):
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    body = mca.Body(name="block", geometry=box, material=STEEL, velocity=(0.0, -1.0, 0.0))
    drive = mca.Prescribed(body="block", nodes="ymin", axis="y", times=(0.0,), velocities=(-1.0,))
    scene = mca.Scene(
        name="driven",
        bodies=(body,),
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane()),),
        prescribed=(drive,) if bound == "Prescribed" else (),
        fixed=(mca.Fixed(body="block", nodes="ymin"),) if bound == "Fixed" else (),
        impact=mca.ImpactPhase(duration=5e-6, energy_tolerance=10.0),
    )
    assert said(mca.run(scene), "9 nodes of block were driven into the plane, up to 5") == (bound != "free")


def crossed(
    axial: int, other: int, along: float = 0.003, speed: float = 5.0, tilt: float = 0.0, **contact
) -> mca.Scene:
    """Two rods of 10 mm, one along x falls on one along z, with so many cells along each 200 mm.

    They cross at `along` [m] on the lower one; the upper one is tilted by an angle [rad].
    """

    def rod(name: str, cells: int, **start) -> mca.Body:
        bar = mca.Box(size=(0.2, 0.01, 0.01), divisions=(cells, 2, 2), origin=(-0.1, -0.005, -0.005))
        return mca.Body(name=name, geometry=bar, material=STEEL, **start)

    start = {"position": (0.007, 0.0101 + 0.012 * tilt, along), "rotation": (0.0, 0.0, tilt)}
    upper = rod("upper", axial, velocity=(0.0, -speed, 0.0), **start)
    lower = rod("lower", other, rotation=(0.0, 1.5707963, 0.0))
    slave, master = (mca.Surface(body=name, nodes="boundary") for name in ("upper", "lower"))
    return mca.Scene(
        name="crossed",
        bodies=(upper, lower),
        contacts=(mca.Contact(slave=slave, master=master, **contact),),
        impact=mca.ImpactPhase(duration=4e-5),
    )


@pytest.mark.parametrize("two_way", [None, False, True])
def test_bodies_that_cross_between_nodes_meet_edge_to_edge(two_way: bool | None):
    result = mca.run(crossed(10, 10, 0.01, two_way=two_way))
    assert result.summary["F_n_max"] > 1e3


def test_bodies_whose_finer_side_sees_the_other_are_run():
    assert mca.run(crossed(40, 10)).summary["F_n_max"] > 1e3
    assert mca.run(crossed(10, 40, two_way=True)).summary["F_n_max"] > 1e3


def test_coarse_ends_that_meet_head_on_are_run():
    """Their sides are longer than they are wide, but do not face each other."""
    bar = mca.Box(size=(0.2, 0.01, 0.01), divisions=(5, 2, 2))
    one = mca.Body(name="one", geometry=bar, material=STEEL, velocity=(1.0, 0.0, 0.0))
    other = mca.Body(name="other", geometry=bar, material=STEEL, position=(0.2, 0.0, 0.0))
    slave, master = (mca.Surface(body=name, nodes="boundary") for name in ("one", "other"))
    impact = mca.ImpactPhase(duration=2e-5, energy_tolerance=0.1)
    scene = mca.Scene(
        name="bars", bodies=(one, other), contacts=(mca.Contact(slave=slave, master=master),), impact=impact
    )
    assert mca.run(scene).summary["F_n_max"] > 1e3
