"""What only a CUDA device can show: the same figures as on the CPU, bit for bit from run to run."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from impacts import begun
from sharp_edges import bars, in_frame, roof, uneven

import warp_mca as mca

pytestmark = pytest.mark.gpu


def oblique(mu: float = 0.4) -> mca.Scene:
    """A box that yields flies aslant into a larger one, with friction from both sides, above a held face."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=5e6, E_t=7e9, beta=0.3)
    return mca.Scene(
        name="oblique",
        bodies=(
            mca.Body(
                name="small",
                geometry=mca.Box(size=(0.02, 0.02, 0.02), divisions=(6, 6, 6), origin=(-0.011, 0.0, -0.012)),
                material=metal,
                velocity=(1.0, -3.0, 0.5),
            ),
            mca.Body(
                name="large",
                geometry=mca.Box(size=(0.06, 0.03, 0.06), divisions=(10, 5, 10), origin=(-0.03, -0.03, -0.03)),
                material=metal,
            ),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="small", nodes="ymin"),
                master=mca.Surface(body="large", nodes="ymax"),
                mu=mu,
                two_way=True,
            ),
        ),
        fixed=(mca.Fixed(body="large", nodes="ymin"),),
        gravity=(0.0, -9.8, 0.0),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6),
        tip=mca.Point(body="small", at=(0.0, 0.01, 0.0)),
    )


@pytest.mark.parametrize(("precision", "tolerance"), [("mixed", 1e-4), ("float64", 1e-7)])
def test_device_gives_the_figures_of_the_cpu(precision, tolerance):
    """Contacts and yield switch: a change of 1e-15 in the initial velocity moves the forces by 1e-8."""
    cpu, cuda = (mca.run(oblique(), device=device, precision=precision) for device in ("cpu", "cuda:0"))
    assert cpu.summary["max_plastic_strain"] > 1e-4
    for name in ("F_n_N", "F_t_N", "tip_vx", "E_kinetic", "E_plastic", "E_friction"):
        assert cuda[name] == pytest.approx(cpu[name], abs=tolerance * np.abs(cpu[name]).max())


def test_device_repeats_bit_for_bit():
    one, two = (mca.run(oblique(), device="cuda:0") for _ in range(2))
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("plastic", [True, False])
def test_steps_of_one_launch_give_what_launches_of_each_step_give(precision, plastic):
    """Contact with friction, yield and held nodes; sums of forces are grouped otherwise."""
    scene = oblique()
    metal = scene.bodies[0].material if plastic else mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    scene = replace(
        scene,
        bodies=tuple(replace(body, material=metal) for body in scene.bodies),
        contacts=(replace(scene.contacts[0], two_way=False),),
    )
    runs = [begun(scene, device="cuda:0", precision=precision) for _ in range(3)]
    assert runs[0].solver.resident is not None
    runs[2].solver.resident = None
    for run in runs:
        run.advance()
        assert run.stopped == [None]
    u, again, single = (run.state.u.numpy() for run in runs)
    assert np.array_equal(u, again)
    assert u == pytest.approx(single, abs=(1e-4 if precision == "mixed" else 1e-9) * np.abs(single).max())
    sums = [run.solver.contacts.normal_force.greatest(run.state.normal_force, 0) for run in runs]
    assert sums[0] == sums[1] > 0.0
    assert sums[0] == pytest.approx(sums[2], rel=1e-4 if precision == "mixed" else 1e-9)


