"""Bodies that overlap before the first step are refused, start free of stress or are pressed apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.recorders import UsdFile

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)


def falling(depth: float, *, plane: bool = False, nodes: str = "ymin", master: str = "ymax", speed=1.0, **contact):
    """A block at 1 m/s, at the start `depth` [m] inside a plate or a plane."""
    block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(4, 4, 4))
    plate = mca.Box(size=(0.06, 0.01, 0.03), divisions=(12, 2, 6))
    start = {"position": (0.021, 0.01 - depth, 0.011), "velocity": (0.0, -speed, 0.0)}
    bodies = (mca.Body(name="block", geometry=block, material=STEEL, **start),)
    ground: mca.Surface | mca.RigidPlane = mca.RigidPlane(point=(0.0, 0.01, 0.0))
    if not plane:
        bodies += (mca.Body(name="plate", geometry=plate, material=STEEL),)
        ground = mca.Surface(body="plate", nodes=master)
    return mca.Scene(
        name="falling",
        bodies=bodies,
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes=nodes), master=ground, **contact),),
        fixed=() if plane else (mca.Fixed(body="plate", nodes="ymin"),),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-7),
    )


@pytest.mark.parametrize("plane", [False, True])
def test_overlap_is_refused_with_place_depth_and_energy(plane: bool, tmp_path: Path):
    """Springs of E* A / (2 d) on 1 cm^2 of cells of 2.5 mm, 4.6e9 N/m, hold 23 J, a third of it on cells of 5 mm."""
    held = r"23\.1" if plane else r"7\.69"
    pattern = rf"initial_overlap = 'refuse': .*25 of them, up to 0\.0001 m deep at .* would hold {held} J"
    with pytest.raises(mca.RequestError, match=pattern):
        mca.run(falling(1e-4, plane=plane), out=tmp_path / "out", recorders=[UsdFile(tmp_path / "a.usdc")])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("nodes", ["ymin", "boundary"])
def test_overlap_deeper_than_faces_reach_is_refused(nodes: str):
    """Faces find nodes up to one edge behind them; these lie 6 mm below cells of 5 mm, and met nothing."""
    with pytest.raises(mca.RequestError, match=r"lie inside .* up to 0\.00[46]"):
        mca.run(falling(6e-3, nodes=nodes, master="ymax" if nodes == "ymin" else "boundary"))


@pytest.mark.parametrize("two_way", [False, True])
@pytest.mark.parametrize(("thick", "cells"), [(2e-3, 6), (1e-3, 12)])
def test_a_ball_on_the_far_side_of_a_one_sided_master_is_not_said_to_lie_inside(
    thick: float, cells: int, two_way: bool
):
    """It hangs 1 mm below a thin plate, whose upper faces are the master; those of both sides do not press it."""
    ball = mca.Body(
        name="ball", geometry=mca.Sphere(radius=0.01, section=4, ring=2), material=STEEL, position=(0.0, -0.011, 0.0)
    )
    plate = mca.Box(size=(0.06, thick, 0.06), divisions=(cells, 1, cells), origin=(-0.03, 0.0, -0.03))

    def scene(nodes: str) -> mca.Scene:
        sides = [mca.Surface(body="ball", nodes="boundary"), mca.Surface(body="plate", nodes=nodes)]
        return mca.Scene(
            name="below",
            bodies=(ball, mca.Body(name="plate", geometry=plate, material=STEEL)),
            contacts=(mca.Contact(slave=sides[0], master=sides[1], two_way=two_way),),
            impact=mca.ImpactPhase(duration=1e-6, output_interval=1e-7),
        )

    with pytest.raises(mca.RequestError, match=r"nodes of one body lie behind the other's faces .* outside of it"):
        mca.run(scene("ymax"))
    assert mca.run(scene("boundary")).summary["max_penetration"] == 0.0


def test_overlap_of_one_scene_of_a_batch_names_the_scene():
    with pytest.raises(mca.RequestError, match=r"^scenes\[1\]: Contact block–plate: initial_overlap"):
        mca.run_batch([falling(0.0), falling(1e-4)])


@pytest.mark.parametrize("plane", [False, True])
@pytest.mark.parametrize("depth", [0.0, 1e-12, -1e-12])
def test_rounding_is_no_overlap(plane: bool, depth: float):
    apart = mca.run(falling(-1e-7, plane=plane))
    result = mca.run(falling(depth, plane=plane))
    assert result.F_n.max() == pytest.approx(apart.F_n.max(), rel=1e-3)
    assert not any("inside" in warning for warning in result.warnings)


@pytest.mark.parametrize("plane", [False, True])
def test_stress_free_overlap_strikes_as_bodies_that_touch(plane: bool):
    touching = mca.run(falling(0.0, plane=plane), precision="float64")
    result = mca.run(falling(1e-4, plane=plane, initial_overlap="stress_free"), precision="float64")
    assert result.F_n[0] == 0.0 == result["E_contact"][0]
    rise = slice(0, int(touching.F_n.argmax()) + 5)
    assert result.F_n[rise] == pytest.approx(touching.F_n[rise], abs=0.03 * touching.F_n.max())
    assert result.summary["energy_error"] < 2e-3
    assert result["E_kinetic"].max() <= result["E_kinetic"][0]


def test_stress_free_nodes_that_left_come_back_to_the_surface():
    """The resting depth shrinks as a node moves out: a block that left strikes the plane where it is."""
    scene = falling(2e-6, plane=True, initial_overlap="stress_free", speed=-1.0)
    scene = replace(scene, gravity=(0.0, -1e5, 0.0), impact=mca.ImpactPhase(duration=4e-5, output_interval=1e-7))
    result = mca.run(scene, precision="float64")
    first = result.time[np.argmax(result.F_n > 1.0)]
    assert first == pytest.approx((1.0 + np.sqrt(1.0 - 2.0 * 1e5 * 2e-6)) / 1e5, abs=3e-7)  # y = v t - g t^2 / 2


@pytest.mark.parametrize("penalty", [None, 5.0])
def test_a_block_is_pressed_between_walls(penalty: float | None):
    """A bar of stiffness E A / L in series with the springs; at once, springs of penalty = 5 made 9 % of the energy."""
    scene = falling(1e-5, plane=True, initial_overlap="press", penalty=penalty, speed=0.0)
    scene = replace(scene, fixed=(mca.Fixed(body="block", nodes="ymax", axes="y"),))
    result = mca.run(replace(scene, impact=mca.ImpactPhase(duration=8e-5, output_interval=1e-7)))
    area, cell = 1e-4, 0.01 / 4.0
    springs = STEEL.E / (1.0 - STEEL.nu**2) / 2.0 * area / cell  # E* A / 2 d
    if penalty:
        springs = 25.0 * penalty * STEEL.bulk_modulus * cell  # 25 nodes of f K A^2 / V
    force = 1e-5 / (0.01 / (STEEL.E * area) + 1.0 / springs)
    assert result.F_n[result.time > 4e-5].mean() == pytest.approx(force, rel=0.02)
    assert result.F_n.max() < 1.1 * force
    assert result.summary["energy_error"] < 1e-5
    assert result.summary["energy"]["external_work"] == pytest.approx(0.5 * force * 1e-5, rel=0.05)


def test_a_block_is_pressed_against_dashpots():
    """What brings the overlap in works on springs alone; counted on dashpots, too, 20 % of the energy was missing."""
    scene = falling(1e-5, plane=True, initial_overlap="press", law=mca.DampedPenalty(time=1e-7), speed=0.0)
    result = mca.run(replace(scene, impact=mca.ImpactPhase(duration=4e-5, output_interval=1e-7)))
    energy = result.summary["energy"]
    assert energy["damping"] > 0.01 * energy["external_work"] > 0.0
    assert result.summary["energy_error"] < 1e-3


def quarter(inner: float, outer: float, layers: int) -> mca.Mesh:
    """A quarter of a tube around z, 2 mm long, with node sets `in`, `out`, and `x0`, `y0` on its planes of symmetry."""
    angles, length = np.linspace(0.0, 0.5 * np.pi, 13), 2e-3
    radii = np.linspace(inner, outer, layers + 1)
    at = [(r * np.cos(a), r * np.sin(a), z) for z in (0.0, length) for r in radii for a in angles]
    number = np.arange(len(at)).reshape(2, layers + 1, 13)
    around = [number[:, :-1, :-1], number[:, 1:, :-1], number[:, 1:, 1:], number[:, :-1, 1:]]
    cells = np.stack([corner[z] for z in (0, 1) for corner in around], axis=-1).reshape(-1, 8)
    sets = {"in": number[:, 0], "out": number[:, -1], "y0": number[:, :, 0], "x0": number[:, :, -1]}
    sets |= {"z0": number[0], "z1": number[1]}
    node_sets = {name: nodes.ravel().astype(np.int32) for name, nodes in sets.items()}
    return mca.Mesh(points=np.array(at), hexahedra=cells.astype(np.int32), node_sets=node_sets)


@pytest.mark.parametrize("sets", [("out", "in"), ("boundary", "boundary")])
def test_a_ring_pressed_on_a_hollow_shaft_has_the_pressure_of_lame(sets: tuple[str, str]):
    """Of whole skins, too, all nodes of which lie flush with the ends of the other one.

    delta = p b / E ((c^2 + b^2) / (c^2 - b^2) + (b^2 + a^2) / (b^2 - a^2)) of the interference delta in the radius:
    Timoshenko and Goodier, Theory of Elasticity, 28."""
    a, b, c, delta = 5e-3, 10e-3, 20e-3, 1e-5
    meshes = {"shaft": quarter(a, b + 0.5 * delta, 4), "ring": quarter(b - 0.5 * delta, c, 8)}
    planes = [mca.Fixed(body=name, nodes=f"{axis}0", axes=axis) for name in meshes for axis in "xy"]
    sides = [mca.Surface(body=name, nodes=nodes) for name, nodes in zip(meshes, sets, strict=True)]
    scene = mca.Scene(
        name="press fit",
        bodies=tuple(mca.Body(name=name, geometry=mesh, material=STEEL) for name, mesh in meshes.items()),
        contacts=(mca.Contact(slave=sides[0], master=sides[1], initial_overlap="press"),),
        fixed=tuple(planes),
        impact=mca.ImpactPhase(duration=8e-5, output_interval=2e-7),
    )
    result = mca.run(scene)
    compliance = (c**2 + b**2) / (c**2 - b**2) + (b**2 + a**2) / (b**2 - a**2)
    pressure = result.contacts[0].pressure / (0.5 * np.pi * b * 2e-3) / (STEEL.E * delta / (b * compliance))
    assert pressure[result.time > 4e-5].mean() == pytest.approx(1.0, abs=0.01)
    assert pressure.max() < 1.1
    assert result.summary["energy_error"] < 1e-3


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_frictionless_ring_on_matching_nodes_is_told_to_take_friction(mu: float):
    """Nodes at corners of facets make energy at any step, 0.4 % of it in 90 us; with friction a third of that."""
    meshes = {"shaft": quarter(10e-3, 20e-3 + 1e-5, 3), "ring": quarter(20e-3, 30e-3, 3)}
    held = [mca.Fixed(body=name, nodes=f"{axis}0", axes=axis) for name in meshes for axis in "xyz"]
    held += [mca.Fixed(body=name, nodes="z1", axes="z") for name in meshes]
    sides = mca.Surface(body="shaft", nodes="out"), mca.Surface(body="ring", nodes="in")
    scene = mca.Scene(
        name="press fit",
        bodies=tuple(mca.Body(name=name, geometry=mesh, material=STEEL) for name, mesh in meshes.items()),
        contacts=(mca.Contact(slave=sides[0], master=sides[1], initial_overlap="press", mu=mu),),
        fixed=tuple(held),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-6, energy_tolerance=2e-3),
    )
    if mu:
        assert mca.run(scene).summary["energy_error"] < 2e-3
    else:
        with pytest.raises(
            mca.GuardError, match=r"imbalance .*: give the curved contact without friction a mu, or its"
        ):
            mca.run(scene)


def test_a_body_at_rest_above_a_plane_has_nothing_said_of_overlap():
    scene = falling(-1e-9, plane=True, speed=0.0)
    warnings = mca.run(replace(scene, gravity=(0.0, -9.81, 0.0))).warnings
    assert not any("overlap" in warning for warning in warnings)


def test_unknown_choice_is_refused():
    with pytest.raises(mca.RequestError, match=r"Contact\.initial_overlap = 'ignore': choose refuse or stress_free"):
        falling(0.0, initial_overlap="ignore")


@pytest.mark.parametrize("divisions", [1, 3])
@pytest.mark.parametrize("move", [0.0, 0.01])
def test_equal_bodies_at_one_place_are_refused(divisions: int, move: float):
    """No node is inside, all lie on faces: the middles of the cells tell."""
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(divisions,) * 3)  # pyright: ignore[reportArgumentType]
    there = mca.Body(name="there", geometry=box, material=STEEL)
    here = replace(there, name="here", position=(move, 0.0, 0.0), velocity=(-1.0, 0.0, 0.0))
    sides = [mca.Surface(body=name, nodes="boundary") for name in ("here", "there")]
    scene = mca.Scene(
        name="coincident",
        bodies=(there, here),
        contacts=(mca.Contact(slave=sides[0], master=sides[1]),),
        impact=mca.ImpactPhase(duration=1e-6, output_interval=1e-7),
    )
    if move:  # side by side
        assert mca.run(scene).summary["touched"]
    else:
        with pytest.raises(
            mca.RequestError, match=r"cells of one body lie inside .*\(\d+ of them, .*: move the bodies"
        ):
            mca.run(scene)


@pytest.mark.parametrize("end", [0.9, 0.2])
@pytest.mark.parametrize("at", [(0.006, -0.014, -0.003), (-0.0061, -0.003, -0.003)])
@pytest.mark.parametrize("contacts", ["listed", "all"])
def test_nodes_behind_a_face_that_leans_but_outside_of_its_body_are_free(end: float, at: tuple, contacts: str):
    """The far face of a tapered plate took nodes 8 mm beside it, and scenes were refused."""
    mesh = mca.Box(size=(0.0114, 0.0026, 0.023), divisions=(2, 1, 2), origin=(0.0, -0.0013, -0.0115)).build()
    x = mesh.points.copy()
    x[:, 1] *= end + (1.0 - end) * x[:, 0] / 0.0114
    plate = mca.Body(name="plate", geometry=mca.Mesh(x, mesh.hexahedra), material=STEEL)
    box = mca.Box(size=(0.006, 0.006, 0.006), divisions=(6, 6, 6), origin=at)
    cube = mca.Body(name="cube", geometry=box, material=STEEL)
    skins = [mca.Surface(body=name, nodes="boundary") for name in ("cube", "plate")]
    listed = (mca.Contact(slave=skins[0], master=skins[1]),)
    impact = mca.ImpactPhase(duration=1e-6, output_interval=1e-6)
    scene = mca.Scene(
        name="beside", bodies=(plate, cube), contacts="all" if contacts == "all" else listed, impact=impact
    )
    assert mca.run(scene).summary["extremes"]["F_n_max"] == 0.0


@pytest.mark.parametrize("cells", [2, 4])
@pytest.mark.parametrize("how", ["press", "heat"])
def test_what_springs_take_of_the_preload_of_flat_contacts_is_said(how: str, cells: int):
    """Two bars of n cells each, held at their far ends: default springs, stiff as 2 cells each, leave n / (n + 2)."""
    side, delta, rubber = 0.01, 2e-5, mca.Elastic(E=1e8, nu=0.0, rho=1e3)
    box = mca.Box(size=(2.0 * side, side, side), divisions=(cells, 1, 1))
    bodies = [mca.Body(name="a", geometry=box, material=rubber)]
    place = 2.0 * side - (delta if how == "press" else 0.0)
    bodies.append(replace(bodies[0], name="b", position=(place, 0.0, 0.0)))
    sides = mca.Surface(body="a", nodes="xmax"), mca.Surface(body="b", nodes="xmin")
    contact = mca.Contact(slave=sides[0], master=sides[1], initial_overlap="press" if how == "press" else "refuse")
    heat = mca.ThermalStrain(body="a", expansion=1e-5, temperature=delta / (2.0 * side) / 1e-5)
    scene = mca.Scene(
        name="preload",
        bodies=tuple(bodies),
        contacts=(contact,),
        fixed=(mca.Fixed(body="a", nodes="xmin", axes="x"), mca.Fixed(body="b", nodes="xmax", axes="x")),
        loads=() if how == "press" else (heat,),
        phases=(mca.Settle(duration=1.0),),
        impact=mca.ImpactPhase(duration=2e-4, output_interval=1e-5),
    )
    result = mca.run(scene)
    stiff = 1e8 * side**2 * delta / (4.0 * side)
    assert result.F_n[-10:].mean() == pytest.approx(stiff * cells / (cells + 2.0), rel=0.005)
    (loss,) = result.summary["contact_spring_loss"].values()
    assert loss == pytest.approx(-2.0 / (cells + 2.0), rel=0.01)
    assert any(f"springs take up {-loss:.0%} of the interference that holds a–b at rest" in w for w in result.warnings)
