"""Tests what a run reports of each contact: force vectors, axes, closing speeds, and what it warns of."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impacts import begun, finished, momentum, prepared, result_of
from watched import of_contacts

import warp_mca as mca
from warp_mca.accuracy.figures import why_unsure
from warp_mca.model.build import build_model
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.force_history import faint_share, grazing_share
from warp_mca.scene.contacts import contact_names
from warp_mca.watch.contacts import symmetry_of

STIFF = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
SOFT = mca.Elastic(E=1e7, nu=0.3, rho=1000.0)
EDGE = 0.02
MASS = STIFF.rho * EDGE**3


def turned(vector: tuple[float, float, float], axis: str) -> tuple[float, float, float]:
    """A vector given for a fall along y, for one along another axis: x to y to z to x."""
    shift = "yzx".index(axis)
    return tuple(np.roll(vector, shift).tolist())


def block(name: str, axis: str = "y", x: float = 0.0, y: float = 0.0, v: tuple = (0.0, -1.0, 0.0)) -> mca.Body:
    """A block of 2 x 2 x 2 cells above the origin plane."""
    place = turned((x - EDGE / 2, y, -EDGE / 2), axis)
    box = mca.Box(size=(EDGE, EDGE, EDGE), divisions=(2, 2, 2))
    return mca.Body(name=name, geometry=box, material=STIFF, position=place, velocity=turned(v, axis))


def falling(*bodies: mca.Body, axis: str = "y", duration: float = 3e-4, **contact) -> mca.Scene:
    """Blocks on the rigid plane through the origin, on springs so soft that the blocks hardly deform."""
    plane = mca.RigidPlane(normal=turned((0.0, 1.0, 0.0), axis))
    values = {"penalty": 1e-3} | contact
    return mca.Scene(
        name="falling",
        bodies=bodies,
        contacts=tuple(
            mca.Contact(slave=mca.Surface(body=body.name, nodes=f"{axis}min"), master=plane, **values)
            for body in bodies
        ),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-6),
        tip=mca.Point(body=bodies[0].name, at=(EDGE / 2, EDGE / 2, EDGE / 2)),
    )


def test_each_contact_reports_its_own_impulse():
    """Two blocks, one twice as fast, and a third that stays above."""
    fast, high = block("b", x=0.1, v=(0.0, -2.0, 0.5)), block("c", x=0.2, y=0.01)
    impact = finished(falling(block("a"), fast, high, mu=0.2))
    result = result_of(impact)
    pairs = result.summary["contacts_by_pair"]
    assert [pair["name"] for pair in pairs] == ["a–plane", "b–plane", "c–plane"]
    nodes = 27
    for k, before in enumerate(([0.0, -1.0, 0.0], [0.0, -2.0, 0.5], [0.0, -1.0, 0.0])):
        gained = momentum(impact, nodes * k, nodes * (k + 1)) - MASS * np.array(before)
        assert pairs[k]["impulse"] == pytest.approx(gained, abs=1e-6 * MASS)
    assert pairs[2] | {"intervals": [], "contact_open_at_end": False, "normal": None} == pairs[2]
    assert sum(contact.force[:, 1] for contact in result.contacts) == pytest.approx(result.F_n, rel=1e-12)
    assert pairs[1]["F_max"][1] == pytest.approx(2.0 * pairs[0]["F_max"][1], rel=0.01)
    assert pairs[0]["normal"] == pytest.approx([0.0, 1.0, 0.0])
    for contact, pair in zip(result.contacts[:2], pairs, strict=False):
        size = np.linalg.norm(contact.force, axis=1)
        assert pair["F_max"] == contact.force[size.argmax()].tolist()
        assert contact.pressure == pytest.approx(contact.force[:, 1])


def test_both_passes_of_a_contact_give_the_force_on_its_slave():
    resting = block("b", y=-EDGE, v=(0.0, 0.0, 0.0))
    meet = mca.Contact(
        slave=mca.Surface(body="a", nodes="ymin"),
        master=mca.Surface(body="b", nodes="ymax"),
        two_way=True,
        penalty=1e-2,
    )
    impact = finished(replace(falling(block("a"), resting), contacts=(meet,)))
    (pair,) = result_of(impact).summary["contacts_by_pair"]
    assert pair["name"] == "a–b"
    assert pair["impulse"] == pytest.approx(-momentum(impact, 27, 54), abs=1e-6 * MASS)
    assert pair["normal"] == pytest.approx([0.0, 1.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_closing_speed_is_that_of_a_rigid_block_on_its_springs(axis):
    """v cos(omega t), half a period long; the block's own velocity column shows it too, along any axis."""
    result = mca.run(falling(block("a", axis), axis=axis))
    (start, end), *others = result.summary["contacts"]
    assert not others
    inside = (result.time > start + 1e-6) & (result.time < end - 2e-6)
    phase = math.pi * (result.time[inside] - start - 0.5e-6) / (end - start)
    assert result["closing_speed"][inside] == pytest.approx(np.cos(phase), abs=0.05)
    assert result["closing_speed"][inside] == pytest.approx(-result[f"tip_v{axis}"][inside], abs=0.05)
    assert np.isnan(result["closing_speed"][result.time > end + 1e-6]).all()
    assert result["closing_speed"][1] == pytest.approx(1.0, abs=0.01)