def hinged(other: str | None, scaled: float | None) -> mca.Scene:
    """A bar at small strain on a pin of the ground or of a second bar, which strikes a block as it turns."""
    from test_pin import bar

    axis = {"at": (0.0, 0.0, 0.0), "nodes": "pin", "pin_radius": 0.008}
    bodies = [replace(bar("a", (8, 4, 3), angular_velocity=(0.0, 0.0, -20.0)), kinematics="corotational")]
    if other:
        bodies.append(replace(bar("b", (7, 6, 2), rotation=(0.0, 0.0, 3.1)), kinematics="corotational"))
    block = mca.Box(size=(0.02, 0.01, 0.03), divisions=(4, 2, 4), origin=(0.085, -0.0201, -0.015))
    bodies.append(mca.Body(name="block", geometry=block, material=bodies[0].material))
    slave, master = mca.Surface(body="a", nodes="ymin"), mca.Surface(body="block", nodes="ymax")
    return mca.Scene(
        name="hinged",
        bodies=tuple(bodies),
        joints=(mca.Revolute(name="O", body="a", **axis, **({"other": other} if other else {})),),
        contacts=(mca.Contact(slave=slave, master=master, mu=0.2),),
        gravity=(0.0, -500.0, 0.0),
        impact=mca.ImpactPhase(duration=4e-4, output_interval=2e-5, mass_scaling=scaled),
    )


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("other", [None, "b"], ids=["ground", "two bodies"])
@pytest.mark.parametrize("scaled", [None, 1.01])
def test_steps_of_one_launch_take_pins_and_mass_scaling(precision, other, scaled):
    runs = [begun(hinged(other, scaled), device="cuda:0", precision=precision) for _ in range(3)]
    assert runs[0].solver.resident is not None
    runs[2].solver.resident = None
    for run in runs:
        run.advance()
        assert run.stopped == [None]
    one, again, single = (run.state for run in runs)
    assert again.differences(one) == []
    assert runs[0].solver.contacts.normal_force.greatest(one.normal_force, 0) > 0.0
    near = 1e-4 if precision == "mixed" else 1e-9
    for name in ("u", "v", "couplings/place", "couplings/orientation", "constraints/impulse"):
        a, b = (state.arrays()[name].numpy() for state in (one, single))
        assert a == pytest.approx(b, abs=near * np.abs(b).max()), name


@pytest.mark.parametrize("scene", [oblique(), hinged(None, None), hinged("b", None)], ids=["block", "ground", "pin"])
def test_launches_of_many_steps_follow_each_other_without_a_record(scene):
    scene = replace(scene, contacts=(replace(scene.contacts[0], two_way=False, penalty=1.0),))
    resident, single = (begun(scene, device="cuda:0", precision="float64") for _ in range(2))
    assert resident.solver.resident is not None
    single.solver.resident = None
    for run in (resident, single):
        run.advance(until=run.steps.per_interval * 2)
        for _ in range(20):
            run.solver.search(run.state)
            run.solver.step(run.state, 17)
    u, expected = (run.state.u.numpy() for run in (resident, single))
    assert u == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4", "tet10"])
def test_extremes_are_those_of_the_cpu_and_repeat_bit_for_bit(element):
    scene = oblique()
    scene = replace(scene, bodies=tuple(replace(body, element=element) for body in scene.bodies))
    cpu, one, two = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0", "cuda:0"))
    assert one.summary["extremes"] == two.summary["extremes"]
    for name in ("F_n_max", "max_strain", "min_jacobian", "max_speed"):
        assert one.summary["extremes"][name] == pytest.approx(cpu.summary["extremes"][name], rel=1e-6), name
    alone = mca.run(scene, device="cuda:0")
    for batched in mca.run_batch([scene, scene], device="cuda:0"):
        assert batched.summary["extremes"] == alone.summary["extremes"]


