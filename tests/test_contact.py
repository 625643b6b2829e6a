"""Contact: closest points, stick-slip, momentum, sliding friction and the guards."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from impacts import finished, momentum, prepared, result_of
from scipy.optimize import minimize

import warp_mca as mca
from warp_mca.kernels.contact import contact, search
from warp_mca.kernels.contact.friction import release, stick_slip
from warp_mca.kernels.contact.projection import bilinear, closest_point, interpolate, shape
from warp_mca.phases.division import divide
from warp_mca.physics.contact.surfaces import contact_passes, make_faces

SOFT = mca.Elastic(E=1e9, nu=0.2, rho=1000.0)


@wp.kernel(enable_backward=False, module="unique")
def project(x: wp.array(dtype=wp.vec3d), quad: wp.array(dtype=wp.vec3d), point_out: wp.array(dtype=wp.vec3d)):
    m, e, f, t = bilinear(quad[0], quad[1], quad[2], quad[3])
    at = closest_point(x[0] - m, e, f, t)
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
def test_collision_keeps_momentum_and_impulse_is_its_change(two_way):
    impact = finished(two_boxes(mu=0.4, two_way=two_way), precision="float64")
    result, initial = result_of(impact), 1000.0 * 0.02**3 * np.array([0.7, -2.0, 0.3])
    assert momentum(impact) == pytest.approx(initial, rel=1e-10)
    small = momentum(impact, 0, 64) - initial
    dt = result.time[1]
    assert (result.F_n * dt).sum() == pytest.approx(small[1], rel=1e-9)
    assert (result.F_t * dt).sum() == pytest.approx(small[0], rel=1e-9)
    assert small[1] > -1.2 * initial[1]
    assert result.summary["energy_error"] < 2e-3


MASS, GRAVITY, PENALTY = 4e-3, 1e3, 0.01  # of the sliding block [kg], [m/s^2], [-]
SPRINGS = 9 * PENALTY * SOFT.bulk_modulus * 0.01  # stiffness under its nine nodes, f K A^2 / V each [N/m]


def sliding_block(mu, *, velocity=(1.0, 0.0, 0.0), belt=(0.0, 0.0, 0.0), duration=6e-3):
    """A block pressed on a plane by strong gravity, from rest on its springs."""
    box = mca.Box(size=(0.02, 0.01, 0.02), divisions=(2, 1, 2))
    plane = mca.RigidPlane(point=(0.0, MASS * GRAVITY / SPRINGS, 0.0), normal=(0.0, 3.0, 0.0), velocity=belt)
    surface = mca.Surface(body="block", nodes="ymin")
    undamped = {"penalty": PENALTY, "initial_overlap": "press", "law": mca.Penalty()}
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", geometry=box, material=SOFT, velocity=velocity),),
        contacts=(mca.Contact(slave=surface, master=plane, mu=mu, **undamped),),
        gravity=(0.0, -GRAVITY, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=2e-5),
        tip=mca.Point(body="block", at=(0.01, 0.005, 0.01)),
    )


def test_block_slides_to_rest_by_friction():
    """It stops after v / (mu g) = 2.5 ms, v^2 / (2 mu g) on, and its kinetic energy has gone into friction.

    What is left swings on the tangential springs with a speed of mu g / omega, omega = sqrt(springs / mass).
    """
    result = mca.run(sliding_block(0.4))
    moving, swing = (result.time > 0.0) & (result.time < 2.3e-3), 0.4 * GRAVITY / np.sqrt(SPRINGS / MASS)
    assert result.F_t[moving].mean() == pytest.approx(-0.4 * MASS * GRAVITY, rel=5e-3)
    assert np.abs(result["tip_vx"][result.time > 2.6e-3]).max() == pytest.approx(swing, rel=0.3)  # it also rocks
    slip = 0.5 * result.time[1] * (result["tip_vx"][1:] + result["tip_vx"][:-1])
    assert slip.sum() == pytest.approx(1.0 / (2.0 * 0.4 * GRAVITY), rel=5e-3)
    work = (0.4 * result.F_n[1:] * slip)[moving[1:]].sum()
    assert result["E_friction"][moving][-1] == pytest.approx(work, rel=2e-3)
    assert result["E_friction"][-1] == pytest.approx(0.5 * MASS * (1.0 - swing**2), rel=1e-3)
    assert result.summary["energy_error"] < 1e-7
    assert result["stick_fraction"][-1] > 0.9 > 0.1 > result["stick_fraction"][20]


def test_belt_under_a_block_is_a_block_on_a_plane_seen_from_elsewhere():
    """The same forces, and the belt's work is accounted for."""
    slides = mca.run(sliding_block(0.4), precision="float64")
    carried = mca.run(sliding_block(0.4, velocity=(0.0, 0.0, 0.0), belt=(-1.0, 0.0, 0.0)), precision="float64")
    assert carried.F_t == pytest.approx(slides.F_t, abs=1e-5)
    assert carried["E_friction"] == pytest.approx(slides["E_friction"], abs=1e-8)
    assert carried["tip_vx"] == pytest.approx(slides["tip_vx"] - 1.0, abs=1e-5)
    assert carried.summary["energy_error"] < 1e-7