def test_closing_speed_is_relative_to_a_moving_master():
    """Both blocks fly on at 30 m/s; the slave catches up with 1 m/s."""
    first, second = block("a", v=(0.0, -31.0, 0.0)), block("b", y=-EDGE, v=(0.0, -30.0, 0.0))
    meet = mca.Contact(
        slave=mca.Surface(body="a", nodes="ymin"), master=mca.Surface(body="b", nodes="ymax"), penalty=1e-3
    )
    result = mca.run(replace(falling(first, second, duration=3e-5), contacts=(meet,)))
    assert result["closing_speed"][1] == pytest.approx(1.0, abs=0.01)
    assert result["closing_speed"][1:] == pytest.approx(result.contacts[0].closing_speed[1:])


def test_sticking_springs_do_no_work_on_the_closing_speed():
    """With friction, springs hold tangential energy besides."""
    aslant = block("a", v=(1.0, -1.0, 0.0))
    smooth, rough = mca.run(falling(block("a"))), mca.run(falling(aslant, mu=10.0, duration=2e-5))
    rows = slice(1, 15)
    assert rough["closing_speed"][rows] == pytest.approx(smooth["closing_speed"][rows], abs=0.02)


def others(result: mca.Result) -> list[str]:
    """Warnings but that of springs, which are soft here so that the closed form holds."""
    return [warning for warning in result.warnings if not warning.startswith("contact springs held")]


def test_a_run_that_is_too_short_says_so():
    result = mca.run(falling(block("a"), duration=2e-5))
    assert result.summary["touched"] is result.summary["contact_open_at_end"] is True
    assert result.summary["contacts_by_pair"][0]["contact_open_at_end"] is True
    assert result.summary["F_n_first_peak"] is None
    (warning,) = others(result)
    assert warning.startswith("contact a–plane was still in progress when the run ended")


def test_a_run_whose_bodies_never_touch_says_so():
    result = mca.run(falling(block("a", y=0.01), duration=2e-5))
    assert result.summary["touched"] is result.summary["contact_open_at_end"] is False
    (warning,) = result.warnings
    assert warning.startswith("no contact closed in the simulated time")


def test_glued_bodies_that_general_contact_does_not_touch_warn_of_nothing():
    low, high = block("a"), block("b", y=EDGE)
    glued = mca.Contact(
        slave=mca.Surface(body="b", nodes="ymin"), master=mca.Surface(body="a", nodes="ymax"), bond=mca.Bond()
    )
    scene = replace(falling(low, duration=5e-6), bodies=(low, high), contacts=(glued, mca.ContactAll()))
    assert not mca.run(scene, figures="none").warnings


def test_a_finished_impact_and_a_scene_without_contact_warn_of_nothing():
    whole = mca.run(falling(block("a")))
    assert whole.summary["touched"] and not whole.summary["contact_open_at_end"]
    free = mca.run(replace(falling(block("a"), duration=2e-5), contacts=()))
    assert not free.summary["touched"]
    assert others(whole) == list(free.warnings) == list(free.contacts) == []


def paddle(**axes) -> mca.Result:
    """A soft arm flies up and turns by a quarter; then its side that looked up at first hits a block, towards -x."""
    arm = mca.Body(
        name="arm",
        geometry=mca.Box(size=(0.05, 0.01, 0.01), divisions=(5, 1, 1), origin=(-0.025, -0.005, -0.005)),
        material=SOFT,
        velocity=(0.0, 1.5, 0.0),
        angular_velocity=(0.0, 0.0, 60.0),
    )
    target = mca.Body(
        name="block",
        geometry=mca.Box(size=(0.01, 0.016, 0.01), divisions=(2, 4, 2), origin=(-0.017, 0.046, -0.005)),
        material=SOFT,
    )
    meet = mca.Contact(
        slave=mca.Surface(body="block", nodes="xmax"), master=mca.Surface(body="arm", nodes="ymax"), penalty=0.5, **axes
    )
    scene = mca.Scene(
        name="paddle",
        bodies=(arm, target),
        contacts=(meet,),
        impact=mca.ImpactPhase(duration=0.035, output_interval=1e-4, energy_tolerance=0.05),
    )
    return mca.run(scene, precision="float64")


