"""Welds, ball joints and slides: closed forms, momentum, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from impacts import begun, finished, momentum, result_of
from test_joint import BAR, SIZE, SOFT

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.scene import model_file

HALF = mca.Box(size=(0.05, 0.02, 0.02), divisions=(5, 2, 2), origin=(0.0, -0.01, -0.01))
PULL = {"nodes": "xmin", "axis": "x", "times": (0.0, 2e-5, 4e-5), "velocities": (0.0, 2.0, 0.0)}


def pulled(joints, **bodies):
    """Bars at these x, pulled at the end of the body "a": a wave of 10 MPa."""
    return mca.Scene(
        name="pulled",
        bodies=tuple(
            mca.Body(name=name, geometry=box, material=SOFT, position=(x, 0.0, 0.0))
            for name, (box, x) in bodies.items()
        ),
        joints=joints,
        prescribed=(mca.Prescribed(body="a", **PULL),),
        impact=mca.ImpactPhase(duration=1.5e-4, output_interval=1e-5),
    )


def test_a_wave_passes_a_weld_as_it_does_the_whole_bar():
    """1 km/s: the pulse of 40 us has left the first half of the bar after 150 us and comes back from its end."""
    whole = finished(pulled((), a=(BAR, 0.0)), precision="float64")
    weld = mca.Weld(name="W", body="a", nodes="xmax", other="b", other_nodes="xmin")
    welded = finished(pulled((weld,), a=(HALF, 0.0), b=(HALF, 0.05)), precision="float64")
    model = welded.solver.model
    assert len(model.joint_first) == 9
    assert welded.steps.dt == pytest.approx(whole.steps.dt, rel=1e-12)
    places = {tuple(np.round(x, 9)): u for x, u in zip(whole.solver.model.X, whole.state.u.numpy(), strict=True)}
    expected = np.array([places[tuple(np.round(x, 9))] for x in model.X])
    assert np.ptp(expected[:, 0]) > 1e-5
    assert welded.state.u.numpy() == pytest.approx(expected, abs=1e-13)
    taken = momentum(welded, model.node_start["b"])
    assert result_of(welded).summary["joint_impulse"]["W"] == pytest.approx(-taken, abs=1e-12)


def test_a_bar_welded_to_the_ground_moves_as_one_with_a_fixed_end():
    free = pulled((), a=(BAR, 0.0))
    fixed = mca.Scene(**{**vars(free), "fixed": (mca.Fixed(body="a", nodes="xmax"),)})
    expected = finished(fixed, precision="float64").state.u.numpy()
    weld = mca.Weld(name="W", body="a", nodes="xmax")
    impact = finished(mca.Scene(**{**vars(free), "joints": (weld,)}), precision="float64")
    assert impact.state.u.numpy() == pytest.approx(expected, abs=1e-15)
    assert result_of(impact).summary["joint_impulse"]["W"][0] < -1e-3


def test_a_rod_on_a_ball_joint_precesses():
    """A steady conical pendulum, omega^2 (I_t - I_a) cos(tilt) = m g d, keeps its angular momentum about the vertical.

    It sags by some 0.2 mm, for it starts free of stress.
    """
    tilt, gravity = 0.5, 1e4
    box = mca.Body(name="rod", geometry=BAR, material=SOFT)
    still = mca.Scene(name="rod", bodies=(box,), impact=mca.ImpactPhase(duration=1e-3))
    points, mass = mca.mesh(still)["rod"].points, nodal_masses(still, mca.mesh(still))["rod"]
    square = mass @ points**2
    omega = math.sqrt(mass @ points[:, 0] * gravity / ((square[0] - square[1]) * math.cos(tilt)))
    rotation = (0.0, 0.0, tilt - math.pi / 2)  # hangs towards -y, tilted to +x
    rod = mca.Body(
        name="rod",
        geometry=BAR,
        material=SOFT,
        rotation=rotation,
        kinematics="finite",
        angular_velocity=(0.0, omega, 0.0),
    )
    scene = mca.Scene(
        name="rod",
        bodies=(rod,),
        joints=(mca.Spherical(name="S", body="rod", at=(0.0, 0.0, 0.0)),),
        gravity=(0.0, -gravity, 0.0),
        impact=mca.ImpactPhase(duration=0.25 * 2.0 * math.pi / omega, output_interval=1e-4),
    )
    impact = finished(scene, precision="float64")
    summary, model = result_of(impact).summary, impact.solver.model
    u, v = impact.state.u.numpy(), impact.state.v.numpy()
    x = model.X + u
    assert np.abs(u[model.joint_first]).max() == 0.0
    spin = [model.mass @ np.cross(a, b)[:, 1] for a, b in ((model.X, model.V), (x, v))]
    assert spin[1] == pytest.approx(spin[0], rel=1e-11)
    middle = mass @ x / mass.sum()
    angle = omega * (summary["simulated_time"] + summary["dt"])
    expected = rotation_matrix((0.0, angle, 0.0)) @ rotation_matrix(rotation) @ (0.05, 0.0, 0.0)
    assert middle == pytest.approx(expected, abs=3e-4)
    weight = np.array([0.0, -gravity, 0.0]) * mass.sum() * (angle / omega)
    change = mass @ v - mass @ model.V
    assert np.array(summary["joint_impulse"]["S"]) == pytest.approx(change - weight, abs=1e-3 * abs(weight[1]))


def test_bars_on_a_ball_joint_keep_momentum_and_angular_momentum():
    """One turns about y and one about z; the start, where their speeds at the joint differ, is inelastic."""
    kind = {"geometry": BAR, "material": SOFT, "kinematics": "finite"}
    scene = mca.Scene(
        name="bars",
        bodies=(
            mca.Body(name="a", angular_velocity=(0.0, 0.0, 20.0), **kind),
            mca.Body(name="b", position=(0.1, 0.0, 0.0), angular_velocity=(0.0, 30.0, 0.0), **kind),
        ),
        joints=(mca.Spherical(name="S", body="a", at=(0.1, 0.0, 0.0), other="b"),),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4, energy_tolerance=1.0),
    )
    impact = finished(scene, precision="float64")
    model, u, v = impact.solver.model, impact.state.u.numpy(), impact.state.v.numpy()
    assert momentum(impact) == pytest.approx(model.mass @ model.V, abs=1e-14)
    before, after = (model.mass @ np.cross(x, w) for x, w in ((model.X, model.V), (model.X + u, v)))
    assert np.abs(before).min() < 1e-12 and np.abs(before).max() > 1e-3
    assert after == pytest.approx(before, abs=1e-14)
    assert (u[model.joint_first] == u[model.joint_second]).all()


def test_a_block_slides_on_its_rail_by_the_gravity_along_it():
    """The rail takes what is across it, and no more: along it the momentum is m (g . a) t to rounding."""
    axis, gravity = np.array([0.6, 0.0, 0.8]), np.array([2e3, -9e3, 1e3])
    rotation = (0.0, 0.3, 0.0)
    scene = mca.Scene(
        name="slide",
        bodies=(mca.Body(name="block", geometry=HALF, material=SOFT, rotation=rotation),),
        joints=(mca.Prismatic(name="P", body="block", nodes="ymin", axis=tuple(rotation_matrix(rotation).T @ axis)),),
        gravity=tuple(gravity),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-5),
    )
    impact = finished(scene, precision="float64")
    summary, model, gained = result_of(impact).summary, impact.solver.model, momentum(impact)
    t, mass = summary["simulated_time"] + 0.5 * summary["dt"], model.mass.sum()
    assert gained @ axis == pytest.approx(mass * (gravity @ axis) * t, rel=1e-12)
    u = impact.state.u.numpy()[model.joint_first]
    assert u - np.outer(u @ axis, axis) == pytest.approx(0.0, abs=1e-15)
    assert summary["energy_error"] < 1e-4
    impulse = np.array(summary["joint_impulse"]["P"])
    assert impulse @ axis == pytest.approx(0.0, abs=1e-12 * np.abs(impulse).max())
    across = gravity - (gravity @ axis) * axis
    assert impulse == pytest.approx(gained - (gained @ axis) * axis - mass * across * t, rel=1e-9)


RAIL = mca.Box(size=(0.1, 0.02, 0.01), divisions=(10, 4, 2), origin=(0.0, -0.01, -0.01))
CART = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2, 2, 2), origin=(0.01, -0.005, 0.0))
SLIDE = {"name": "P", "body": "cart", "nodes": "zmin", "other": "rail", "other_nodes": "zmax"}


def cart(spin=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), duration=5e-4, **change):
    """A block on three lines of nodes of a bar that turns about the same point; both strain as finite."""
    kind = {"material": SOFT, "kinematics": "finite", "angular_velocity": spin}
    return mca.Scene(
        name="cart",
        bodies=(
            mca.Body(name="rail", geometry=RAIL, **kind),
            mca.Body(name="cart", geometry=CART, velocity=velocity, **kind),
        ),
        joints=(mca.Prismatic(**{**SLIDE, "axis": (1.0, 0.0, 0.0), **change}),),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-5),
    )


def test_a_cart_slides_along_its_rail_without_a_force():
    """It crosses five cells of the rail at 50 m/s, and bends nothing."""
    impact = finished(cart(velocity=(50.0, 0.0, 0.0), duration=1e-3), precision="float64")
    summary, u, start = result_of(impact).summary, impact.state.u.numpy(), impact.solver.model.node_start["cart"]
    t = summary["simulated_time"] + summary["dt"]
    assert u[:start] == pytest.approx(0.0, abs=1e-15)
    assert u[start:] == pytest.approx(np.broadcast_to([50.0 * t, 0.0, 0.0], u[start:].shape), rel=1e-9)
    assert summary["joint_impulse"]["P"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)


def test_a_cart_on_a_turning_rail_keeps_momentum_and_energy():
    """Momentum and angular momentum of both bodies to rounding; the cart is driven outwards as far as a rigid one."""
    omega, duration = 150.0, 3e-3
    impact = finished(cart(spin=(0.0, 0.0, omega), duration=duration), precision="float64")
    model, v = impact.solver.model, impact.state.v.numpy()
    x, m, start = model.X + impact.state.u.numpy(), model.mass, model.node_start["cart"]
    assert m @ v == pytest.approx(m @ model.V, abs=1e-12 * np.abs(m @ np.abs(model.V)).max())
    before, after = m @ np.cross(model.X, model.V), m @ np.cross(x, v)
    assert after == pytest.approx(before, abs=1e-11 * np.abs(before).max())
    assert result_of(impact).summary["energy_error"] < 1e-3
    ends = x[(model.joint_first[model.joint_slides[:, 1:] - [0, 1]])]
    along = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    for (first, begin, _), end, line in zip(model.joint_slides, ends, along, strict=True):
        offset = x[model.joint_first[first:begin]] - end[0]
        off = offset - np.outer(offset @ line, line)
        assert np.abs(off[:, 1:]).max() < 3e-4  # the rail bends by so much
    assert moved(x, m, start) - moved(model.X, m, start) == pytest.approx(slid(model, start, omega, duration), rel=0.02)


def moved(x, m, start):
    """Distance between the centres of mass of the two bodies along x, y [m]."""
    rail, cart = (m[part] @ x[part] / m[part].sum() for part in (slice(start), slice(start, None)))
    return float(np.linalg.norm((cart - rail)[:2]))


def slid(model, start, omega, duration):
    """How far a rigid cart slides on a rigid rail that turns freely, s'' = s w^2 with (I + mu s^2) w constant [m]."""
    from scipy.integrate import solve_ivp

    m, x = model.mass, model.X
    parts = slice(start), slice(start, None)
    centres = [m[part] @ x[part] / m[part].sum() for part in parts]
    inertia = sum(m[part] @ ((x[part] - c)[:, :2] ** 2).sum(axis=1) for part, c in zip(parts, centres, strict=True))
    reduced = m[parts[0]].sum() * m[parts[1]].sum() / m.sum()
    s = centres[1][0] - centres[0][0]
    spin = (inertia + reduced * s**2) * omega
    path = solve_ivp(
        lambda _, y: [y[1], y[0] * (spin / (inertia + reduced * y[0] ** 2)) ** 2], (0.0, duration), [s, 0.0], rtol=1e-9
    )
    return abs(path.y[0, -1]) - abs(s)


def test_carts_of_a_batch_slide_as_each_does_alone():
    scenes = [cart(spin=(0.0, 0.0, omega), duration=2e-4) for omega in (100.0, 150.0)]
    for scene, result in zip(scenes, mca.run_batch(scenes), strict=True):
        impulse = mca.run(scene).summary["joint_impulse"]["P"]
        assert max(map(abs, impulse)) > 1e-6
        assert result.summary["joint_impulse"]["P"] == pytest.approx(impulse, rel=1e-6, abs=1e-12)


def test_a_model_file_holds_each_kind(tmp_path):
    joints = (
        mca.Weld(**WELD, other="b", other_nodes="xmin"),
        mca.Spherical(name="S", body="a", at=(0.0, 0.0, 0.0)),
        mca.Prismatic(name="P", body="b", nodes="xmax", axis=(0.0, 1.0, 0.0)),
    )
    scene = mca.Scene(**{**vars(two(joints[0])), "joints": joints})
    model_file.save(tmp_path / "two.mca", scene, mca.mesh(scene))
    assert model_file.load(tmp_path / "two.mca").scene.joints == joints


def test_a_slide_without_rails_is_refused():
    with pytest.raises(mca.RequestError, match=r"Prismatic P.nodes = 'zmin': 0 of these nodes are on lines of zmax of"):
        mca.run(cart(axis=(0.0, 0.0, 1.0)))
    with pytest.raises(mca.RequestError, match=r"Prismatic P.other_nodes = None: name a node set of the other body"):
        cart(other_nodes=None)


def two(joint, **change):
    """Two bars end on, and a joint between them."""
    bodies = (
        mca.Body(name="a", geometry=BAR, material=SOFT),
        mca.Body(name="b", geometry=change.pop("other", BAR), material=SOFT, position=(0.1, 0.0, 0.0)),
    )
    return mca.Scene(name="two", bodies=bodies, joints=(joint,), impact=mca.ImpactPhase(duration=1e-5), **change)


WELD = {"name": "W", "body": "a", "nodes": "xmax"}
FINE = mca.Box(**SIZE, divisions=(10, 3, 3), origin=(0.0, -0.01, -0.01))


@pytest.mark.parametrize(
    ("joint", "change", "match"),
    [
        ({**WELD, "other": "b"}, {}, "Weld W.other_nodes = None: name a node set of the other body"),
        ({**WELD, "other_nodes": "xmin"}, {}, "Weld W.other_nodes = 'xmin': leave it out"),
        ({**WELD, "other": "a", "other_nodes": "xmin"}, {}, "Weld W.other = 'a': name a body other"),
        ({**WELD, "other": "c", "other_nodes": "xmin"}, {}, "Weld W.other = 'c': the scene's bodies are a, b"),
        ({**WELD, "other": "b", "other_nodes": "xmax"}, {}, "Weld W.nodes = 'xmax': 0 of these nodes coincide"),
        ({**WELD, "nodes": "no such"}, {}, "no such"),
        ({**WELD}, {"fixed": (mca.Fixed(body="a", nodes="ymin"),)}, "a node of a joint is also fixed or driven"),
    ],
)
def test_welds_that_tie_nothing_are_refused(joint, change, match):
    with pytest.raises(mca.RequestError, match=match):
        mca.run(two(mca.Weld(**joint), **change))


def test_a_weld_ties_the_nodes_that_coincide():
    """3 x 3 cells on 2 x 2: only the corners do."""
    impact = begun(two(mca.Weld(**WELD, other="b", other_nodes="xmin"), other=FINE))
    assert len(impact.solver.model.joint_first) == 4


@pytest.mark.parametrize(
    ("joint", "match"),
    [
        (lambda: mca.Spherical(name="S", body="a", at=(0.104, 0, 0)), "at = .*: the nearest node of a is 0.004 m away"),
        (lambda: mca.Spherical(name="S", body="a", at=(0.1, 0, 0), other="b", other_at=(0.1, 0, 0)), "do not coincide"),
        (lambda: mca.Prismatic(name="P", body="a", nodes="xmin", axis=(0.0, 0.0, 0.0)), "other than zero"),
    ],
)
def test_joints_without_place_or_direction_are_refused(joint, match):
    with pytest.raises(mca.RequestError, match=match):
        mca.run(two(joint()))


def test_joints_have_names_of_their_own():
    joints = tuple(mca.Spherical(name="S", body="a", at=(x, 0.0, 0.0)) for x in (0.0, 0.1))
    with pytest.raises(mca.RequestError, match=r"Scene.joints = \['S', 'S'\]: give each joint a name of its own"):
        mca.Scene(**{**vars(two(joints[0])), "joints": joints})


def test_a_swing_hangs_on_hinges_only():
    scene = mca.make_scene("two_link")
    joints = (*scene.joints, mca.Spherical(name="S", body="AB", at=(0.0, 0.0, 0.0)))
    with pytest.raises(mca.RequestError, match=r"Scene.joints = 'Spherical S': the links of a rigid phase hang on Rev"):
        mca.run(mca.Scene(**{**vars(scene), "joints": joints}))


def _welded(own: int, other: int) -> list[str]:
    """Warnings about two blocks, one on the other, with so many cells along the edges of their common face."""
    lower, upper = (
        mca.Body(
            name=name,
            geometry=mca.Box(size=(0.02, 0.02, 0.02), divisions=(count, count, 2)),
            material=mca.Elastic(E=1e9, nu=0.3, rho=1e3),
            position=(0.0, 0.0, place),
        )
        for name, count, place in (("lower", other, 0.0), ("upper", own, 0.02))
    )
    joint = mca.Weld(name="w", body="upper", other="lower", nodes="zmin", other_nodes="zmax")
    scene = mca.Scene(name="welded", bodies=(lower, upper), joints=(joint,), impact=mca.ImpactPhase(duration=1e-6))
    return [text for text in mca.run(scene, device="cpu", threads=1).warnings if text.startswith("joint w")]


def test_a_weld_of_unequal_meshes_says_how_many_nodes_it_binds():
    assert _welded(4, 4) == []
    (text,) = _welded(3, 4)
    assert text.startswith(
        "joint w binds 4 of the 16 nodes zmin of upper to the 25 nodes zmax of lower; the others are"
    )


def test_pins_of_rigid_bodies_whose_axes_cross_are_a_wrist():
    """Two hinges through the middle of a cube: each spin stays, and the second axis turns with the first one.

    Their nodes would be the same; between rigid bodies they need none. The scene keeps what it was given, so that a
    copy with flexible bodies is refused for the nodes that both take.
    """
    middle, first, second, span = (0.02,) * 3, 5.0, 3.0, 0.02
    cube = mca.Box(size=(0.04,) * 3, divisions=(4,) * 3)

    def body(name: str, spin: tuple[float, float, float], rigid: bool = True) -> mca.Body:
        about = tuple(np.cross(middle, spin))
        metal = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
        return mca.Body(name=name, geometry=cube, material=metal, rigid=rigid, angular_velocity=spin, velocity=about)

    def hinge(name: str, on: str, other: str | None, axis: tuple[float, float, float]) -> mca.Revolute:
        return mca.Revolute(
            name=name, body=on, other=other, at=middle, other_at=middle, axis=axis, nodes="pin", pin_radius=0.012
        )

    scene = mca.Scene(
        name="wrist",
        bodies=(body("b", (0.0, 0.0, first)), body("c", (second, 0.0, first))),
        joints=(hinge("one", "b", None, (0.0, 0.0, 1.0)), hinge("two", "c", "b", (1.0, 0.0, 0.0))),
        impact=mca.ImpactPhase(duration=span),
    )
    found = mca.run(scene, precision="float64").summary["rigid_bodies"]
    turn = first * span
    rates = {name: np.array(own["spin"]) / own["inertia"][0][0] for name, own in found.items()}
    assert rates["b"] == pytest.approx([0.0, 0.0, first], abs=1e-3)
    assert rates["c"] == pytest.approx([second * np.cos(turn), second * np.sin(turn), first], abs=0.01)
    with pytest.raises(mca.RequestError, match="a node is tied twice"):
        mca.run(replace(scene, bodies=tuple(replace(one, rigid=False) for one in scene.bodies)))