def test_sticking_contact_gives_its_energy_back():
    """A nudge below the cone swings on the tangential springs for ever and dissipates nothing at all."""
    result = mca.run(sliding_block(0.4, velocity=(1e-3, 0.0, 0.0)))
    assert result["E_friction"].max() == 0.0
    assert (result["stick_fraction"] == 1.0).all()
    assert np.abs(result.F_t).max() == pytest.approx(1e-3 * np.sqrt(SPRINGS * MASS), rel=0.1)
    assert result["tip_vx"].max() == pytest.approx(1e-3, rel=0.02)
    assert result["tip_vx"].min() == pytest.approx(-1e-3, rel=0.02)
    assert result.summary["energy_error"] < 1e-6


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_force_is_smooth_where_a_node_slides_from_face_to_face(mu):
    """A block crosses five faces of a flat plate, and presses on it just as one that crosses none."""

    def crossing(cells):
        block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1), origin=(0.003, 0.0, 0.003))
        depth = 1000.0 * 1e-6 * GRAVITY / (4 * PENALTY * SOFT.bulk_modulus * 0.01)
        plate = mca.Box(size=(0.06, 0.01, 0.02), divisions=(cells, 1, 1), origin=(0.0, depth - 0.01, 0.0))
        contact = mca.Contact(
            slave=mca.Surface(body="block", nodes="ymin"),
            master=mca.Surface(body="plate", nodes="ymax"),
            mu=mu,
            penalty=PENALTY,
            initial_overlap="press",
        )
        scene = mca.Scene(
            name="crossing",
            bodies=(
                mca.Body(name="block", geometry=block, material=SOFT, velocity=(6.0, 0.0, 0.0)),
                mca.Body(name="plate", geometry=plate, material=mca.Elastic(E=1e12, nu=0.2, rho=1e9)),  # sets no step
            ),
            contacts=(contact,),
            fixed=(mca.Fixed(body="plate", nodes="ymin"), mca.Fixed(body="plate", nodes="ymax")),
            gravity=(0.0, -GRAVITY, 0.0),
            impact=mca.ImpactPhase(duration=6e-3, output_interval=2e-5),
        )
        return mca.run(scene, precision="float64")

    many, one = crossing(10), crossing(1)
    assert many.F_n == pytest.approx(one.F_n, abs=1e-6)
    assert many.F_t == pytest.approx(one.F_t, abs=1e-6)
    assert one.F_n[1:].mean() == pytest.approx(1.0, rel=0.01)
    assert many.summary["energy_error"] < 1e-8


