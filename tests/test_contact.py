"""Contact: closest points, stick-slip, momentum, sliding friction and the guards."""

import numpy as np
import pytest
import warp as wp
from scipy.optimize import minimize

import warp_mca as mca
from warp_mca import solver
from warp_mca.kernels.friction import release, stick_slip
from warp_mca.kernels.projection import closest_point, interpolate, shape

SOFT = mca.Elastic(E=1e9, nu=0.2, rho=1000.0)


@wp.kernel(enable_backward=False, module="unique")
def project(x: wp.array(dtype=wp.vec3d), quad: wp.array(dtype=wp.vec3d), point_out: wp.array(dtype=wp.vec3d)):
    at = closest_point(x[0], quad[0], quad[1], quad[2], quad[3])
    point_out[0] = interpolate(shape(at[0], at[1]), quad[0], quad[1], quad[2], quad[3])


def test_closest_point_of_a_warped_face_is_the_nearest():
    rng = np.random.default_rng(0)
    for _ in range(20):
        quad = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]) + rng.uniform(-0.1, 0.1, (4, 3))
        x = np.array([*rng.uniform(0.2, 0.8, 2), rng.uniform(-0.2, 0.2)])
        out = wp.full(1, np.nan, dtype=wp.vec3d, device="cpu")
        inputs = [wp.array(x[None], dtype=wp.vec3d, device="cpu"), wp.array(quad, dtype=wp.vec3d, device="cpu")]
        wp.launch(project, 1, inputs=inputs, outputs=[out], device="cpu")

        def distance(s, quad=quad, x=x):
            a, b = s
            weights = 0.25 * np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)])
            return ((x - weights @ quad) ** 2).sum()

        best = minimize(distance, [0.0, 0.0], tol=1e-14)
        assert np.sqrt(((out.numpy()[0] - x) ** 2).sum()) == pytest.approx(np.sqrt(best.fun), rel=1e-7)


@wp.kernel(enable_backward=False, module="unique")
def slide(
    du: wp.array(dtype=wp.vec3d),
    limit: wp.array(dtype=wp.float64),
    k: wp.float64,
    f_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    stick_out: wp.array(dtype=wp.int32),
):
    f = wp.vec3d()
    for i in range(du.shape[0]):
        f, work, stick = stick_slip(f, du[i], wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0)), limit[i], k)
        f_out[i] = f
        work_out[i] = work
        stick_out[i] = stick
    work_out[du.shape[0]] = release(f, wp.vec3d(), k)


def test_stick_slip_stays_on_the_cone_and_balances_its_energy():
    """Work put in, trapezoidal, equals the change of spring energy plus what was dissipated, with varying F_n."""
    rng = np.random.default_rng(1)
    n, k = 200, 3e6
    du, limit = rng.normal(0.0, 1e-6, (n, 3)), rng.uniform(0.5, 6.0, n)
    f, work = wp.zeros(n, dtype=wp.vec3d, device="cpu"), wp.zeros(n + 1, dtype=wp.float64, device="cpu")
    stick = wp.zeros(n, dtype=wp.int32, device="cpu")
    inputs = [wp.array(du, dtype=wp.vec3d, device="cpu"), wp.array(limit, dtype=wp.float64, device="cpu"), k]
    wp.launch(slide, 1, inputs=inputs, outputs=[f, work, stick], device="cpu")
    force, work, stick = f.numpy(), work.numpy(), stick.numpy()
    before = np.concatenate([np.zeros((1, 3)), force[:-1]])
    size = np.linalg.norm(force, axis=1)
    assert (size <= limit * (1.0 + 1e-12)).all()
    assert size[stick == 0] == pytest.approx(limit[stick == 0], rel=1e-12)
    assert 20 < stick.sum() < n - 20
    assert np.abs(force[:, 1]).max() == 0.0
    put_in = -(0.5 * (force + before) * du).sum()
    stored = 0.5 * (force[-1] ** 2).sum() / k
    assert put_in == pytest.approx(stored + work[:n].sum(), rel=1e-10)
    assert work[n] == pytest.approx(stored, rel=1e-12)


def two_boxes(**contact):
    """A small box flies at 2 m/s, aslant, into a larger one that is free."""
    small = mca.Box(size=(0.02, 0.02, 0.02), divisions=(3, 3, 3), origin=(-0.011, 0.0, -0.012))
    large = mca.Box(size=(0.06, 0.03, 0.06), divisions=(5, 3, 5), origin=(-0.03, -0.03, -0.03))
    return mca.Scene(
        name="boxes",
        bodies=(
            mca.Body(name="small", geometry=small, material=SOFT, velocity=(0.7, -2.0, 0.3)),
            mca.Body(name="large", geometry=large, material=SOFT),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="small", nodes="ymin"), master=mca.Surface(body="large", nodes="ymax"), **contact
            ),
        ),
        impact=mca.ImpactPhase(duration=1.5e-4, output_interval=5e-6),
    )


