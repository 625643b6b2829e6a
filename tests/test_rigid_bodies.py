"""Rigid bodies in the impact phase: momentum, joints, contact, steps, states, and what they cannot do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from impacts import begun, figures, finished, result_of
from numpy.typing import NDArray
from test_cycle import COARSE

import warp_mca as mca
from warp_mca.phases.cycle import Cycle
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import Settings
from warp_mca.physics.rigid.rows import independent

pytestmark = pytest.mark.usefixtures("short_ranges")

SOFT = mca.Elastic(E=1e9, nu=0.3, rho=2700.0)
ROUND_OFF = 1e-12
BAR = mca.Box(size=(0.3, 0.04, 0.04), divisions=(6, 4, 4), origin=(0.0, -0.02, -0.02))


def momenta(impact: Impact) -> tuple[NDArray, float]:
    """Momentum and angular momentum about the origin of all nodes, shape (6,), and the greatest sum of their sizes."""
    model, u, v = impact.solver.model, impact.state.u.numpy(), impact.state.v.numpy()
    p, x = model.mass[:, None] * v, model.X + u
    parts = np.concatenate([p, np.cross(x, p)], axis=1)
    return parts.sum(axis=0), float(np.abs(parts).sum(axis=0).max())


def keeps_momentum(scene: mca.Scene, axes: Sequence[int] = range(6), **settings: str) -> Impact:
    """The finished impact, which kept these momenta; in float64, where forces of elements cancel to rounding."""
    impact = begun(scene, **{"precision": "float64", **settings})  # type: ignore[arg-type]
    before, size = momenta(impact)
    impact.advance()
    assert impact.stopped == [None]
    after, _ = momenta(impact)
    assert np.abs(after - before)[list(axes)].max() < ROUND_OFF * size
    return impact


def block() -> mca.Scene:
    """A box with three different moments of inertia, turning freely near its middle axis."""
    box = mca.Box(size=(0.1, 0.2, 0.3), divisions=(2, 2, 2), origin=(-0.05, -0.1, -0.15))
    body = mca.Body(
        name="block",
        geometry=box,
        material=SOFT,
        rigid=True,
        velocity=(1.0, -2.0, 3.0),
        angular_velocity=(0.1, 9.0, 0.2),
    )
    return mca.Scene(name="block", bodies=(body,), impact=mca.ImpactPhase(duration=2.0, output_interval=1e-3))


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_a_body_that_tumbles_keeps_momentum_to_rounding_and_its_energy_does_not_drift(precision: str):
    impact = keeps_momentum(block(), precision=precision)
    state, (body,) = impact.state.rigid, impact.solver.model.rigid_bodies
    turned = 2.0 * np.arccos(np.abs(state.rotation.numpy()[0, 3]))
    assert turned > 0.5 and impact.steps.count > 1000
    energy = result_of(impact)["E_kinetic"]
    tenth = len(energy) // 10
    assert np.ptp(energy) / energy[0] < 2e-5
    assert abs(energy[-tenth:].max() - energy[:tenth].max()) < 1e-6 * energy[0]
    spin = body.inertia @ (0.1, 9.0, 0.2)
    assert np.abs(state.spin.numpy()[0] - spin).max() < ROUND_OFF * np.linalg.norm(spin)


def test_nodes_stay_where_the_body_has_them():
    impact = finished(block())
    model, x = impact.solver.model, impact.solver.model.X + impact.state.u.numpy()
    away = np.linalg.norm(x[:, None] - x, axis=2) - np.linalg.norm(model.X[:, None] - model.X, axis=2)
    assert np.abs(away).max() < 1e-15


def chain(rigid: str, nodes: str = "axis", spin: float = 20.0) -> mca.Scene:
    """Three free bars in a row on two hinges, which turn; those that `rigid` names are rigid."""
    pin = {"pin_radius": 0.019} if nodes == "pin" else {}
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=BAR,
            material=SOFT,
            kinematics="finite",  # whose forces have no moment, to rounding
            rigid=name in rigid,
            position=(0.3 * k, 0.0, 0.0),
            velocity=(1.0, 2.0 + 0.3 * k * spin, 0.5),
            angular_velocity=(0.0, 0.0, spin + 30.0 * (k - 1)),
        )
        for k, name in enumerate("ABC")
    )
    hinges = (("A", "B"), ("B", "C"))
    joints = tuple(
        mca.Revolute(name=a + b, body=a, at=(0.3, 0.0, 0.0), other=b, nodes=nodes, **pin)  # type: ignore[arg-type]
        for a, b in hinges
    )
    impact = mca.ImpactPhase(duration=5e-4, output_interval=1e-5)
    return mca.Scene(name="chain", bodies=bodies, joints=joints, impact=impact)


@pytest.mark.parametrize("nodes", ["axis", "pin"])
@pytest.mark.parametrize("rigid", ["B", "AC", "AB", "ABC"])
def test_hinges_of_rigid_bodies_keep_momentum_and_hold(rigid: str, nodes: str):
    impact = keeps_momentum(chain(rigid, nodes))
    model, state = impact.solver.model, impact.state
    u, found = state.u.numpy(), result_of(impact)
    if nodes == "axis":
        assert np.abs(u[model.joint_first] - u[model.joint_second]).max() < 1e-15
    points = [model.X[model.node_start[name] :][: len(model.X) // 3] for name in "ABC"]
    moved = [u[model.node_start[name] :][: len(model.X) // 3] for name in "ABC"]
    if "A" in rigid and "B" in rigid:  # the ends of a rigid bar's axis are nodes
        a = moved[0][np.linalg.norm(points[0] - (0.3, 0.0, 0.0), axis=1) < 1e-9]
        b = moved[1][np.linalg.norm(points[1] - (0.3, 0.0, 0.0), axis=1) < 1e-9]
        assert np.abs(a - b).max() < 1e-15
    impulse = found.summary["joint_impulse"]
    gained = state.rigid.momentum.numpy()[0]  # half a step behind the last record, as the impulse
    if rigid == "AC":
        (body, _) = model.rigid_bodies
        before = body.mass * model.V[body.own].mean(axis=0)
        assert nodes == "axis" or np.abs(gained - before - impulse["AB"]).max() < 1e-12 * np.abs(before).max()
    assert np.linalg.norm(impulse["AB"]) > 0.1


def test_pins_of_a_rigid_and_of_an_elastic_bar_are_alike():
    """A pendulum of two stiff bars swings alike with pins between elastic, mixed and rigid bars."""
    scene = mca.make_scene("double_pendulum", duration=0.02, samples=100, axial=4, deep=4, wide=1, E=2e9)
    pins = tuple(replace(joint, nodes="pin", pin_radius=0.09) for joint in scene.joints)
    ends = []
    for rigid in ("", "OA", "AB", "OA AB"):
        bodies = tuple(replace(body, rigid=body.name in rigid) for body in scene.bodies)
        impact = finished(replace(scene, bodies=bodies, joints=pins))
        ends.append(impact.at_last_record()[0][impact.solver.model.points[0]])
    assert np.abs(np.array(ends) - ends[-1]).max() < 1e-3 * np.linalg.norm(ends[-1])


def test_a_weld_of_a_rigid_and_an_elastic_body_is_one_body():
    spin = {"material": SOFT, "kinematics": "finite", "angular_velocity": (0.0, 0.0, 30.0)}
    left = mca.Body(name="left", geometry=BAR, rigid=True, **spin)  # type: ignore[arg-type]
    right = mca.Body(name="right", geometry=BAR, position=(0.3, 0.0, 0.0), velocity=(0.0, 9.0, 0.0), **spin)  # type: ignore[arg-type]
    weld = mca.Weld(name="w", body="right", nodes="xmin", other="left", other_nodes="xmax")
    impact = mca.ImpactPhase(duration=2e-4, output_interval=1e-5)
    scene = mca.Scene(name="weld", bodies=(left, right), joints=(weld,), impact=impact)
    start, found = begun(scene, precision="float64").state.v.numpy(), keeps_momentum(scene)
    gained = np.array(result_of(found).summary["joint_impulse"]["w"])
    right_nodes = slice(found.solver.model.node_start["right"], None)
    p = found.solver.model.mass[right_nodes] @ (found.state.v.numpy() - start)[right_nodes]
    assert np.abs(p - gained).max() < 1e-14 and p[0] < -5e-3  # pulled inwards


def ball(rigid: str, **contact: object) -> mca.Scene:
    """A ball of few cells, with their mass, strikes a free plate aslant."""
    sphere = mca.Sphere(radius=0.02, section=2, ring=1, pole_size=2e-3, pole_layers=2)
    plate = mca.Box(size=(0.03, 0.01, 0.03), divisions=(8, 3, 8), origin=(-0.015, -0.01, -0.015))
    half_turn = (0.0, 0.0, -0.5 * np.pi)
    bodies = (
        mca.Body(name="ball", geometry=sphere, material=SOFT, position=(0.0, 0.02, 0.0), rotation=half_turn),
        mca.Body(name="plate", geometry=plate, material=SOFT),
    )
    bodies = (replace(bodies[0], velocity=(3.0, -10.0, 1.0), exact_mass=False), bodies[1])
    bodies = tuple(replace(body, rigid=body.name in rigid) for body in bodies)
    surfaces = {"slave": mca.Surface(body="ball", nodes="pole"), "master": mca.Surface(body="plate", nodes="ymax")}
    return mca.Scene(
        name="ball",
        bodies=bodies,
        contacts=(mca.Contact(mu=0.2, **{**surfaces, **contact}),),  # type: ignore[arg-type]
        impact=mca.ImpactPhase(duration=1.5e-4, output_interval=1e-6, time_step_scale=0.6),
    )


OTHER_WAY = {"slave": mca.Surface(body="plate", nodes="ymax"), "master": mca.Surface(body="ball", nodes="pole")}


@pytest.mark.parametrize("contact", [{}, OTHER_WAY, {"two_way": True}], ids=["slave", "master", "two-way"])
@pytest.mark.parametrize("rigid", ["ball", "plate", "ball plate"])
def test_contact_of_rigid_bodies_keeps_momentum_and_energy(rigid: str, contact: dict[str, object]):
    impact = keeps_momentum(ball(rigid, **contact), axes=range(3))
    summary = result_of(impact).summary
    assert summary["F_n_max"] > 1e3 and summary["energy_error"] < 1e-3
    assert not summary["contact_open_at_end"] or summary["contacts"]


def test_a_rigid_body_asks_for_no_shorter_step_than_an_elastic_one():
    elastic = begun(ball("")).solver.model.stable
    for rigid in ("ball", "plate"):
        assert begun(ball(rigid)).solver.model.stable.dt >= 0.99 * elastic.dt


def test_a_rigid_block_bounces_off_a_plane_with_its_speed():
    box = mca.Box(size=(0.1, 0.1, 0.1), divisions=(2, 2, 2), origin=(-0.05, 0.001, -0.05))
    body = mca.Body(name="block", geometry=box, material=SOFT, rigid=True, velocity=(0.0, -1.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane())
    impact = mca.ImpactPhase(duration=4e-3, output_interval=1e-4)
    found = finished(mca.Scene(name="bounce", bodies=(body,), contacts=(contact,), impact=impact))
    assert found.state.v.numpy()[:, 1] == pytest.approx(1.0, abs=2e-3)
    assert found.solver.dt < 0.5e-4  # the springs, not the output interval, set the step


def test_fixed_axes_leave_a_rigid_body_what_they_do_not_hold():
    scene = ball("plate")
    plate = replace(scene.bodies[1], velocity=(2.0, 0.0, 0.0))
    fixed = mca.Fixed(body="plate", nodes="ymin", axes="yz")
    found = finished(replace(scene, bodies=(scene.bodies[0], plate), fixed=(fixed,)))
    start = found.solver.model.node_start["plate"]
    u, v = found.state.u.numpy()[start:], found.state.v.numpy()[start:]
    assert np.abs(u[:, 1:]).max() < 1e-18 and np.abs(v[:, 1:]).max() < 1e-12
    assert float(np.ptp(v[:, 0])) < 1e-12 and v[0, 0] > 2.0  # friction has pushed it on
    held = finished(replace(scene, fixed=(replace(fixed, axes="xyz"),)))
    assert np.abs(held.state.u.numpy()[start:]).max() < 1e-18


def test_independent_rows_span_all():
    rows = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1e-9, 0.0], [1.0, 1.0, 0.0]])
    assert independent(rows) == [1, 3]


PARTS = [(chain, ("B",)), (chain, ("B", "pin")), (ball, ("ball",))]


@pytest.mark.parametrize(("make", "names"), PARTS, ids=["hinges", "pins", "contact"])
@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_states_repeat_on_threads_and_go_on_from_a_file(make, names, precision: str, tmp_path: Path):
    scene = make(*names)
    one, two, again = (begun(scene, precision=precision, threads=n) for n in (1, 2, 1))
    one.advance()
    two.advance()
    assert two.solver.threads == 2 and two.state.differences(one.state) == []
    again.advance(until=one.steps.count // 3)
    again.save(tmp_path / "state")
    copy = again.state.copy()
    assert copy.differences(again.state) == []
    other = begun(scene, precision=precision)
    other.load(tmp_path / "state")
    other.advance()
    assert other.state.differences(one.state) == []


def test_scenes_of_a_batch_compute_what_they_do_alone():
    scenes = [chain("B"), chain("AB", "pin"), chain("")]
    together = begun(*scenes)
    together.advance()
    ends = np.split(together.state.u.numpy(), len(scenes))
    for scene, u in zip(scenes, ends, strict=True):
        alone = begun(scene)
        assert alone.solver.dt == together.solver.dt
        alone.advance()
        own = alone.state.u.numpy()  # beside another scene, nodes of hinges are rounded otherwise
        assert np.abs(own - u).max() <= 1e-15 * np.abs(own).max()


@pytest.mark.gpu
@pytest.mark.parametrize(("make", "names"), [*PARTS, (block, ()), (chain, ("ABC",))])
@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_a_gpu_computes_what_a_cpu_does(make, names, precision: str):
    scene = make(*names)
    here, there, again = (finished(scene, precision=precision, device=d) for d in ("cpu", "cuda:0", "cuda:0"))
    assert again.state.differences(there.state) == []
    for name in ("u", "v"):
        a, b = (getattr(found.state, name).numpy() for found in (here, there))
        assert np.abs(a - b).max() < (1e-9 if precision == "float64" else 1e-4) * np.abs(a).max(), name
    if precision == "float64":
        keeps_momentum(scene, axes=range(3), device="cuda:0")


@pytest.mark.parametrize(("name", "rigid", "t_end"), [("single_link", "OA", 0.45), ("three_link", "AB", 0.27)])
def test_cycles_of_swings_and_impacts_go_on_with_rigid_bodies(name: str, rigid: str, t_end: float):
    scene = mca.make_scene(name, **COARSE, t_end=t_end, rigid_bodies=rigid, rigid_inertia="mesh")
    run = Cycle(scene, None, Request(span=1.5e-3, settings=Settings("cpu", "float64", 1)))
    result, impacts = run.run(), run.story.impacts
    assert len(impacts) == (2 if name == "single_link" else 1)
    for part in impacts:
        assert part.back is not None
        rigid_motion, nodes = part.back.momenta
        assert np.abs(rigid_motion - nodes).max() < ROUND_OFF * np.abs(nodes).max()
    energy = result.summary["energy"]
    assert abs(energy["error"]) < 0.01 * energy["external_work"]


def test_what_a_run_says_of_rigid_bodies():
    scene = mca.make_scene("two_link", rigid_bodies="OA", duration=2e-5, section=2, ring=1, axial_OA=4, axial_AB=4)
    result = mca.run(scene)
    assert any("leave out their lines in OA: rigid bodies have no stress" in word for word in result.warnings)
    assert all(path.position.max() < 0.21 for path in result.paths)
    (body,) = result.summary["rigid_bodies"].values()
    assert body["mass"] > 0.2 and len(body["momentum"]) == len(body["spin"]) == 3
    everything = mca.run(replace(scene, bodies=tuple(replace(b, rigid=False) for b in scene.bodies)))
    assert result.summary["n_elements"] < everything.summary["n_elements"]
    assert "rigid_bodies" not in everything.summary


def test_recorders_show_rigid_bodies_without_stress(tmp_path: Path):
    from warp_mca.recorders import VtkHdfFile

    mca.run(ball("ball"), duration=2e-5, recorders=[VtkHdfFile(tmp_path / "ball.vtkhdf")])
    with h5py.File(tmp_path / "ball.vtkhdf") as file:
        root = file["VTKHDF"]
        assert set(root["CellData/body"][:]) == {0, 1}
        count = int(root["NumberOfPoints"][0])
        moved = root["PointData/displacement"][-count:]
        stress = root["PointData/von_mises"][-count:]
    first = len(mca.mesh(ball("ball"))["ball"].points)
    assert np.abs(moved[:first]).min() > 0.0 and not stress[:first].any() and stress[first:].max() > 0.0


def refusals() -> dict[str, tuple[mca.Scene, str]]:
    bars, struck = chain("B"), ball("plate")
    turned = mca.Prescribed(body="B", nodes="zmin", axis="y", times=(0.0,), velocities=(1.0,))
    slide = mca.Prismatic(name="s", body="B", nodes="xmin", axis=(1.0, 0.0, 0.0))
    moving = (struck.bodies[0], replace(struck.bodies[1], velocity=(0.0, 1.0, 0.0)))
    fixed = (mca.Fixed(body="plate", nodes="ymin", axes="y"),)
    arm = {**COARSE, "rigid_bodies": "OA"}
    torque = mca.make_scene("single_link", **arm)
    assert torque.rigid is not None
    base = mca.BaseMotion(times=(0.0,), vx=(1.0,), vy=(0.0,))
    return {
        "driven": (
            replace(bars, joints=(), prescribed=(turned,)),
            "Prescribed.body = 'B': its nodes move as one rigid body",
        ),
        "slide": (replace(bars, joints=(slide,)), "Prismatic s.body = 'B': nodes of rigid bodies are tied in all"),
        "fixed": (replace(struck, bodies=moving, fixed=fixed), "Fixed.axes = 'y': nodes of rigid body plate move"),
        "friction": (
            replace(torque, rigid=replace(torque.rigid, joint_friction=(0.1,))),
            "Body.rigid = 'OA': torque or friction in its hinge acts on nodes of flexible links",
        ),
        "base": (
            replace(torque, rigid=replace(torque.rigid, base_motion=base)),
            "Body.rigid = 'OA': a base that moves or slides acts on nodes of flexible links",
        ),
    }


@pytest.mark.parametrize("case", ["driven", "slide", "fixed", "friction", "base"])
def test_what_rigid_bodies_cannot_do_is_refused(case: str):
    scene, words = refusals()[case]
    with pytest.raises(mca.RequestError) as error:
        mca.run(scene)
    assert str(error.value).startswith(words)


def test_unknown_names_of_rigid_bodies_are_refused():
    with pytest.raises(mca.RequestError, match="rigid_bodies = 'OB': name some of OA, AB, plate"):
        mca.make_scene("two_link", rigid_bodies="OB")
    with pytest.raises(mca.RequestError, match=r"Body b\.rigid"):
        mca.Body(name="b", geometry=BAR, material=SOFT, rigid="yes")  # type: ignore[arg-type]


def test_scenes_without_rigid_bodies_hold_no_arrays_for_them():
    state = begun(chain("")).state
    assert {name: array.size for name, array in state.arrays().items() if name.startswith("rigid/")} == dict.fromkeys(
        [f"rigid/{name}" for name in ("centre", "rotation", "momentum", "spin", "orientation", "turn")], 0
    )
    assert figures(begun(chain("B")))  # and a scene with them gives figures