def test_without_friction_nothing_tangential_is_left():
    impact = finished(sliding_block(0.0, duration=1e-3))
    result, (stage,) = result_of(impact), impact.solver.contacts
    assert np.abs(result.F_t).max() == 0.0
    assert result["E_friction"].max() == 0.0
    assert result["tip_vx"] == pytest.approx(1.0, rel=1e-6)  # rounding of float32 forces
    assert stage.kernel is contact.plane_kernel(False, False, True, stage.laws)


def test_springs_are_empty_after_a_bounce():
    """What they held is paid back or dissipated; nothing waits for the next touch."""
    impact = finished(sliding_block(0.4, velocity=(1.0, 5.0, 0.0), duration=1e-3))
    result, (own,) = result_of(impact), impact.state.contacts
    assert (own.spring.face.numpy() == -1).all()
    for name in ("tangential", "force", "energy"):
        assert np.abs(getattr(own.spring, name).numpy()).max() == 0.0
    assert result["E_friction"][-1] > 0.0 == result["E_contact"][-1]
    assert np.abs(result.F_n[-5:]).max() == 0.0


def bars(nodes, *, gap=1e-4, ratio=1, **contact):
    """A bar of 10 x 10 mm meets one of 12 x 12 mm end to end at 2 m/s; the master is `nodes` of the latter."""
    thin = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2 * ratio, ratio, ratio), origin=(-0.02 - gap, -0.005, -0.005))
    thick = mca.Box(size=(0.024, 0.012, 0.012), divisions=(2, 1, 1), origin=(0.0, -0.006, -0.006))
    return mca.Scene(
        name="bars",
        bodies=(
            mca.Body(name="thin", geometry=thin, material=SOFT, velocity=(2.0, 0.0, 0.0)),
            mca.Body(name="thick", geometry=thick, material=SOFT),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="thin", nodes="xmax"), master=mca.Surface(body="thick", nodes=nodes), **contact
            ),
        ),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-6),
    )


@pytest.mark.parametrize("gap", [1e-4, 0.0])
def test_closed_surface_pushes_as_the_face_that_is_touched(gap):
    """Nodes in front of the end are 1 mm behind the sides, and count as in front of these until they come through."""
    end, skin = (mca.run(bars(nodes, gap=gap, ratio=3), precision="float64") for nodes in ("xmin", "boundary"))
    assert end["E_contact"].max() > 1e-4
    for name in ("E_contact", "E_kinetic"):
        assert skin[name] == pytest.approx(end[name], abs=1e-6 * end["E_kinetic"][0])


def test_bodies_that_overlap_from_the_start_are_pushed_apart():
    """So are those that begin deeper than any slack; later, nobody can be there."""
    impact = finished(bars("boundary", gap=-5e-4, ratio=3, initial_overlap="press"), duration=3e-4)
    x = (impact.solver.model.X + impact.state.u.numpy())[:, 0]
    thin = x[: impact.solver.model.node_start["thick"]]
    assert thin.max() - x[len(thin) :].min() < 1e-5  # of 0.5 mm
    assert impact.scene_runs[0].ledger.kept.energy_error < 5e-3


def test_node_that_slides_through_a_fold_deep_down_stays_in_contact():
    """Between two strips that rise it is behind neither for a while, then deep behind the next at once."""
    block = mca.Box(size=(0.006, 0.01, 0.006), divisions=(1, 1, 1), origin=(0.003, 0.0, 0.007))
    valley = mca.Box(size=(0.06, 0.01, 0.02), divisions=(6, 1, 1), origin=(0.0, -0.01, 0.0))
    scene = mca.Scene(
        name="valley",
        bodies=(
            mca.Body(name="block", geometry=block, material=SOFT, velocity=(6.0, 0.0, 0.0)),
            mca.Body(name="valley", geometry=valley, material=mca.Elastic(E=1e12, nu=0.2, rho=1e9)),  # sets no step
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="block", nodes="ymin"),
                master=mca.Surface(body="valley", nodes="ymax"),
                penalty=PENALTY,
            ),
        ),
        fixed=(mca.Fixed(body="valley", nodes="ymin"), mca.Fixed(body="valley", nodes="ymax")),
        gravity=(0.0, -1e4, 0.0),
        impact=mca.ImpactPhase(duration=6e-3, output_interval=2e-5),
    )
    meshes = dict(mca.mesh(scene))
    points = meshes["valley"].points.copy()
    points[:, 1] += np.tan(0.3) * (np.abs(points[:, 0] - 0.03) - 0.027)
    meshes["valley"] = replace(meshes["valley"], points=points)
    result = mca.run(scene, meshes=meshes, precision="float64")
    assert result.F_n[-50:].mean() == pytest.approx(3.6, rel=0.5)  # it rocks on its way up, and weighs as much


