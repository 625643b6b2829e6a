"""How deep skins lie in each other: closed forms of boxes, whatever their cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.geometry.mesh import Mesh
from warp_mca.watch.skins import Skin, crossed

NO_TURN = (0.0, 0.0, 0.0)


def skin(mesh: Mesh, centre: tuple[float, ...] = NO_TURN, turn: tuple[float, ...] = NO_TURN) -> Skin:
    found = Skin("it", mesh.boundary[0], mesh.points, 0)
    found.move(Rotation.from_rotvec(turn).apply(mesh.points[found.nodes]) + np.asarray(centre))
    return found


def box(size: tuple[float, float, float], cells: tuple[int, int, int], *place: tuple[float, ...]) -> Skin:
    return skin(mca.Box(size=size, divisions=cells, origin=tuple(-0.5 * s for s in size)).build(), *place)


def depth(one: Skin, other: Skin, least: float = 0.0) -> float:
    return crossed(one, other, (one.box, other.box), one.box.mean(axis=0), least)[0]


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e3])
@pytest.mark.parametrize("cells", [(1, 1), (2, 2), (3, 1), (5, 7)])
def test_cubes_with_flush_sides_lie_as_deep_in_each_other_as_they_overlap(cells: tuple[int, int], scale: float):
    """No node of one cell lies inside, and all edges lie in faces."""
    side = 0.02 * scale
    one, other = (
        box((side,) * 3, (n,) * 3, (5.0 * scale, height, 0.0))
        for n, height in zip(cells, (0.0, 0.75 * side), strict=True)
    )
    assert depth(one, other) == pytest.approx(0.25 * side, rel=0.1)
    assert depth(other, one) == pytest.approx(0.25 * side, rel=0.1)


@pytest.mark.parametrize("away", [0.0, 1e-6, -5e-5])
def test_boxes_that_touch_do_not_cross(away: float):
    """Nor where they overlap by less than nodes are moved inwards, up to a fiftieth of a cell."""
    one, other = box((0.06, 0.02, 0.06), (6, 2, 6)), box((0.02,) * 3, (2,) * 3, (0.02, 0.02 + away, 0.013))
    assert depth(one, other) == 0.0


@pytest.mark.parametrize("along", [1, 2, 5, 12])
@pytest.mark.parametrize("inside", [5e-4, 2e-3])
def test_edges_that_cross_between_nodes_are_found(along: int, inside: float):
    """Edges of two square bars cross: middles of the parts inside lie 1 / sqrt 2 as deep below faces."""
    low = (math.pi / 4, 0.0, 0.0)
    top = tuple((Rotation.from_rotvec([0.0, math.pi / 2, 0.0]) * Rotation.from_rotvec(low)).as_rotvec())
    height = 0.01 * math.sqrt(2.0) - inside
    bars = [
        box((0.06, 0.01, 0.01), (along, 1, 1), centre, turn)
        for centre, turn in ((NO_TURN, low), ((0.001, height, 0.002), top))
    ]
    # nodes are moved inwards by a fiftieth of a cell, up to 0.2 mm
    assert depth(*bars) == pytest.approx(inside / math.sqrt(2.0), abs=2e-4)


def test_thickness_and_gap_of_a_frame():
    """A square tube, 1 mm thick and 8 mm wide inside; a solid block has no gap."""
    grid = mca.Box(size=(0.01, 0.01, 0.01), divisions=(10, 10, 2)).build()
    middle = grid.points[grid.hexahedra].mean(axis=1)
    wall = (np.abs(middle[:, :2] - 0.005) > 0.004).any(axis=1)
    nodes, cells = np.unique(grid.hexahedra[wall], return_inverse=True)
    tube = skin(Mesh(grid.points[nodes], cells.reshape(-1, 8).astype(np.int32)))
    assert tube.thickness == pytest.approx(1e-3, rel=1e-3)
    assert tube.gap == pytest.approx(8e-3, rel=1e-3)
    assert np.isinf(box((0.01,) * 3, (2,) * 3).gap)


def test_a_body_that_turns_as_a_whole_is_not_bent():
    turned = box((0.1, 0.01, 0.01), (10, 1, 1), (3.0, 0.0, 1.0), (0.5, -2.0, 1.0))
    assert turned.bent() < 1e-12
    turned.move(turned.x + np.array([0.0, 0.002, 0.0]) * (turned.x[:, :1] > turned.x[:, 0].mean()))
    assert turned.bent() == pytest.approx(0.001, rel=0.5)


def test_a_skin_that_is_looked_at_again_finds_what_a_new_one_finds():
    """With fewer edges, more of them than ever before, and other places."""
    one, other = box((0.02,) * 3, (4, 4, 4)), box((0.01,) * 3, (2, 2, 2))
    crossing = 0
    for shift, count in ((0.008, 5), (0.009, 3), (0.007, None), (0.0115, 40)):
        found = []
        for pair in ((one, other), (box((0.02,) * 3, (4, 4, 4)), box((0.01,) * 3, (2, 2, 2)))):
            pair[1].move(pair[1].X + np.array([shift, 0.001, 0.0]))
            for skin in pair:
                skin.settle(np.array([0.01, 0.0, 0.0]))
            edges = np.arange(len(pair[0].edge), dtype=np.int32)[:count]
            found.append([*pair[0].edges_in(pair[1], edges), *pair[1].edges_in(pair[0], edges[: len(pair[1].edge)])])
        assert all(np.array_equal(a, b) for a, b in zip(*found, strict=True))
        crossing += found[0][0].any() or found[0][2].any()
    assert crossing > 1
