"""Contact springs depend on what touches, and on nothing else; their default suits flat and curved surfaces."""

import math
from dataclasses import replace

import numpy as np
import pytest
from impacts import prepared
from test_bending import grid

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
RUBBER = mca.Elastic(E=5e6, nu=0.3, rho=1000.0)


def block_on_plate(plate: mca.Mesh, far: mca.Elastic = STEEL, *, speed: float = 0.0, start: float = 0.05, **contact):
    """A block of 10 mm falls on a plate of 60 mm at 1 m/s, near its left end; cells right of `start` are of `far`."""
    right = plate.points[plate.hexahedra].mean(axis=1)[:, 0] > start
    plate = mca.Mesh(plate.points, plate.hexahedra, plate.node_sets, {"far": np.flatnonzero(right).astype(np.int32)})
    block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(4, 4, 4))
    falling = {"position": (0.002, 0.01, 0.005), "velocity": (speed, -1.0, 0.0)}
    slave, master = mca.Surface(body="block", nodes="ymin"), mca.Surface(body="plate", nodes="ymax")
    return mca.Scene(
        name="block",
        bodies=(
            mca.Body(name="plate", geometry=plate, material={"far": far, "*": STEEL}),
            mca.Body(name="block", geometry=block, material=STEEL, **falling),
        ),
        contacts=(mca.Contact(slave=slave, master=master, **contact),),
        fixed=(mca.Fixed(body="plate", nodes="ymin"),),
        impact=mca.ImpactPhase(duration=1.5e-5, output_interval=1e-7),
    )


PLATE = mca.Box(size=(0.06, 0.01, 0.02), divisions=(12, 2, 4)).build()


@pytest.fixture(scope="module")
def alone() -> mca.Result:
    return mca.run(block_on_plate(PLATE))


def test_soft_cells_far_away_do_not_soften_the_contact(alone: mca.Result):
    """Springs took the softest face of the whole master: 13 times less force."""
    result = mca.run(block_on_plate(PLATE, RUBBER))
    assert result.summary["dt"] == alone.summary["dt"]
    assert result.F_n == pytest.approx(alone.F_n, rel=1e-3, abs=1e-3 * alone.F_n.max())


def test_narrow_cells_far_away_do_not_soften_the_contact(alone: mca.Result):
    points = PLATE.points.copy()
    points[np.isclose(points[:, 0], 0.055), 0] = 0.0595
    narrow = mca.Mesh(points, PLATE.hexahedra, PLATE.node_sets)
    assert mca.run(block_on_plate(narrow)).F_n.max() == pytest.approx(alone.F_n.max(), rel=0.02)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_what_a_spring_loses_on_a_softer_face_is_booked(mu: float):
    """The block slides from steel on to a plastic, whose springs are a hundredth as stiff, while it is pressed."""
    plastic = mca.Elastic(E=2e9, nu=0.3, rho=1000.0)
    result = mca.run(block_on_plate(PLATE, plastic, speed=200.0, start=0.012, mu=mu), precision="float64")
    energy = result.summary["energy"]
    assert energy["contact_loss"] > 15.0 * abs(energy["error"])
    assert energy["contact_loss"] > 0.01 * 0.5 * 7850.0 * 1e-6  # of the kinetic energy of the fall


@pytest.mark.parametrize("cells", [10, 40])
def test_bars_of_flat_cells_swap_their_speeds(cells: int):
    """Springs of whole skins were those of the cells' narrow sides, the softer the finer the mesh."""
    bar = mca.Box(size=(0.1, 0.02, 0.02), divisions=(cells, 2, 2))
    material = replace(STEEL, nu=0.0)
    bodies = (
        mca.Body(name="one", geometry=bar, material=material, velocity=(1.0, 0.0, 0.0)),
        mca.Body(name="other", geometry=bar, material=material, position=(0.1, 0.0, 0.0)),
    )
    skin = mca.Contact(
        slave=mca.Surface(body="one", nodes="boundary"), master=mca.Surface(body="other", nodes="boundary")
    )
    impact = mca.ImpactPhase(duration=6e-5, output_interval=2e-7)
    scene = mca.Scene(name="bars", bodies=bodies, contacts=(skin,), impact=impact)
    result = mca.run(scene)
    impulse = result.F_n.sum() * result.time[1]
    mass = 7850.0 * 0.1 * 4e-4
    assert impulse == pytest.approx(mass, rel=0.01)  # the first bar stops, the second takes its speed
    passage = 0.2 / np.sqrt(210e9 / 7850.0)
    pressed = result.time[result.F_n > 0.5 * 0.5 * 7850.0 * np.sqrt(210e9 / 7850.0) * 4e-4]
    assert pressed[-1] - pressed[0] == pytest.approx(passage, rel=0.05)
    assert result.summary["contact_duration"] == pytest.approx(passage, rel=0.18 if cells == 10 else 0.05)