def test_a_master_that_turned_warns_and_may_be_given_its_axes():
    wrong, right = paddle(), paddle(normal=(-2.0, 0.0, 0.0), tangent=(5.0, 1.0, 0.0))
    (force,) = (contact.force for contact in wrong.contacts)
    assert np.array_equal(right.contacts[0].force, force)
    assert force[:, 0].min() < -1.0
    assert np.abs(wrong.F_n).max() < 0.5 * np.abs(wrong.F_t).max()
    assert wrong.F_n == pytest.approx(force[:, 1], abs=1e-9)
    assert np.array_equal(right.F_n, -force[:, 0])
    assert np.array_equal(right.F_t, force[:, 1])
    assert any("contact block–arm: its normal force is along" in text and "F_n_N" in text for text in wrong.warnings)
    assert not any("its normal force" in text for text in right.warnings)
    normal = wrong.summary["contacts_by_pair"][0]["normal"]
    assert math.degrees(math.acos(-normal[0])) < 10.0


def along(*degrees: float, axis: tuple = (0.0, 1.0, 0.0), tangent: tuple = (1.0, 0.0, 0.0)) -> list[str]:
    """Warnings of contacts whose normal is so far off y, towards x."""
    angle = np.radians(degrees)
    normal = np.stack([np.sin(angle), np.cos(angle), np.zeros(len(angle))], axis=1)
    contacts = [
        ContactHistory(
            name=f"c{k}",
            force=np.zeros((3, 3)),
            pressure=np.array([0.0, 1.0, 0.0]),
            normal_force=np.array([0.0, 1.0, 0.0])[:, None] * n,
            closing_speed=np.zeros(3),
        )
        for k, n in enumerate(normal)
    ]
    return of_contacts(contacts, np.tile(np.array([axis, tangent]), (len(contacts), 1, 1)))


def test_normals_further_than_ten_degrees_off_warn():
    assert not along(0.0, 9.9, -9.9)
    assert [text.partition(":")[0] for text in along(10.1, 0.0, 180.0)] == ["contact c0", "contact c2"]
    assert "(0.5, 0.866, 0), 30 degrees off the axis (0, 1, 0) of F_n_N" in along(30.0)[0]


@pytest.mark.parametrize(("v", "tangent", "warns"), [(0.0, None, 1), (1.0, None, 1), (5.0, None, 0), (0.0, "z", 0)])
def test_friction_across_the_tangent_warns(v: float, tangent: str | None, warns: int):
    """F_t_N, along x by default, has little or nothing of a block's that slides along z."""
    axes = {} if tangent is None else {"tangent": (0.0, 0.0, 1.0)}
    result = result_of(finished(falling(block("a", v=(v, -1.0, 3.0)), mu=0.2, **axes)))
    assert sum("friction is along (0, 0, -1), across the axis (1, 0, 0) of F_t" in w for w in result.warnings) == warns
    assert not result.summary["F_t_reverses"]


def test_friction_that_the_other_half_cancels_is_none_across_the_tangent():
    """Of half a block, in whose plane of symmetry nodes are held along z; held everywhere, that is its guide."""
    scene = falling(block("a", v=(0.0, -1.0, 3.0)), mu=0.2)
    result = result_of(finished(scene))
    axes = np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])
    assert any("across the axis" in text for text in of_contacts(result.contacts, axes))
    assert not any("across" in text for text in of_contacts(result.contacts, axes, held=(0b100, 0)))
    for nodes, count in (("zmin", 1), ("boundary", 0)):
        held = replace(falling(block("a")), fixed=(mca.Fixed(body="a", nodes=nodes, axes="z"),))
        (planes,) = symmetry_of(begun(held).scene_runs[0].ready.model).values()
        assert len(planes) == count