def test_mesh_six_times_as_fine_touches():
    """Lists of slaves follow from the meshes; those of like meshes stay as short as they were."""
    coarse, fine = (mca.run(bars("xmin", ratio=ratio, penalty=1.0), precision="float64") for ratio in (3, 6))
    assert fine["E_contact"].max() > 0.0
    assert (fine.F_n * fine.time[1]).sum() == pytest.approx((coarse.F_n * coarse.time[1]).sum(), rel=0.03)


@pytest.mark.parametrize(("ratio", "room"), [(1, 32), (2, 96), (8, 800), (100, 1696)])
def test_room_of_lists_follows_from_the_meshes(ratio, room):
    """For a box around a face that lies aslant, in which three sides of the slave meet, and at most for all nodes."""

    def faces(h, count):
        x = h * np.arange(count + 1.0)
        X = np.stack(np.meshgrid(x, x, 0.0, indexing="ij"), axis=-1).reshape(-1, 3)
        i, j = (k.ravel() for k in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
        first = i * (count + 1) + j
        node = np.stack([first, first + count + 1, first + count + 2, first + 1], axis=1).astype(np.int32)
        ones = np.ones(count**2)
        return make_faces(X, node, np.arange(count**2, dtype=np.int32), ones, ones, ones)

    contact = bars("xmin").contacts[0]
    (item,) = contact_passes(contact, 0, faces(1.0, 40), faces(float(ratio), 1))
    assert item.room == room


def test_lists_of_slaves_are_sorted():
    """Threads fill them in any order."""
    lists = np.array([[7, 2, 9, 4, -1], [3, -1, -1, -1, -1], [5, 4, 3, 2, 1]])
    count, out = (wp.array(values, dtype=wp.int32, device="cpu") for values in ([4, 1, 8], lists))
    wp.launch(search.sort_lists, 3, inputs=[count], outputs=[out], device="cpu")
    assert out.numpy().tolist() == [[2, 4, 7, 9, -1], [3, -1, -1, -1, -1], [1, 2, 3, 4, 5]]


def test_full_candidate_list_stops_the_run(monkeypatch):
    monkeypatch.setattr("warp_mca.physics.contact.stage.LIST_LENGTH", 1)
    with pytest.raises(mca.GuardError, match="contact lists overflowed"):
        mca.run(two_boxes())


def test_node_that_outruns_the_search_stops_the_run(monkeypatch):
    monkeypatch.setattr("warp_mca.phases.division.SPEED_RESERVE", 1e-9)
    scene = two_boxes()
    slow = mca.Scene(**{**vars(scene), "impact": mca.ImpactPhase(duration=4e-3, output_interval=4e-3)})
    with pytest.raises(mca.GuardError, match="outran the contact search"):
        mca.run(slow)


@pytest.mark.parametrize("share", [0.13, 0.23, 0.3, 0.45])
def test_a_search_that_holds_for_several_intervals_lets_bodies_get_eight_times_as_fast(share: float):
    """The loose cover of a phone, which is thrown off, got 4.5 times the speed of its fall and stopped the run."""
    model = prepared(two_boxes()).model
    (found,) = model.passes
    speed, way = float(np.linalg.norm((0.7, -2.0, 0.3))), 0.5 * found.margin
    scene = replace(two_boxes(), impact=mca.ImpactPhase(duration=1.0, output_interval=share * way / (4.0 * speed)))
    steps = divide(scene, model, 1.0)
    held = steps.intervals_per_search * steps.interval
    assert 4.0 * speed * held <= way
    assert steps.intervals_per_search == 1 or 8.0 * speed * held <= way


def test_searches_at_sharp_edges_allow_for_nodes_that_these_throw():
    """Such a node got 9 times the speed of a phone that fell on its corner; the run was right, and was stopped."""
    scene = two_boxes()
    (contact,) = scene.contacts
    skins = replace(
        contact, slave=mca.Surface(body="small", nodes="boundary"), master=mca.Surface(body="large", nodes="boundary")
    )
    model = prepared(replace(scene, contacts=(skins,))).model
    speed, way = float(np.linalg.norm((0.7, -2.0, 0.3))), 0.5 * min(item.margin for item in model.passes)
    coarse = replace(scene, impact=mca.ImpactPhase(duration=1.0, output_interval=way / speed))
    steps = divide(coarse, model, 1.0)
    assert steps.searches >= 16 and 16.0 * speed * steps.interval / steps.searches <= way


def test_deep_penetration_stops_the_run():
    with pytest.raises(mca.GuardError, match="sank deeper"):
        mca.run(two_boxes(penalty=1e-7), duration=4e-3)


def test_coarse_output_searches_often_enough(monkeypatch):
    """With a short look ahead, output every 50 us needs several searches; the forces are those of fine output."""
    monkeypatch.setattr("warp_mca.physics.contact.surfaces.SEARCH_MARGIN", 0.008)
    fine = mca.run(two_boxes(mu=0.4), duration=1e-4)
    scene = two_boxes(mu=0.4)
    coarse = mca.run(mca.Scene(**{**vars(scene), "impact": mca.ImpactPhase(duration=1e-4, output_interval=5e-5)}))
    assert coarse.F_n[1:] == pytest.approx([fine.F_n[1:11].mean(), fine.F_n[11:21].mean()], abs=0.01 * fine.F_n.max())


def test_bodies_that_fly_along_do_not_hide_an_imbalance():
    """The same impact in a frame that moves: the share of what is exchanged stays, and a warning tells of it."""

    def impact(speed: float, tolerance: float) -> mca.Result:
        steel = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
        small = mca.Box(size=(0.02, 0.02, 0.02), divisions=(4, 4, 4))
        large = mca.Box(size=(0.06, 0.02, 0.06), divisions=(9, 3, 9), origin=(-0.02, -0.02, -0.02))
        bodies = (
            mca.Body(name="a", geometry=small, material=steel, velocity=(speed, -1.0, 0.0)),
            mca.Body(name="b", geometry=large, material=steel, velocity=(speed, 0.0, 0.0)),
        )
        slave, master = mca.Surface(body="a", nodes="ymin"), mca.Surface(body="b", nodes="ymax")
        meet = mca.Contact(slave=slave, master=master, penalty=5.0)
        phase = mca.ImpactPhase(duration=6e-5, energy_tolerance=tolerance)
        return mca.run(mca.Scene(name="s", bodies=bodies, contacts=(meet,), impact=phase))

    still, along = impact(0.0, 0.01), impact(50.0, 0.01)
    assert still.summary["energy_error"] > 1e3 * along.summary["energy_error"]
    assert along.summary["energy_error_exchanged"] == pytest.approx(still.summary["energy_error_exchanged"], rel=1e-3)
    assert not still.warnings and not along.warnings
    share = 0.25 * still.summary["energy_error"]
    with pytest.raises(mca.GuardError, match="energy imbalance"):
        impact(0.0, share)
    assert any("that the bodies exchanged" in warning for warning in impact(50.0, share).warnings)