@pytest.mark.gpu
def test_frames_arrive_in_order_and_equal_those_of_the_cpu():
    """The host runs ahead of the device: frames must be those of their time, whatever is under way."""
    from test_recording import Memory, bar

    from warp_mca.recorders import Cadence
    from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME

    seen = []
    for device in ("cpu", "cuda:0"):
        memory = Memory(SURFACE, CONTACT, PATHS, VOLUME, cadence=Cadence(seconds=1e-6))
        mca.run(bar(), device=device, precision="float64", recorders=[memory])
        seen.append(memory.frames)
    assert [frame.step for frame in seen[0]] == [frame.step for frame in seen[1]]
    for one, other in zip(*seen, strict=True):
        np.testing.assert_allclose(one.points["bar"], other.points["bar"], atol=1e-8)
        np.testing.assert_allclose(one.von_mises["bar"], other.von_mises["bar"], rtol=1e-4, atol=10.0)
        np.testing.assert_allclose(one.path_stress["axis"], other.path_stress["axis"], rtol=1e-4, atol=10.0)
        np.testing.assert_array_equal(one.contact_stick, other.contact_stick)
        assert one.volume is not None
        assert other.volume is not None
        np.testing.assert_allclose(one.volume.velocity, other.volume.velocity, atol=1e-5)


def test_a_node_driven_along_all_axes_follows_all_of_them():
    """Threads of one node write one component each; checked through strains, which take all three."""
    scene = mca.make_scene("strained_element", course="around", duration=1e-3)
    host, device = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0"))
    np.testing.assert_allclose(device.paths[0].stress, host.paths[0].stress, rtol=1e-5, atol=1e3)


def test_hinges_and_driven_axes_beside_the_other_nodes_give_the_figures_of_the_cpu():
    from test_batch import driven

    scene = driven(1.0, 0.3, (0.0, 1.0, 0.0))
    host, device = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0"))
    impulse = np.array(host.summary["joint_impulse"]["A"])
    np.testing.assert_allclose(device.summary["joint_impulse"]["A"], impulse, atol=1e-7 * np.abs(impulse).max())
    for name in ("F_n_N", "E_kinetic", "E_plastic"):
        assert device[name] == pytest.approx(host[name], abs=1e-7 * np.abs(host[name]).max())
    work = host.summary["energy"]["external_work"]
    assert device.summary["energy"]["external_work"] == pytest.approx(work, rel=1e-7)