@pytest.mark.parametrize("two_way", [False, True])
def test_collision_keeps_momentum_and_impulse_is_its_change(two_way, monkeypatch):
    final = {}

    def keep(self):
        final["v"], final["mass"] = self.v.numpy(), self.model.mass
        return 0.0

    monkeypatch.setattr(solver.Solver, "max_plastic_strain", keep)
    result = mca.run(two_boxes(mu=0.4, two_way=two_way), precision="float64")
    momentum = final["mass"] @ final["v"]
    mass = 1000.0 * 0.02**3
    assert momentum == pytest.approx(mass * np.array([0.7, -2.0, 0.3]), rel=1e-10)
    small = (final["mass"][:64] @ final["v"][:64]) - mass * np.array([0.7, -2.0, 0.3])
    dt = result.time[1]
    assert (result.F_n * dt).sum() == pytest.approx(small[1], rel=1e-9)
    assert (result.F_t * dt).sum() == pytest.approx(small[0], rel=1e-9)
    assert small[1] > 1.2 * mass * 2.0
    assert result.summary["energy_error"] < 2e-3


def sliding_block(mu, *, velocity=(1.0, 0.0, 0.0), belt=(0.0, 0.0, 0.0), duration=6e-3):
    """A block pressed on a plane by strong gravity, from rest on its springs."""
    box = mca.Box(size=(0.02, 0.01, 0.02), divisions=(2, 1, 2))
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", geometry=box, material=SOFT, velocity=velocity),),
        contacts=(
            mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(velocity=belt), mu=mu),
        ),
        gravity=(0.0, -1000.0, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=2e-5),
        tip=mca.Point(body="block", at=(0.01, 0.005, 0.01)),
    )


def test_block_slides_to_rest_by_friction():
    """It stops after v / (mu g) = 2.5 ms, v^2 / (2 mu g) on, and its kinetic energy has gone into friction."""
    result = mca.run(sliding_block(0.4))
    mass = 1000.0 * 4e-6
    moving = result.time < 2.3e-3
    assert result.F_t[moving].mean() == pytest.approx(-0.4 * mass * 1000.0, rel=0.02)
    assert result["tip_vx"][result.time > 3e-3] == pytest.approx(0.0, abs=0.03)
    distance = (result["tip_vx"] * result.time[1]).sum()
    assert distance == pytest.approx(1.0 / (2.0 * 0.4 * 1000.0), rel=0.02)
    assert result["E_friction"][-1] == pytest.approx(0.5 * mass, rel=0.01)
    assert result.summary["energy_error"] < 2e-3  # contacts open and close half a step early or late
    assert result["stick_fraction"][-1] > 0.9 > 0.1 > result["stick_fraction"][20]


def test_belt_drags_a_block_up_to_its_speed():
    result = mca.run(sliding_block(0.4, velocity=(0.0, 0.0, 0.0), belt=(1.0, 0.0, 0.0)))
    assert result["tip_vx"][np.searchsorted(result.time, 1.25e-3)] == pytest.approx(0.5, abs=0.05)  # it bounces
    assert result["tip_vx"][-1] == pytest.approx(1.0, rel=0.03)
    assert result.summary["energy_error"] < 1e-3


def test_without_friction_nothing_tangential_is_left():
    result = mca.run(sliding_block(0.0, duration=1e-3))
    assert np.abs(result.F_t).max() == 0.0
    assert result["E_friction"].max() == 0.0
    assert result["tip_vx"] == pytest.approx(1.0, rel=1e-6)  # rounding of float32 forces


def test_full_candidate_list_stops_the_run(monkeypatch):
    monkeypatch.setattr(solver, "LIST_LENGTH", 1)
    with pytest.raises(mca.GuardError, match="contact lists overflowed"):
        mca.run(two_boxes())


def test_node_that_outruns_the_search_stops_the_run(monkeypatch):
    monkeypatch.setattr("warp_mca.simulation.SPEED_RESERVE", 1e-9)
    scene = two_boxes()
    slow = mca.Scene(**{**vars(scene), "impact": mca.ImpactPhase(duration=4e-3, output_interval=4e-3)})
    with pytest.raises(mca.GuardError, match="outran the contact search"):
        mca.run(slow)


def test_deep_penetration_stops_the_run():
    with pytest.raises(mca.GuardError, match="sank deeper"):
        mca.run(two_boxes(penalty=1e-7), duration=4e-3)


def test_coarse_output_searches_often_enough():
    """Output every 50 us needs several searches an interval; the forces are those of fine output."""
    fine = mca.run(two_boxes(mu=0.4), duration=1e-4)
    scene = two_boxes(mu=0.4)
    coarse = mca.run(mca.Scene(**{**vars(scene), "impact": mca.ImpactPhase(duration=1e-4, output_interval=5e-5)}))
    assert coarse.F_n[1:] == pytest.approx([fine.F_n[1:11].mean(), fine.F_n[11:21].mean()], abs=0.01 * fine.F_n.max())