@pytest.mark.parametrize(
    ("pressure", "says"),
    [
        ((0.0, 100.0, 3.0, 20.0, 0.0), "3.0% of its greatest force"),
        ((0.0, 100.0, 3.0, 30.0, 1.0, 20.0, 0.0), "1.0% of its greatest force"),
        ((0.0, 20.0, 4.0, 100.0), "4.0% of its greatest force"),
        ((0.0, 100.0, 6.0, 20.0, 0.0), ""),  # presses firmly all the time
        ((0.0, 100.0, 0.0, 20.0, 0.0), ""),  # opens
        ((0.0, 100.0, 3.0, 8.0, 2.0, 0.0), ""),  # fades away
        ((0.0, 0.0, 0.0), ""),
    ],
)
def test_a_contact_that_nearly_opens_between_compressions_says_so(pressure: tuple[float, ...], says: str):
    none = np.zeros((len(pressure), 3))
    contact = ContactHistory(
        name="c", force=none, pressure=np.array(pressure), normal_force=none, closing_speed=np.array(pressure)
    )
    found = [text for text in of_contacts([contact]) if "nearly opened" in text]
    assert len(found) == bool(says)
    assert says in "".join(found)


@pytest.mark.parametrize(
    ("pressure", "share"),
    [
        ((0.0, *[100.0] * 50, 0.0, 0.0, 0.0, 3.0, 4.0, 0.0), 2 / 52),
        ((0.0, 4.9, 0.0, 0.0, *[100.0] * 9, 0.0), 0.1),
        ((0.0, *[100.0] * 50, 0.0, 0.0, 0.0, 6.0, 4.0, 0.0), 0.0),  # presses
        ((0.0, *[100.0] * 50, 0.0, 0.0, 0.0, 3.0, 4.0), 0.0),  # may press yet
        ((0.0, *[100.0] * 50, 0.0, 3.0, 4.0, 0.0), 0.0),  # the same contact still
        ((0.0, *[100.0] * 200, *[0.0] * 9, 3.0, 4.0, 0.0), 0.0),  # too short to matter
        ((0.0, *[100.0] * 200, *[0.0] * 9, 0.05, 0.05, 0.05, 0.0), 0.0),  # no contact
        ((0.0, 0.0), 0.0),
    ],
)
def test_touches_in_which_bodies_only_graze_say_so(pressure: tuple[float, ...], share: float):
    assert grazing_share(np.array(pressure)) == pytest.approx(share)
    none = np.zeros((len(pressure), 3))
    contact = ContactHistory(
        name="c", force=none, pressure=np.array(pressure), normal_force=none, closing_speed=np.array(pressure)
    )
    found = [text for text in of_contacts([contact]) if "touches of their own" in text]
    says = [f"for {share:.0%} of its time, contact c has less than 5% of its greatest force"] if share else []
    assert [text.partition(" in ")[0] for text in found] == says


@pytest.mark.parametrize(
    ("pressure", "share"),
    [
        ((0.0, *[100.0] * 5, 0.9, 0.5, *[100.0] * 3, 0.0), 0.2),
        ((0.0, *[100.0] * 5, 0.9, 0.5, *[1.1] * 3, 0.0), 0.0),  # fades away
        ((0.0, *[100.0] * 5, 1.1, 2.0, *[100.0] * 3, 0.0), 0.0),  # presses
        ((0.0, *[100.0] * 5, 0.0, 0.0, *[100.0] * 3, 0.0), 0.0),  # parts
        ((0.0, *[100.0] * 200, 0.5, *[100.0] * 3, 0.0), 0.0),  # too short to matter
        ((0.0, 0.0), 0.0),
        ((), 0.0),
    ],
)
def test_rows_in_which_bodies_hardly_touch_between_compressions_are_found(pressure: tuple[float, ...], share: float):
    assert faint_share(np.array(pressure)) == pytest.approx(share)
    assert bool(why_unsure(np.array(pressure))) == bool(share)


def test_of_a_closed_master_the_tangent_must_lie_across_the_normal():
    closed = (0.0, 0.0, 0.0)
    assert not along(9.9, axis=closed)
    assert "not across the axis (1, 0, 0) of F_t_N" in along(10.1, axis=closed)[0]
    assert not along(40.0, axis=closed, tangent=(0.0, 0.0, 1.0))


def test_forces_that_cancel_have_no_normal():
    around = ContactHistory(
        name="clamp",
        force=np.zeros((2, 3)),
        pressure=np.ones(2),
        normal_force=np.array([[1.0, 0.0, 0.0], [-0.99, 0.0, 0.0]]),
        closing_speed=np.zeros(2),
    )
    assert around.normal is None
    assert around.summary(np.arange(2.0))["normal"] is None