def test_pins_give_the_motion_of_the_cpu_and_the_same_bits_twice():
    from chains import impact
    from test_pin import pinned

    scene = pinned(theta_dot=(-3.0, 4.0))
    host, device, again = (impact(scene, device=name) for name in ("cpu", "cuda:0", "cuda:0"))
    for found in (host, device, again):
        found.advance()
    assert again.state.differences(device.state) == []
    np.testing.assert_allclose(device.state.u.numpy(), host.state.u.numpy(), rtol=0.0, atol=1e-10)
    place, turn = (getattr(host.state.couplings, name).numpy() for name in ("place", "orientation"))
    np.testing.assert_allclose(device.state.couplings.place.numpy(), place, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(device.state.couplings.orientation.numpy(), turn, rtol=0.0, atol=1e-9)


def test_tied_meshes_give_the_figures_of_the_cpu_and_repeat_bit_for_bit():
    from test_tie import SIDE, bar

    plane = mca.RigidPlane(point=(0.0, -0.5 * SIDE, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="fine", nodes="ymin"), master=plane)
    scene = bar(6, 2, speed=(0.0, -1.0, 0.0), spin=(0.0, 30.0, 0.0), contacts=(contact,))
    host, device = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0"))
    for name in ("F_n_N", "E_kinetic", "E_internal"):
        assert device[name] == pytest.approx(host[name], abs=1e-7 * np.abs(host[name]).max())
    again = mca.run(scene, device="cuda:0", precision="float64")
    assert all(np.array_equal(again[name], device[name], equal_nan=True) for name in device.history)


def test_elements_that_yield_are_listed_once_and_give_the_same_forces():
    scene = oblique()
    host, device = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0"))
    assert host.summary["max_plastic_strain"] > 1e-4
    assert device.summary["max_plastic_strain"] == pytest.approx(host.summary["max_plastic_strain"], rel=1e-6)
    np.testing.assert_allclose(device["E_plastic"], host["E_plastic"], rtol=1e-6, atol=1e-12)


def test_scenes_of_a_batch_give_the_bits_that_they_give_alone():
    """All have the same step; a scene that breaks changes nothing for the others."""
    scenes = [oblique(mu) for mu in (0.4, 0.0, 0.1)]
    tight = replace(scenes[0], impact=replace(scenes[0].impact, energy_tolerance=1e-12))
    results = mca.run_batch([*scenes, tight], device="cuda:0")
    assert results[-1].stopped
    for scene, result in zip(scenes, results, strict=False):
        one = mca.run(scene, device="cuda:0")
        assert one.summary["dt"] == result.summary["dt"]
        assert all(np.array_equal(one[name], result[name], equal_nan=True) for name in one.history)
        assert one.summary["max_plastic_strain"] == result.summary["max_plastic_strain"]
    assert len({float(np.abs(result.F_t).max()) for result in results[:3]}) == 3


@pytest.mark.parametrize(
    "scene",
    [
        bars(True, aside=1.3e-3, along=3.0, mu=0.3, two_way=True),
        in_frame("L", ("every",), (-3.0, -2.5, 0.0)),
        in_frame("C", ("every",), (-3.0, -2.7, -2.4), mu=0.3, two_way=True, initial_overlap="press"),
        roof(55.0, position=(0.012, 1e-5, 0.0), velocity=(20.0, -3.0, 0.0)),
    ],
    ids=["bars", "two walls", "three walls", "roof"],
)
def test_sides_of_a_master_press_as_on_the_cpu_and_repeat_bit_for_bit(scene):
    """Rounding decides which face presses a node in the plane of two; devices agree where none lies there."""
    short = replace(scene, impact=replace(scene.impact, duration=min(scene.impact.duration, 1e-4)))
    one, two = (mca.run(short, device="cuda:0", precision="float64") for _ in range(2))
    assert one.F_n.max() > 100.0
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)
    alone = mca.run(short, device="cuda:0")
    for batched in mca.run_batch([short, short], device="cuda:0"):
        assert all(np.array_equal(batched[name], alone[name], equal_nan=True) for name in alone.history)
    host, device = (mca.run(uneven(short), device=name, precision="float64") for name in ("cpu", "cuda:0"))
    assert device.F_n == pytest.approx(host.F_n, abs=1e-6 * host.F_n.max())


def test_scenes_with_unlike_numbers_of_sides_give_what_they_give_alone_but_for_rounding():
    """That with fewer is computed by the kernel of the others."""
    scenes = [bars(closed, aside=1.3e-3, along=3.0) for closed in (True, False)]
    (closed, open_one), alone = mca.run_batch(scenes, device="cuda:0"), [mca.run(s, device="cuda:0") for s in scenes]
    assert all(np.array_equal(closed[name], alone[0][name], equal_nan=True) for name in closed.history)
    assert open_one.F_n == pytest.approx(alone[1].F_n, abs=1e-4 * alone[1].F_n.max())