@pytest.mark.parametrize("target", ["plane", "block"])
def test_default_on_a_curved_tip_is_near_the_limit_of_stiff_springs(target: str):
    """With penalty = 1 the peak was 3 to 4 % low, the contact 3 to 8 % long. Stiff springs chatter at longer steps."""
    ball = mca.make_scene("hertz_sphere", target=target, section=4, pole_size=2e-4)
    ball = replace(ball, impact=replace(ball.impact, time_step_scale=0.5))
    stiff, usual = (
        mca.run(replace(ball, contacts=(replace(ball.contacts[0], penalty=penalty),))) for penalty in (15.0, None)
    )
    assert usual.summary["F_n_max"] == pytest.approx(stiff.summary["F_n_max"], rel=0.016)
    assert usual.summary["contact_duration"] == pytest.approx(stiff.summary["contact_duration"], rel=0.02)


@pytest.mark.parametrize("element", ["hex8i", "wedge6", "tet4", "tet10"])
@pytest.mark.parametrize("two_way", [False, True])
def test_flat_surfaces_share_the_stiffness_of_a_layer(element: str, two_way: bool):
    """E* A / (2 d) of the whole end in series with the other's, whatever the cells, by the area around each node."""
    d, far = (0.01 / 4, 0.01 / 3), replace(STEEL, E=70e9)
    boxes = [grid((0.01, 0.01, 0.01), (k, k, k), "deep" if element == "wedge6" else "") for k in (4, 3)]
    bodies = (
        mca.Body(name="a", geometry=boxes[0], material=STEEL, element=element, position=(0.0, 0.0, 0.01)),
        mca.Body(name="b", geometry=boxes[1], material=far, element=element),
    )
    low, high = mca.Surface(body="a", nodes="zmin"), mca.Surface(body="b", nodes="zmax")
    contact = mca.Contact(slave=low, master=high, two_way=two_way)
    impact = mca.ImpactPhase(duration=1e-6)
    model = prepared(mca.Scene(name="s", bodies=bodies, contacts=(contact,), impact=impact)).model
    layers = [material.E / (1.0 - 0.3**2) * 1e-4 / depth for material, depth in zip((STEEL, far), d, strict=True)]
    both = 0.5 / sum(1.0 / layer for layer in layers) / (2.0 if two_way else 1.0)
    for item in model.passes:
        finer = 2.0 if element == "tet10" else 1.0  # its nodes are as those of cells of half the size
        assert item.stiffness.sum() == pytest.approx(finer * both, rel=1e-6)
        grown = item.stiffness / item.stiffness.max()
        assert grown.min() < 0.26


@pytest.mark.parametrize("nu", [-0.9, 0.0, 0.499])
def test_default_suits_any_poissons_ratio(nu: float):
    """A penalty takes the bulk modulus, which is E / 8.4 at nu = -0.9 and 167 E at 0.499."""
    ball = mca.make_scene("hertz_sphere", nu=nu, section=4, pole_size=2e-4)
    result = mca.run(replace(ball, contacts=(replace(ball.contacts[0], penalty=None),)))
    assert result["E_contact"].max() < 0.1 * result["E_internal"].max()


def test_stiffness_of_its_own_is_that_of_the_node_that_touches():
    """A rigid octahedron falls on its corner: F = v sqrt(m k), for pi sqrt(m / k), whatever the cells are."""
    corners = 0.01 * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0]], float)
    cells = [[6, k, (k + 1) % 4, 4] for k in range(4)] + [[6, (k + 1) % 4, k, 5] for k in range(4)]
    tetrahedra = np.array(cells, dtype=np.int32)
    mesh = mca.Mesh(points=corners, hexahedra=np.zeros((0, 8), np.int32), tetrahedra=tetrahedra)
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
    body = mca.Body(
        name="top", geometry=mesh, material=steel, rigid=True, position=(0.0, 0.0, 0.01), velocity=(0.0, 0.0, -1.0)
    )
    floor = mca.RigidPlane(normal=(0.0, 0.0, 1.0))
    contact = mca.Contact(slave=mca.Surface(body="top", nodes="boundary"), master=floor, stiffness=1e6)
    mass = 7800.0 * 4.0 / 3.0 * 1e-6
    duration = math.pi * math.sqrt(mass / 1e6)
    impact = mca.ImpactPhase(duration=1.1 * duration, output_interval=duration / 200.0)
    result = mca.run(mca.Scene(name="corner", bodies=(body,), contacts=(contact,), impact=impact))
    assert result.summary["extremes"]["F_n_max"] == pytest.approx(math.sqrt(mass * 1e6), rel=1e-4)
    assert np.count_nonzero(result.F_n) == pytest.approx(200, abs=2)