def tangent(normal: tuple[float, float, float]) -> np.ndarray:
    """Axis of F_t for contact with a plane."""
    scene = falling(block("a"))
    scene = replace(scene, contacts=(replace(scene.contacts[0], master=mca.RigidPlane(normal=normal)),))
    meshes = mca.mesh(scene)
    X = {"a": meshes["a"].points}
    return build_model(scene, meshes, X, {"a": np.zeros_like(X["a"])}).contact_axes[0, 1]


def test_tangents_of_planar_scenes_are_n_x_z_and_do_not_flip_near_z():
    assert tangent((0.0, 1.0, 0.0)).tolist() == [1.0, 0.0, 0.0]
    assert tangent((-3.0, 0.0, 0.0)).tolist() == [0.0, 1.0, 0.0]
    for turn in np.linspace(0.0, 2.0 * math.pi, 7):
        for sign in (1.0, -1.0):
            for tilt in (1e-12, 1e-6, 0.01, 0.3):
                n = (tilt * math.cos(turn), tilt * math.sin(turn), sign)
                t = tangent(n)
                assert t @ np.array(n) == pytest.approx(0.0, abs=1e-12)
                assert t[0] > 0.9
                assert np.linalg.norm(t - [1.0, 0.0, 0.0]) <= 1.1 * tilt


def test_axes_are_checked_and_unit():
    scene = falling(block("a"), normal=(0.0, 3.0, 3.0), tangent=(2.0, 7.0, 7.0))
    ready = prepared(scene)
    r = math.sqrt(0.5)
    assert ready.model.contact_axes[0] == pytest.approx(np.array([[0.0, r, r], [1.0, 0.0, 0.0]]))
    with pytest.raises(mca.RequestError, match=r"Contact\.tangent = \(0.0, 2.0, 0.0\): .*across \(0.0, 1.0, 0.0\)"):
        mca.run(falling(block("a"), tangent=(0.0, 2.0, 0.0)))


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"normal": (0.0, 0.0, 0.0)}, "Contact.normal"),
        ({"tangent": (0.0, 0.0)}, "Contact.tangent"),
        ({"normal": (0.0, math.nan, 0.0)}, "Contact.normal"),
        ({"name": 3}, "Contact.name"),
    ],
)
def test_bad_names_and_axes_are_refused(values: dict, field: str):
    with pytest.raises(mca.RequestError, match=f"{field} = "):
        falling(block("a"), **values)


def test_names_are_unique():
    def contact(slave: str, nodes: str, **values) -> mca.Contact:
        return mca.Contact(slave=mca.Surface(body=slave, nodes=nodes), master=mca.RigidPlane(), **values)

    contacts = [contact("a", "ymin"), contact("b", "ymin"), contact("a", "xmin"), contact("a", "xmax", name="edge")]
    assert contact_names(contacts) == ("a–plane", "b–plane", "a–plane 2", "edge")
    assert contact_names([contact("a", "ymin"), contact("a", "xmin", name="a–plane")]) == ("a–plane 2", "a–plane")
    scene = falling(block("a"), block("b", x=0.1))
    with pytest.raises(mca.RequestError, match="give each contact a name of its own"):
        replace(scene, contacts=tuple(replace(item, name="floor") for item in scene.contacts))


def test_forces_of_each_contact_are_saved_and_loaded(tmp_path: Path):
    result = mca.run(falling(block("a"), name="floor/left", duration=3e-5), out=tmp_path / "out")
    loaded = mca.load(tmp_path / "out")
    assert loaded.summary["contacts_by_pair"] == result.summary["contacts_by_pair"]
    assert loaded.warnings == result.warnings
    (known,), (found,) = result.contacts, loaded.contacts
    assert found.name == "floor/left"
    for name in ("force", "pressure", "normal_force", "closing_speed"):
        np.testing.assert_array_equal(getattr(found, name), getattr(known, name))
    with np.load(tmp_path / "out" / "forces.npz") as arrays:
        assert arrays["time_s"].tolist() == result.time.tolist()
        assert arrays["floor/left/force_N"].shape == (len(result.time), 3)


def test_results_saved_before_load_without_the_new_columns(tmp_path: Path):
    from warp_mca.results.result import HISTORY_COLUMNS
    from warp_mca.results.storage import save

    result = mca.run(falling(block("a"), duration=3e-5))
    old = {name: result[name] for name in HISTORY_COLUMNS}
    save(replace(result, history=old, contacts=()), tmp_path / "old")
    loaded = mca.load(tmp_path / "old")
    assert tuple(loaded.history) == HISTORY_COLUMNS
    assert loaded.contacts == ()
