"""Bodies that go through each other are told of, whatever their cells, rows, contacts and joints; others are not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from impacts import begun, result_of

import warp_mca as mca

SOFT = mca.Elastic(E=2e9, nu=0.3, rho=1200.0)
W = 0.008


def told(result: mca.Result) -> list[str]:
    return [text for text in result.warnings if "each other" in text or "below the rigid plane" in text]


def box(name: str, cells: int | tuple[int, int, int], size: tuple = (W, W, W), **start: Any) -> mca.Body:
    divisions = (cells,) * 3 if isinstance(cells, int) else cells
    geometry = mca.Box(size=size, divisions=divisions, origin=tuple(-0.5 * s for s in size))
    return mca.Body(name=name, geometry=geometry, material=SOFT, **start)


def scene(*bodies: mca.Body, duration: float, rows: int = 100, **more: Any) -> mca.Scene:
    impact = mca.ImpactPhase(duration=duration, output_interval=duration / rows, energy_tolerance=0.05)
    return mca.Scene(name="through", bodies=bodies, impact=impact, **more)


def skins(slave: str, master: str, **more: Any) -> mca.Contact:
    return mca.Contact(
        slave=mca.Surface(body=slave, nodes="boundary"), master=mca.Surface(body=master, nodes="boundary"), **more
    )


def seen(warning: str) -> tuple[float, float]:
    """Time [s] and depth [m] of a warning."""
    return float(warning.split("t = ")[1].split()[0]), float(warning.split("up to ")[1].split()[0])


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize(("cells", "speed", "rows"), [(1, 15.0, 100), (2, 15.0, 3), (3, 300.0, 2)])
def test_one_that_flies_through_another_is_told(cells: int, speed: float, rows: int, rigid: bool):
    """Sides are flush; it touches after 1 mm, and is beyond long before the end."""
    mover = box("b", cells, position=(0.0, W + 1e-3, 0.0), velocity=(0.0, -speed, 0.0), rigid=rigid)
    (warning,) = told(mca.run(scene(box("a", 2), mover, duration=0.06 / speed, rows=rows)))
    time, depth = seen(warning)
    assert warning.startswith("a and b went into each other from t = ")
    assert 1e-3 < speed * time < 1e-3 + W
    assert 0.3 * W < depth <= 0.5 * W


@pytest.mark.parametrize(("along", "across", "speed"), [(7, 1, 8.0), (11, 2, 2.0)])
def test_edges_that_cross_between_the_nodes_of_a_contact_do_not_pass(along: int, across: int, speed: float):
    """They lay 1 mm in each other, unseen, where nodes alone were kept out."""
    size, h = (0.05, W, W), W / math.sqrt(2.0)
    low = np.array([math.pi / 4, 0.0, 0.0])
    bodies = (
        box("a", (along, across, across), size, rotation=tuple(low), position=(0.0, -h, 0.0)),
        box(
            "b",
            (along, across, across),
            size,
            rotation=_quarter(),
            position=(0.0, h + 2e-5, 0.0),
            velocity=(0.0, -speed, 0.0),
        ),
    )
    result = mca.run(scene(*bodies, duration=2e-3 / speed, contacts=(skins("b", "a", two_way=True),)))
    assert not told(result)
    assert 0.0 < result.summary["max_penetration"] < 4e-4


def _quarter() -> tuple[float, ...]:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec([0.0, math.pi / 2, 0.0]) * Rotation.from_rotvec([math.pi / 4, 0.0, 0.0])
    return tuple(turn.as_rotvec().tolist())


@pytest.mark.parametrize("two_way", [False, True])
def test_contact_that_works_is_not_told_of(two_way: bool):
    """A tumbling cube on a block, a ball on a thin plate of one layer."""
    cube = box("cube", 3, position=(1e-3, 1.4 * W, 0.0), rotation=(0.6, 0.2, 0.4), velocity=(0.0, -6.0, 0.0))
    block = box("block", (6, 3, 6), (3 * W, W, 3 * W))
    assert not told(mca.run(scene(cube, block, duration=1e-3, contacts=(skins("cube", "block", two_way=two_way),))))
    ball = mca.Body(
        name="ball",
        geometry=mca.Sphere(radius=W, section=4, ring=2),
        material=SOFT,
        position=(0.0, 1.15 * W, 0.0),
        velocity=(0.0, -4.0, 0.0),
    )
    plate = box("plate", (10, 1, 10), (6 * W, 0.2 * W, 6 * W))
    held = (mca.Fixed(body="plate", nodes="xmin"), mca.Fixed(body="plate", nodes="xmax"))
    result = mca.run(scene(ball, plate, duration=5e-4, fixed=held, contacts=(skins("ball", "plate", two_way=two_way),)))
    assert result.summary["F_n_max"] > 10.0
    assert not told(result)


@pytest.mark.parametrize("off", [0.0, 2e-6])
def test_bodies_that_slide_past_each_other_are_not_told_of(off: float):
    floor = box("floor", (8, 2, 8), (8 * W, W, 8 * W))
    slider = box("slider", 3, position=(-2.0 * W, W + off, 0.3 * W), velocity=(30.0, 0.0, 0.0))
    assert not told(mca.run(scene(floor, slider, duration=1e-3)))


@pytest.mark.parametrize(("speed", "warns"), [(4.0, False), (12.0, True)])
def test_a_body_in_a_hollow_one_is_told_of_where_it_meets_the_wall(speed: float, warns: bool):
    """It has 8 mm of room on each side, for 1 ms; what is buried in solid from the start is meant."""
    grid = mca.Box(size=(5 * W,) * 3, divisions=(5, 5, 5), origin=(-2.5 * W,) * 3).build()
    wall = (np.abs(grid.points[grid.hexahedra].mean(axis=1)) > 1.5 * W).any(axis=1)
    nodes, cells = np.unique(grid.hexahedra[wall], return_inverse=True)
    hollow = mca.Mesh(
        grid.points[nodes], cells.reshape(-1, 8).astype(np.int32), {}, {"body": np.arange(wall.sum(), dtype=np.int32)}
    )
    bodies = (mca.Body(name="hollow", geometry=hollow, material=SOFT), box("in", 2, velocity=(speed, 0.1, 0.2)))
    assert bool(told(mca.run(scene(*bodies, duration=1e-3)))) == warns
    buried = (box("solid", 3, (4 * W,) * 3), box("in", 2, velocity=(40.0, 0.0, 0.0)))
    assert not told(mca.run(scene(*buried, duration=1e-3)))


@pytest.mark.parametrize(("turn", "warns"), [(1.2, False), (2.9, True)])
def test_links_overlap_at_their_hinge_but_not_all_along(turn: float, warns: bool):
    """Two bars, 10 mm thick and 100 mm long, fold up about a hinge amid their ends."""
    size, duration = (0.1, 0.01, 0.01), 0.02
    geometry = mca.Box(size=size, divisions=(10, 2, 2), origin=(0.0, -0.005, -0.005))
    links = (
        mca.Body(name="a", geometry=geometry, material=SOFT, rigid=True),
        mca.Body(
            name="b", geometry=geometry, material=SOFT, rigid=True, position=(0.1, 0.0, 0.0),
            angular_velocity=(0.0, 0.0, turn / duration),
        ),
    )  # fmt: skip
    hinge = mca.Revolute(name="H", body="a", other="b", at=(0.1, 0.0, 0.0), other_at=(0.0, 0.0, 0.0))
    held = (mca.Fixed(body="a", nodes="xmin"),)
    result = mca.run(scene(*links, duration=duration, joints=(hinge,), fixed=held))
    assert bool(told(result)) == warns


def strip(thick: float, gap: float, long: float) -> mca.Mesh:
    """A U: two legs along x, one cell thick, and a web that joins them at x = 0."""
    xs = np.append(0.0, np.linspace(thick, long, 10))
    ys = np.array([0.0, thick, thick + 0.5 * gap, thick + gap, 2.0 * thick + gap])
    grid = mca.Box(size=(1.0, 1.0, 2.0 * thick), divisions=(10, 4, 2)).build()
    i, j = (np.rint(grid.points[:, axis] * count).astype(int) for axis, count in ((0, 10), (1, 4)))
    points = np.stack([xs[i], ys[j], grid.points[:, 2]], axis=1)
    middle = points[grid.hexahedra].mean(axis=1)
    kept = (middle[:, 0] < thick) | (middle[:, 1] < thick) | (middle[:, 1] > thick + gap)
    nodes, cells = np.unique(grid.hexahedra[kept], return_inverse=True)
    points = points[nodes]
    end = (points[:, 0] > long - 1e-9) & (points[:, 1] > thick + gap - 1e-9)
    sets = {"end": np.flatnonzero(end).astype(np.int32), "foot": np.flatnonzero(points[:, 1] < 1e-9).astype(np.int32)}
    return mca.Mesh(
        points, cells.reshape(-1, 8).astype(np.int32), sets, {"body": np.arange(kept.sum(), dtype=np.int32)}
    )


@pytest.mark.parametrize(("way", "warns"), [(3e-3, False), (7e-3, True)])
def test_legs_of_a_body_that_are_driven_through_each_other_are_told(way: float, warns: bool):
    """The gap is 4 mm wide."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=200e6, E_t=1e9)
    body = mca.Body(name="clip", geometry=strip(1.5e-3, 4e-3, 0.02), material=metal, kinematics="finite")
    drive = mca.Prescribed(body="clip", nodes="end", axis="y", times=(0.0,), velocities=(-10.0,))
    held = (mca.Fixed(body="clip", nodes="foot"),)
    warnings = told(mca.run(scene(body, duration=way / 10.0, fixed=held, prescribed=(drive,))))
    assert [text.startswith("parts of clip went through each other from t = 0.0004") for text in warnings] == [
        True
    ] * warns


def test_scenes_of_a_batch_are_looked_at_as_alone():
    """Looks of one scene are due when those of another are not."""
    scenes = [
        scene(box("a", 2), box("b", n, position=(0.0, 1.1 * W, 0.0), velocity=(0.0, -v, 0.0)), duration=6e-4)
        for n, v in ((2, 20.0), (2, 1.0), (2, 60.0))
    ]
    batch = begun(*scenes)
    batch.advance()
    for k, item in enumerate(scenes):
        alone = begun(item)
        alone.advance()
        assert alone.steps == batch.steps
        assert told(result_of(batch, k)) == told(result_of(alone))
        assert len(told(result_of(alone))) == (k != 1)