@pytest.mark.parametrize("element", ["hex8", "hex8r"])
@pytest.mark.parametrize("yielding", [None, 0.0, 0.3, 1.0])
def test_blocks_that_compute_several_patches_give_the_forces_of_the_cpu(element, yielding):
    """More patches than the device holds blocks for: each takes some in turn, those where elements yield first."""
    from benchmarks.blocks import Case, Held, assemble

    model = assemble(element, 90_000)
    exact = Held(model, Case(yielding), "cpu", "float64").forces()
    for precision, tolerance in (("mixed", 1e-4), ("float64", 1e-11)):
        held = Held(model, Case(yielding), "cuda:0", precision)
        stage = held.solver.elements[0]
        assert stage.blocks < len(stage.patches.head)
        one = held.forces()
        with wp.ScopedDevice("cuda:0"):
            stage.schedule()
        assert np.array_equal(held.forces(), one)
        assert np.abs(one - exact).max() < tolerance * np.abs(exact).max()
        for blocks in (stage.blocks // 3, 7):
            stage.blocks = blocks
            held.renew()
            assert np.array_equal(held.forces(), one)
        host = Held(model, Case(yielding), "cpu", precision)
        host.forces()
        assert held.yielded() == host.yielded()
        for a, b in zip(held.state.elements, host.state.elements, strict=True):
            scale = np.abs(b.history.numpy()).max(initial=1e-30)
            np.testing.assert_allclose(a.history.numpy(), b.history.numpy(), rtol=0, atol=10.0 * tolerance * scale)


@pytest.mark.parametrize("element", ["hex8", "hex8i", "hex8r", "tet4"])
@pytest.mark.parametrize("name", ["elastic", "flows", "everything"])
@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_kernels_that_begin_early_change_no_bit(element, name, precision, monkeypatch):
    """Against the same graphs whose kernels begin when the one before them has ended."""
    from benchmarks.blocks import FULL, Case, Held, assemble
    from warp_mca.kernels.nodes import node
    from warp_mca.kernels.nodes.gather import Kind
    from warp_mca.step import replay

    monkeypatch.setattr("warp_mca.step.node_stage.EARLY_ROUNDS", 0)
    model, case = assemble(element, 90_000), {"elastic": Case(), "flows": Case(0.3), "everything": FULL}[name]
    own, changed, states = replay.launch_early, [], []
    for change in (lambda graph: changed.append(own(graph)), lambda graph: None):
        monkeypatch.setattr(replay, "launch_early", change)
        held = Held(model, case, "cuda:0", precision)
        if name == "elastic":
            early = node.integrate_kernel(Kind(precision), early=True)
            assert held.solver.nodes.integrate_kernel is early
        for _ in range(10):
            held.advance(20)
        arrays = [held.solver.work.force, held.solver.work.partial, *held.state.arrays().values()]
        states.append([array.numpy() for array in arrays])
    edges = 20 * (4 if element == "tet4" else 2) - 1  # of a chain of 20 steps
    assert changed == [edges] if name != "everything" else changed[0] > edges
    assert all(np.array_equal(one, other) for one, other in zip(*states, strict=True))


@pytest.mark.parametrize("plastic", [True, False])
def test_probes_and_sections_record_what_they_do_on_the_cpu(plastic):
    """Sections compute a layer of cells by patches, whose slots hold sums over its elements."""
    metal = oblique().bodies[0].material if plastic else mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    scene = replace(
        oblique(),
        bodies=tuple(replace(body, material=metal) for body in oblique().bodies),
        probes=(
            mca.Probe(name="top", body="small", nodes="ymax"),
            mca.Probe(name="in", body="large", at=(0, -0.01, 0)),
        ),
        sections=(
            mca.Section(name="small", body="small", at=(0.0, 0.0101, 0.0), normal=(0.0, 1.0, 0.0)),
            mca.Section(name="large", body="large", at=(0.0, -0.0101, 0.0), normal=(0.0, 1.0, 0.0)),
        ),
    )
    cpu, cuda, again = (mca.run(scene, device=device, precision="float64") for device in ("cpu", "cuda:0", "cuda:0"))
    for one, two in zip(cpu.sections, cuda.sections, strict=True):
        assert np.abs(one.force).max() > 100.0
        assert two.force == pytest.approx(one.force, abs=1e-6 * np.abs(one.force).max())
        assert two.moment == pytest.approx(one.moment, abs=1e-6 * np.abs(one.moment).max())
    for one, two in zip(cpu.probes, cuda.probes, strict=True):
        assert two.position == pytest.approx(one.position, abs=1e-12)
        assert two.velocity == pytest.approx(one.velocity, abs=1e-6)
    assert all(np.array_equal(a.force, b.force) for a, b in zip(cuda.sections, again.sections, strict=True))
    plain = mca.run(replace(scene, probes=(), sections=()), device="cuda:0", precision="float64")
    assert all(np.array_equal(plain[name], cuda[name], equal_nan=True) for name in plain.history)
