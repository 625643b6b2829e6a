"""Random scenes follow from their seeds, bodies meet, and the judge measures depths that are known."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warp_mca as mca
from benchmarks.measurements import FOLDER
from benchmarks.random_scenes.__main__ import main, merged
from benchmarks.random_scenes.crossing import FAMILIES, crossing
from benchmarks.random_scenes.default import default
from benchmarks.random_scenes.judge import DEEP, THROUGH, silent
from benchmarks.random_scenes.measure import measure
from benchmarks.random_scenes.overlap import Skin, crossings, depth, reversed_share
from benchmarks.random_scenes.page import write_page
from benchmarks.random_scenes.placing import chord, travel
from benchmarks.random_scenes.shapes import KINDS, finer, shape
from warp_mca.geometry.cell_types import triangulated
from warp_mca.physics.contact.skin_edges import is_two_way

W = 0.01
DOWN = np.array([0.0, -1.0, 0.0])


def box(size, cells, turn=None, shift=(0.0, 0.0, 0.0)) -> Skin:
    mesh = mca.Box(size=size, divisions=cells, origin=tuple(-0.5 * s for s in size)).build()
    points = mesh.points if turn is None else turn.apply(mesh.points)
    return Skin.of(points + shift, triangulated(mesh.boundary[0]))


def deep(one: Skin, other: Skin) -> float:
    return depth(one, other, DOWN, np.random.default_rng(0))[0]


@pytest.mark.parametrize("cells", [1, 3])
@pytest.mark.parametrize("wanted", [1e-5, 1e-4, 1e-3, 3e-3])
def test_depth_of_edges_that_cross(cells, wanted):
    """Bars whose sharp edges cross at right angles, without a node of one in the other."""
    low, half = Rotation.from_rotvec([np.pi / 4, 0.0, 0.0]), W / np.sqrt(2.0)
    top = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]) * low
    size, divisions = (6.0 * W, W, W), (7 * cells, cells, cells)
    bars = box(size, divisions, low), box(size, divisions, top, (0.0013, 2.0 * half - wanted, 0.0007))
    assert 0.5 * wanted < deep(*bars) < 1.1 * wanted
    apart = box(size, divisions, low), box(size, divisions, top, (0.0013, 2.0 * half + wanted, 0.0007))
    assert deep(*apart) == 0.0
    assert not len(crossings(*apart)[0])


@pytest.mark.parametrize("wanted", [1e-4, 1e-3, 5e-3])
def test_depth_of_faces(wanted):
    turn = Rotation.from_rotvec([0.001, 0.002, 0.0])
    pair = box((W, W, W), (3, 3, 3)), box((W, W, W), (4, 4, 4), turn, (0.003, W - wanted, 0.002))
    assert deep(*pair) == pytest.approx(wanted, rel=0.05, abs=3e-5)


@pytest.mark.parametrize("wanted", [0.1 * W, 0.45 * W])
def test_a_plate_within_a_rod_comes_out_the_way_it_came(wanted):
    """Its own thickness, 2 mm, is no way out."""
    plate = box((0.2 * W, 2.0 * W, 3.0 * W), (1, 5, 8), None, (0.0011, 1.5 * W - wanted, 0.0021))
    assert deep(box((6.0 * W, W, W), (20, 4, 4)), plate) == pytest.approx(wanted, rel=0.05)


def test_bodies_change_sides():
    rod = box((6.0 * W, W, W), (6, 2, 2))
    shares = [
        reversed_share(rod, box((W, W, W), (2, 2, 2), None, (0.001, y, 0.002)), DOWN) for y in (1.2 * W, -1.2 * W)
    ]
    assert shares == [0.0, 1.0]


def test_travel_ends_where_the_bodies_touch():
    low, half = Rotation.from_rotvec([np.pi / 4, 0.0, 0.0]), W / np.sqrt(2.0)
    top = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]) * low
    one, other = box((6 * W, W, W), (7, 1, 1), low), box((6 * W, W, W), (7, 1, 1), top, (0.001, 5.0 * W, 0.002))
    assert travel(other.x, other.triangle, one.x, one.triangle, DOWN) == pytest.approx(5.0 * W - 2.0 * half, rel=1e-12)
    sidewards = np.array([0.0, 0.0, 1.0])
    assert travel(other.x, other.triangle, one.x, one.triangle, sidewards) == np.inf
    assert chord(one.x, one.triangle, np.array([1e-4, 0.0, 2e-4]), -DOWN) == pytest.approx(
        (2e-4 - half, half - 2e-4), rel=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_finer_cells_fill_the_same_shape(kind):
    for seed in range(3):
        own = shape(np.random.default_rng(seed), kind, W, 0.6 * W, 3000).mesh
        fine = finer(own, 3)
        assert fine.cell_count == 27 * own.cell_count
        volumes = []
        for mesh in (own, fine):
            a, b, c = (mesh.points[triangulated(mesh.boundary[0])[:, k]] for k in range(3))
            volumes.append(np.einsum("ij,ij", a, np.cross(b, c)) / 6.0)
        assert volumes[1] == pytest.approx(volumes[0], rel=1e-3) and volumes[0] > 0.0


@pytest.mark.parametrize("family", FAMILIES)
def test_bodies_that_nothing_stops_go_through_each_other(family):
    for seed in range(2):
        found = crossing(seed, family)
        again = crossing(seed, family)
        assert found.scene.impact == again.scene.impact
        skins, speed = [], np.subtract(found.scene.bodies[1].velocity, found.scene.bodies[0].velocity)
        for body, other in zip(found.scene.bodies, again.scene.bodies, strict=True):
            assert np.array_equal(body.geometry.points, other.geometry.points) and body.position == other.position
            x = Rotation.from_rotvec(body.rotation).apply(body.geometry.points) + body.position
            skins.append(Skin.of(x, triangulated(body.geometry.boundary[0])))
        one, other = skins
        assert not len(crossings(one, other)[0]) and not len(crossings(other, one)[0])
        way = speed * found.scene.impact.duration
        met = [deep(one, Skin.of(other.x + s * way, other.triangle)) for s in (0.3, 0.5)]
        assert max(met) > DEEP * found.least
        assert found.scene.impact.duration / found.frames * np.linalg.norm(speed) < THROUGH * found.least


def test_a_run_is_judged():
    row = measure(("crossing", 6, "cpu", False))
    assert (row["status"], row["seen"], row["touched"]) == ("finished", "apart", True)
    assert row["momentum_off"] < 1e-5
    passed = row | {"seen": "through", "said": ["a body turns, and so on"]}
    assert silent(passed)
    assert not silent(passed | {"said": ["one and other went into each other from t = 0 s on"]})
    assert not silent(passed | {"status": "stopped"})


def test_a_scene_whose_contact_is_taken_out_is_seen(monkeypatch):
    """The judge does not ask the contact."""
    from benchmarks.random_scenes import measure as module

    def without(seed: int, family: str, times: int = 1):
        found = crossing(seed, family, times)
        fixed = (mca.Contact(slave=mca.Surface(body="one", nodes="boundary"), master=mca.RigidPlane(point=(0, -9, 0))),)
        return dataclasses.replace(found, scene=dataclasses.replace(found.scene, contacts=fixed))

    monkeypatch.setattr(module, "crossing", without)
    row = measure(("crossing", 6, "cpu", False))
    assert row["seen"] == "through" and row["momentum_off"] < 1e-6


@pytest.mark.parametrize("seed", [326, 342])
def test_bodies_that_are_apart_are_not_refused(seed):
    """Nodes behind faces of a blade that lean, though beside it, were said to lie inside it by `contacts="all"`."""
    scene = crossing(seed).scene
    short = dataclasses.replace(scene.impact, duration=1e-9, output_interval=1e-9)
    assert mca.run(dataclasses.replace(scene, impact=short)).summary["extremes"]["F_n_max"] == 0.0


@pytest.mark.parametrize(("seed", "time", "most"), [(57, 2e-5, 0.003), (274, 6e-5, 0.01)])
def test_energy_goes_on_from_spring_to_spring(seed, time, most):
    """Nodes that went from the edge of a blade to its face made 5 %, edges that went on over a node 7 %."""
    scene = crossing(seed).scene
    impact = dataclasses.replace(scene.impact, duration=time, output_interval=time / 100, energy_tolerance=1.0)
    assert mca.run(dataclasses.replace(scene, impact=impact)).summary["energy_error"] < most


@pytest.mark.parametrize(("place", "two_way"), [(0.0, True), (1.0, False)])
def test_small_faces_at_the_ends_of_a_rod_do_not_make_it_a_fine_slave(place, two_way):
    """A ball went through a rod whose nodes lay farther apart, because the least faces of both were alike."""
    x = np.repeat([1.0, 0.0], [8, 40])[:, None] * np.ones(3)
    rod = SimpleNamespace(area=np.repeat([1e-5, 1e-4], [8, 40]), middle=x)
    ball = SimpleNamespace(area=np.full(24, 7e-6), middle=np.full((24, 3), place))
    assert is_two_way(crossing(330).scene.contacts[0], rod, ball) == two_way  # type: ignore[arg-type]


def test_plain_scenes_follow_from_their_seeds():
    assert default(3).scene == default(3).scene
    row = measure(("default", 2, "cpu", False))
    assert row["status"] == "finished" and row["finite"] and row["touched"]


def test_page_is_written_from_what_was_stored(tmp_path):
    stored = json.loads((FOLDER / "random_scenes.json").read_text(encoding="utf-8"))
    write_page(stored, tmp_path / "page.md")
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == (FOLDER / "random_scenes.md").read_text(
        encoding="utf-8"
    )
    assert merged(stored, stored[:3]) == stored


def test_a_scene_is_shown(tmp_path, capsys):
    main(["--family", "crossing", "--show", "6", "--folder", str(tmp_path)])
    assert {file.name for file in tmp_path.iterdir()} == {"crossing_6.png", "crossing_6.py"}
    assert "box on box" in capsys.readouterr().out