def test_stiffness_of_its_own_is_that_of_edges_that_cross():
    """The lower edge of a rigid cube falls across the upper one of another: F = v sqrt(m k), for pi sqrt(m / k)."""
    cube, turn = mca.Box(size=(0.02,) * 3, divisions=(1, 1, 1), origin=(-0.01,) * 3), 0.25 * math.pi
    high = {"position": (0.0, 0.0, 0.02 * math.sqrt(2.0) + 1e-7), "velocity": (0.0, 0.0, -1.0)}
    bodies = (
        mca.Body(name="top", geometry=cube, material=STEEL, rigid=True, rotation=(turn, 0.0, 0.0), **high),
        mca.Body(name="base", geometry=cube, material=STEEL, rigid=True, rotation=(0.0, turn, 0.0)),
    )
    sides = {"slave": mca.Surface(body="top", nodes="boundary"), "master": mca.Surface(body="base", nodes="boundary")}
    mass, held = 7850.0 * 0.02**3, mca.Fixed(body="base", nodes="boundary")
    duration = math.pi * math.sqrt(mass / 1e6)
    impact = mca.ImpactPhase(duration=1.1 * duration, output_interval=duration / 200.0)
    scene = mca.Scene(
        name="edges", bodies=bodies, contacts=(mca.Contact(**sides, stiffness=1e6),), fixed=(held,), impact=impact
    )
    result = mca.run(scene)
    assert result.summary["extremes"]["F_n_max"] == pytest.approx(math.sqrt(mass * 1e6), rel=1e-3)
    assert np.count_nonzero(result.F_n) == pytest.approx(200, abs=2)
    assert abs(result.summary["energy_error"]) < 1e-5


@pytest.mark.parametrize("more", [{"penalty": 3.0}, {"bond": mca.Bond(normal=1e6)}])
def test_stiffness_of_its_own_stands_alone(more):
    sides = {"slave": mca.Surface(body="a", nodes="zmin"), "master": mca.Surface(body="b", nodes="zmax")}
    with pytest.raises(mca.RequestError, match=r"Contact\.stiffness = 1000000\.0: leave it or"):
        mca.Contact(**sides, stiffness=1e6, **more)


@pytest.mark.parametrize("how", ["bond", "tie"])
def test_a_plate_joined_over_a_gap_stays_flat(how: str):
    """Nodes that were moved by microns made a flat plate count as curved: all of its springs were 7.6 times stiffer."""
    models = []
    for gap in (0.0, 5e-6):
        lid = mca.Box(size=(0.01, 0.01, 0.002), divisions=(12, 12, 2), origin=(0.0, 0.0, gap))
        base = mca.Box(size=(0.005, 0.01, 0.002), divisions=(3, 6, 1), origin=(0.0, 0.0, -0.002))
        anvil = mca.Box(size=(0.01, 0.01, 0.002), divisions=(6, 6, 1), origin=(0.0, 0.0, 0.003))
        geometry = {"lid": lid, "base": base, "anvil": anvil}
        slave, master = mca.Surface(body="lid", nodes="zmin"), mca.Surface(body="base", nodes="zmax")
        if how == "tie":  # whose nodes all lie on faces
            geometry["base"] = replace(base, size=(0.01, 0.01, 0.002))
            slave = mca.Surface(body="lid", nodes="foot")
            geometry["lid"] = replace(lid.build(), node_sets={"foot": np.flatnonzero(_foot(lid.build().points))})
        scene = mca.Scene(
            name="joined",
            bodies=tuple(mca.Body(name=name, geometry=own, material=STEEL) for name, own in geometry.items()),
            contacts=(
                mca.ContactAll(initial_overlap="stress_free", exclude=(("lid", "base"),)),
                mca.Contact(
                    slave=mca.Surface(body="lid", nodes="boundary"), master=mca.RigidPlane(normal=(0.0, 0.0, -1.0))
                ),
                *((mca.Contact(slave=slave, master=master, bond=mca.Bond()),) if how == "bond" else ()),
            ),
            ties=(mca.Tie(slave=slave, master=master),) if how == "tie" else (),
            impact=mca.ImpactPhase(duration=1e-6),
        )
        models.append(prepared(scene).model)
    exact, healed = models
    for one, other in zip(exact.passes, healed.passes, strict=True):
        assert not one.curved and not other.curved
        assert other.stiffness == pytest.approx(one.stiffness, rel=0.02)
    assert healed.stable.dt == pytest.approx(exact.stable.dt, rel=0.02)


def _foot(points: np.ndarray) -> np.ndarray:
    """Nodes of the half of a plate's lower side that is tied."""
    return (points[:, 2] < points[:, 2].min() + 1e-9) & (points[:, 0] < 0.0051)
