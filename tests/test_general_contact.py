"""Tests of general contact: contacts="all" and ContactAll, between different bodies."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from impacts import begun, finished

import warp_mca as mca
from warp_mca.scene import model_file

SOFT = mca.Elastic(E=1e10, nu=0.3, rho=3000.0)
GAP = 1e-5  # between bricks [m]


def skin(name: str) -> mca.Surface:
    return mca.Surface(body=name, nodes="boundary")


def listed(names: str, **more: object) -> tuple[mca.Contact, ...]:
    """Two-way contacts of all pairs."""
    return tuple(mca.Contact(slave=skin(a), master=skin(b), two_way=True, **more) for a, b in combinations(names, 2))


def brick(name: str, at: Sequence[float], velocity: Sequence[float] = (0.0, 0.0, 0.0), **more: object) -> mca.Body:
    box = mca.Box(size=(0.02, 0.01, 0.01), divisions=(4, 2, 2))
    return mca.Body(name=name, geometry=box, material=SOFT, position=at, velocity=velocity, **more)


def bricks(contacts: object, names: str = "abc", **more: object) -> mca.Scene:
    """Brick c slides down over the seam of the bricks a and b, which lie free; all pairs may meet."""
    bodies = (
        brick("a", (0.0, 0.0, 0.0)),
        brick("b", (0.02 + GAP, 0.0, 0.0)),
        brick("c", (0.0053, 0.01 + GAP, 0.0007), (2.0, -3.0, 0.0)),
    )
    impact = mca.ImpactPhase(duration=6e-5, output_interval=3e-7)  # less than any stable step
    bodies = tuple(body for body in bodies if body.name in names)
    return mca.Scene(name="bricks", bodies=bodies, contacts=contacts, impact=impact, **more)


def balls(contacts: object) -> mca.Scene:
    ball = mca.Sphere(radius=0.005, section=4, ring=2)
    first = mca.Body(name="a", geometry=ball, material=SOFT, rotation=(0.0, 0.0, 0.1), velocity=(5.0, 0.3, 0.0))
    other = mca.Body(name="b", geometry=ball, material=SOFT, rotation=(0.0, 0.0, 3.2), position=(0.01001, 0.0, 0.001))
    impact = mca.ImpactPhase(duration=3e-5, output_interval=3e-7, energy_tolerance=0.1)
    return mca.Scene(name="balls", bodies=(first, other), contacts=contacts, impact=impact)


def rods(contacts: object) -> mca.Scene:
    """Rods that cross, of cells longer than they are thick."""
    rod = mca.Rod(radius=0.005, length=0.06, tip="flat", section=4, ring=2, axial=6)
    low = mca.Body(name="a", geometry=rod, material=SOFT, rotation=(0.0, -np.pi / 2.0, 0.0), position=(0.0, 0.0, -0.03))
    top = mca.Body(name="b", geometry=rod, material=SOFT, position=(-0.033, 0.0101, 0.0), velocity=(0.0, -5.0, 0.0))
    impact = mca.ImpactPhase(duration=6e-5, output_interval=5e-7, energy_tolerance=0.1)
    return mca.Scene(name="rods", bodies=(low, top), contacts=contacts, impact=impact)


def impulse(result: mca.Result) -> float:
    """Of all normal forces [N s]."""
    return float(sum(contact.pressure.sum() for contact in result.contacts))


@pytest.mark.parametrize(("scene", "names"), [(bricks, "abc"), (balls, "ab"), (rods, "ab")])
def test_the_same_springs_give_the_same_motion(scene, names) -> None:
    given = {"mu": 0.2, "penalty": 1.0}  # the default of a listed pair depends on where it meets
    pairs, one = mca.run(scene(listed(names, **given))), mca.run(scene((mca.ContactAll(**given),)))
    assert impulse(pairs) > 0.0
    assert impulse(one) == pytest.approx(impulse(pairs), rel=1e-6)
    assert one.history["E_friction"][-1] == pytest.approx(pairs.history["E_friction"][-1], rel=1e-5)
    assert one.history["E_kinetic"] == pytest.approx(pairs.history["E_kinetic"], rel=1e-6)
    assert one.summary["extremes"]["F_n_max"] == pytest.approx(pairs.summary["extremes"]["F_n_max"], rel=1e-6)
    (contact,) = one.contacts
    assert contact.name == "all"
    assert not contact.force.any()


def test_all_is_a_general_contact_without_friction() -> None:
    scene = bricks("all")
    assert scene.contacts == (mca.ContactAll(),)
    assert scene.general_pairs() == [("a", "a"), ("a", "b"), ("a", "c"), ("b", "b"), ("b", "c"), ("c", "c")]
    assert bricks((mca.ContactAll(self_contact=False),)).general_pairs() == [("a", "b"), ("a", "c"), ("b", "c")]


def test_a_listed_contact_takes_its_pair_out() -> None:
    pairs = listed("abc", mu=0.2, penalty=1.0)
    general = mca.ContactAll(mu=0.2, penalty=1.0)
    scene = bricks((pairs[1], general))
    assert ("a", "c") not in scene.general_pairs()
    assert impulse(mca.run(scene)) == pytest.approx(impulse(mca.run(bricks(pairs))), rel=1e-6)
    rough = mca.run(bricks((replace(pairs[1], mu=0.8), general)))
    smooth = mca.run(bricks((replace(pairs[1], mu=0.0), general)))
    assert rough.history["E_friction"][-1] > 1.2 * smooth.history["E_friction"][-1] > 0.0


def test_excluded_and_bound_pairs_are_left_out() -> None:
    assert ("a", "c") not in bricks((mca.ContactAll(exclude=[("c", "a"), ("b", "b")]),)).general_pairs()
    assert ("b", "b") not in bricks((mca.ContactAll(exclude=[("c", "a"), ("b", "b")]),)).general_pairs()
    weld = mca.Weld(name="w", body="a", nodes="xmax", other="b", other_nodes="xmin")
    assert ("a", "b") not in bricks("all", joints=(weld,)).general_pairs()
    tie = mca.Tie(slave=mca.Surface(body="a", nodes="xmax"), master=mca.Surface(body="b", nodes="xmin"))
    assert ("a", "b") not in bricks("all", ties=(tie,)).general_pairs()
    excluded = mca.run(bricks((mca.ContactAll(exclude=[("a", "c"), ("b", "c")]),)), duration=3e-4)
    assert impulse(excluded) == 0.0
    assert "a and c went into each other" in "".join(excluded.warnings)


def test_rigid_bodies_meet_deformable_ones_alone() -> None:
    scene = bricks((mca.ContactAll(penalty=1.0),))
    rigid = replace(
        scene, bodies=(replace(scene.body("a"), rigid=True), replace(scene.body("b"), rigid=True), scene.body("c"))
    )
    assert rigid.general_pairs() == [("a", "c"), ("b", "c"), ("c", "c")]
    contacts = tuple(item for item in listed("abc", penalty=1.0) if item.sides != ("a", "b"))
    assert impulse(mca.run(rigid)) == pytest.approx(impulse(mca.run(replace(rigid, contacts=contacts))), rel=1e-6)


def test_momentum_is_conserved_between_three_bodies() -> None:
    impact = finished(bricks((mca.ContactAll(mu=0.4),)))
    mass, model = impact.solver.model.mass[:, None], impact.solver.model
    change = (mass * (impact.state.v.numpy() - model.V)).sum(axis=0)
    assert np.abs(mass * (impact.state.v.numpy() - model.V)).sum() > 0.01
    assert np.abs(change).max() < 1e-9


@pytest.mark.parametrize(
    ("contacts", "words"),
    [
        ("every", "all"),
        ((mca.ContactAll(), mca.ContactAll()), "give one"),
        ((mca.ContactAll(exclude=[("a", "nobody")]),), "nobody"),
        ((mca.ContactAll(exclude=[(a, b) for a in "abc" for b in "abc"]),), "no pair is left"),
    ],
)
def test_what_no_scene_can_mean_is_refused(contacts, words) -> None:
    with pytest.raises(mca.RequestError, match=words):
        bricks(contacts)


def test_what_no_general_contact_can_have_is_refused() -> None:
    for wrong in (
        {"penalty": "auto"},
        {"exclude": ["ab", "c"]},
        {"exclude": [("a",)]},
        {"self_contact": 1},
        {"mu": -1.0},
    ):
        with pytest.raises(mca.RequestError, match=f"ContactAll.{next(iter(wrong))}"):
            mca.ContactAll(**wrong)


def test_bodies_that_overlap_at_the_start_are_refused() -> None:
    scene = bricks("all")
    low = replace(scene.body("c"), position=(0.0053, 0.0099, 0.0007))
    with pytest.raises(mca.RequestError, match="lie inside the other"):
        mca.run(replace(scene, bodies=(*scene.bodies[:2], low)))
    mca.run(replace(scene, bodies=(*scene.bodies[:2], low), contacts=(mca.ContactAll(initial_overlap="stress_free"),)))


def test_in_files_batches_and_threads(tmp_path) -> None:
    scene = bricks((mca.ContactAll(mu=0.2, exclude=[("a", "b")]),))
    alone = mca.run(scene, threads=1)
    model_file.save(tmp_path / "bricks.mca", scene, mca.mesh(scene))
    assert model_file.load(tmp_path / "bricks.mca").scene == scene
    fewer = bricks((mca.ContactAll(mu=0.4),), "ac")
    first, other, _ = mca.run_batch([scene, fewer, scene])
    for batched, single in ((first, alone), (other, mca.run(fewer))):
        assert batched.history["E_kinetic"] == pytest.approx(single.history["E_kinetic"], rel=1e-9)
        assert batched.history["F_n_N"] == pytest.approx(single.history["F_n_N"], rel=1e-6, abs=1e-3)
    with pytest.raises(mca.RequestError, match="contacts of the same kinds"):
        mca.run_batch([fewer, bricks(listed("ac"), "ac")])


def test_with_several_rates() -> None:
    scene = bricks((mca.ContactAll(mu=0.2),))
    one, several = mca.run(scene), mca.run(scene, multi_rate=2)
    assert impulse(several) == pytest.approx(impulse(one), rel=0.02)


def test_a_stored_state_goes_on_as_the_run_would(tmp_path) -> None:
    scene = bricks((mca.ContactAll(mu=0.2),))
    whole, first, again = finished(scene), begun(scene), begun(scene)
    first.advance(until=101)
    first.save(tmp_path / "state.npz")
    again.load(tmp_path / "state.npz")
    again.advance()
    assert np.array_equal(again.state.u.numpy(), whole.state.u.numpy())
    assert np.array_equal(again.state.contacts[0].slot.numpy(), whole.state.contacts[0].slot.numpy())


@pytest.mark.gpu
@pytest.mark.parametrize("scene", [bricks((mca.ContactAll(mu=0.2),)), balls("all")], ids=["bricks", "balls"])
def test_a_device_gives_the_motion_of_the_cpu_and_the_same_bits_twice(scene) -> None:
    cpu, cuda, again = (mca.run(scene, device=device) for device in ("cpu", "cuda:0", "cuda:0"))
    assert all(np.array_equal(cuda[name], again[name], equal_nan=True) for name in cuda.history)
    for name in ("F_n_N", "E_kinetic", "E_friction"):
        assert cuda[name] == pytest.approx(cpu[name], abs=1e-4 * max(np.abs(cpu[name]).max(), 1e-9))
