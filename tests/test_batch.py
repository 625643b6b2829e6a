"""Batches: each scene as if it were alone, whatever the others do; what they must share; files."""

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun
from sharp_edges import in_frame

import warp_mca as mca
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.hardware.simd import RANGE_MULTIPLE
from warp_mca.physics.elements.patches import make_patches
from warp_mca.results.storage import ALL_FILES, PROBE_FILES
from warp_mca.studies.batch import check_alike

pytestmark = pytest.mark.usefixtures("no_figures")


def hinged(
    E: float = 70e9,
    mu: float = 0.4,
    speed: float = 3.0,
    gravity: float = 9.8,
    element: str = "hex8",
    cells: int = 4,
    penalty: float = 1.0,
    **impact: float,
) -> mca.Scene:
    """Two hinged bars that yield fly aslant into a rough plate, which holds on to some of its friction."""
    metal = mca.J2Bilinear(E=E, nu=0.3, rho=2700.0, sigma_y=5e6, E_t=0.1 * E, beta=0.3)
    flight = {"material": metal, "velocity": (1.0, -speed, 0.5), "element": element}
    bar = mca.Box(size=(0.02, 0.06, 0.02), divisions=(cells, 4 * cells, cells), origin=(-0.011, 0.0, -0.012))
    plate = mca.Box(size=(0.06, 0.03, 0.06), divisions=(8, 4, 8), origin=(-0.03, -0.03, -0.03))
    top = mca.Surface(body="plate", nodes="ymax")
    middle = mca.Line(body="low", start=(0.0, 0.001, 0.0), end=(0.0, 0.05, 0.0))
    return mca.Scene(
        name="hinged",
        bodies=(
            mca.Body(name="low", geometry=bar, **flight),
            mca.Body(name="high", geometry=bar, position=(0.0, 0.06, 0.0), **flight),
            mca.Body(name="plate", geometry=plate, material=metal, element=element),
        ),
        joints=(mca.Revolute(name="A", body="low", at=(-0.011, 0.06, 0.0), other="high", other_at=(-0.011, 0.0, 0.0)),),
        contacts=(
            mca.Contact(slave=mca.Surface(body="low", nodes="ymin"), master=top, mu=mu, penalty=penalty, two_way=True),
        ),
        fixed=(mca.Fixed(body="plate", nodes="ymin"),),
        paths=(mca.Path(name="middle", lines=(middle,), spacing=0.01),),
        gravity=(0.0, -gravity, 0.0),
        impact=mca.ImpactPhase(**{"duration": 4e-5, "output_interval": 1e-6} | impact),
        tip=mca.Point(body="low", at=(0.0, 0.0, 0.0)),
        target=mca.Point(body="plate", at=(0.0, 0.0, 0.0)),
    )


def driven(v: float, mu: float, normal: mca.scene.Vec3, soft: bool = False) -> mca.Scene:
    """The same bars on a moving plane, pushed from above by a table."""
    scene = hinged(E=50e9 if soft else 70e9)
    plane = mca.RigidPlane(normal=normal, velocity=(v, 0.0, 0.0))
    return replace(
        scene,
        bodies=scene.bodies[:2],
        fixed=(),
        target=None,
        contacts=(mca.Contact(slave=mca.Surface(body="low", nodes="ymin"), master=plane, mu=mu),),
        prescribed=(
            mca.Prescribed(body="high", nodes="ymax", axis="y", times=(0.0, 1e-5), velocities=(-3.0, -3.0 - v)),
        ),
    )


def alone(scene: mca.Scene, result: mca.Result, precision: str) -> mca.Result:
    """The run of a scene by itself, with the time step that it had in the batch."""
    scale = result.summary["dt"] / result.summary["stable_dt"] * (1.0 + 1e-9)
    one = mca.run(replace(scene, impact=replace(scene.impact, time_step_scale=scale)), precision=precision)
    assert one.summary["dt"] == result.summary["dt"]
    return one


def test_histories_are_those_of_each_scene_alone_bit_for_bit():
    """Numbers of elements are multiples of the CPU's lanes, so that none is computed apart."""
    scenes = [hinged(), hinged(E=50e9, speed=5.0), hinged(mu=0.0), hinged(mu=0.1, gravity=1e5)]
    results = mca.run_batch(scenes)
    for k, (scene, result) in enumerate(zip(scenes, results, strict=True)):
        one = alone(scene, result, "mixed")
        assert one.summary["n_elements"] % RANGE_MULTIPLE == 0
        assert one.F_n.max() > 1e3
        for name in one.history:
            assert np.array_equal(one[name], result[name], equal_nan=True), name
        assert np.array_equal(one.paths[0].stress, result.paths[0].stress)
        for name in (
            "max_plastic_strain",
            "energy",
            "joint_impulse",
            "max_penetration",
            "contacts",
            "n_steps",
            "extremes",
        ):
            assert one.summary[name] == result.summary[name], name
        assert result.summary["batch"] == {"scene": k, "scenes": 4}
    assert results[2].F_t.max() < results[0].F_t.max()
    assert len({result.F_n.max() for result in results}) == 4
    assert len({result.summary["extremes"]["F_n_max"] for result in results}) == 4


@pytest.mark.parametrize(
    "scenes",
    [
        [hinged(), hinged(element="hex8r", cells=3), hinged(element="tet4"), hinged(cells=5)],
        [driven(2.0, 0.0, (0, 1, 0)), driven(1.0, 0.3, (0, 2, 0)), driven(0.5, 0.3, (0, 1, 0), soft=True)],
    ],
    ids=["elements and meshes", "planes and tables"],
)
def test_scenes_may_differ_in_all_that_is_data(scenes):
    for scene, result in zip(scenes, mca.run_batch(scenes, precision="float64"), strict=True):
        one = alone(scene, result, "float64")
        for name in one.history:
            np.testing.assert_allclose(result[name], one[name], atol=1e-9 * np.nanmax(np.abs(one[name])), err_msg=name)
        stress = one.paths[0].stress
        np.testing.assert_allclose(result.paths[0].stress, stress, atol=1e-5 * np.abs(stress).max())


def test_scenes_with_other_kinds_of_elements_give_the_bits_that_they_give_alone():
    """Whichever comes first: forces on a node between two kinds are added in the order of a scene alone."""
    elastic = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=5e6, E_t=7e9)
    box = mca.Box(size=(0.04, 0.02, 0.02), divisions=(8, 4, 4)).build()
    points = box.points + np.random.default_rng(0).uniform(-4e-4, 4e-4, box.points.shape)
    half = np.flatnonzero(box.points[box.hexahedra].mean(axis=1)[:, 0] < 0.02).astype(np.int32)
    mesh = mca.Mesh(points, box.hexahedra, box.node_sets, {"half": half})

    def scene(material: mca.Elastic | dict[str, mca.Elastic]) -> mca.Scene:
        body = mca.Body(name="a", geometry=mesh, material=material, velocity=(1.0, -3.0, 0.5))
        floor = mca.RigidPlane(point=(0.0, -3.9e-4, 0.0))
        contact = mca.Contact(slave=mca.Surface(body="a", nodes="ymin"), master=floor, mu=0.2)
        impact = mca.ImpactPhase(duration=4e-5, output_interval=2e-6)
        return mca.Scene(name="falls", bodies=(body,), contacts=(contact,), impact=impact)

    one, other = scene(elastic), scene({"half": elastic, "*": metal})
    for scenes in ([one, other], [other, one]):
        for made, result in zip(scenes, mca.run_batch(scenes, precision="float64"), strict=True):
            own = alone(made, result, "float64")
            assert all(np.array_equal(own[name], result[name], equal_nan=True) for name in own.history)


def test_patches_of_a_gpu_are_those_of_each_scene_alone():
    """So that sums over a patch have the order that they have without the other scenes."""
    meshes = [mca.Box(size=(1.0, 1.0, 1.0), divisions=n).build() for n in ((7, 6, 7), (5, 5, 5), (8, 8, 4))]
    conns = [mesh.hexahedra.T.astype(np.int32) for mesh in meshes]
    nodes, ends = np.cumsum([0, *(len(mesh.points) for mesh in meshes)]), np.cumsum([conn.shape[1] for conn in conns])
    assert ends[0] % PATCH and ends[1] % PATCH
    shifted = [conn + np.int32(first) for conn, first in zip(conns, nodes, strict=False)]
    joined = make_patches(np.concatenate(shifted, axis=1), ends.tolist())
    single = [make_patches(conn) for conn in conns]
    assert np.array_equal(joined.places, np.concatenate([patches.places for patches in single]))
    assert np.array_equal(joined.corner, np.concatenate([patches.corner for patches in single], axis=1))
    own = [patches.node + first for patches, first in zip(single, nodes, strict=False)]
    assert np.array_equal(joined.node, np.concatenate(own))
    for name in ("start", "slot_start"):
        sizes = np.concatenate([np.diff(getattr(patches, name)) for patches in single])
        assert np.array_equal(np.diff(getattr(joined, name)), sizes)
    assert len(sizes) > len(meshes)


def test_bars_of_a_batch_follow_wave_theory_each_with_its_own_speed():
    """F = rho c A v; the stiffest sets the step of all."""

    def bar(E: float, v: float) -> mca.Scene:
        rod = mca.Box(size=(0.2, 0.01, 0.01), divisions=(100, 1, 1))
        body = mca.Body(name="bar", geometry=rod, material=mca.Elastic(E=E, nu=0.0, rho=2700.0), velocity=(v, 0.0, 0.0))
        wall = mca.RigidPlane(point=(0.2, 0.0, 0.0), normal=(-1, 0, 0))
        return mca.Scene(
            name="bar",
            bodies=(body,),
            contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall, penalty=1.0),),
            impact=mca.ImpactPhase(duration=7e-5),
        )

    cases = [(70e9, 1.0), (20e9, 1.0), (140e9, 0.5), (70e9, 3.0)]
    results = mca.run_batch([bar(*case) for case in cases])
    for (E, v), result in zip(cases, results, strict=True):
        plateau = result.F_n[(result.time > 2e-5) & (result.time < 5e-5)].mean()
        assert plateau == pytest.approx(2700.0 * np.sqrt(E / 2700.0) * 1e-4 * v, rel=5e-3)
        assert result.summary["energy_error"] < 1e-3
    steps = {result.summary["dt"] for result in results}
    assert len(steps) == 1
    assert steps.pop() <= 0.9 * min(result.summary["stable_dt"] for result in results)


def test_one_scene_is_run_as_alone():
    (result,), one = mca.run_batch([hinged()]), mca.run(hinged())
    assert all(np.array_equal(one[name], result[name], equal_nan=True) for name in one.history)
    assert "batch" not in result.summary


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_scene_that_breaks_leaves_the_others_alone(tmp_path, monkeypatch):
    monkeypatch.setattr("warp_mca.system.precision.MODULI", (0.0, np.inf))  # such scenes are refused otherwise
    sunk, overflowed = hinged(penalty=1e-7, speed=30.0, duration=1.5e-4), hinged(duration=1.5e-4)
    metal = mca.Elastic(E=1e39, nu=0.0, rho=2700e28)  # its stress is beyond float32
    overflowed = replace(overflowed, bodies=tuple(replace(body, material=metal) for body in overflowed.bodies))
    tight = hinged(energy_tolerance=1e-9, duration=1.5e-4)
    sound = hinged(mu=0.2, duration=1.5e-4)
    scenes = [sunk, tight, sound, overflowed]
    results = mca.run_batch(scenes, out=tmp_path / "sweep")
    for scene, result in zip(scenes, results, strict=True):
        if scene is sound:
            assert result.stopped is None
            one = alone(scene, result, "mixed")
            assert all(np.array_equal(one[name], result[name], equal_nan=True) for name in one.history)
        else:
            with pytest.raises(mca.GuardError) as stop:
                alone(scene, result, "mixed")
            assert result.stopped == str(stop.value)
            assert len(result.time) < 151
            assert result.summary["simulated_time"] == (result.time[-1] if len(result.time) else 0.0)
    assert results[1].stopped.startswith("energy imbalance")
    assert len(results[1].time) >= 1
    assert "sank deeper than half a face" in results[0].stopped
    assert [folder.name for folder in (tmp_path / "sweep").iterdir()] == ["2"]


def test_the_batch_ends_when_no_scene_is_left():
    impact = begun(*(hinged(energy_tolerance=tolerance, duration=1e-2) for tolerance in (1e-9, 1e-10)))
    impact.advance()
    assert all(impact.stopped)
    assert impact.state.steps < 0.01 * impact.steps.count


def test_every_scene_has_its_folder(tmp_path):
    scenes = [hinged(mu=mu, duration=1e-5) for mu in (0.1, 0.3)]
    results = mca.run_batch(scenes, out=tmp_path / "sweep")
    for name, result in zip(("0", "1"), results, strict=True):
        assert result.path == tmp_path / "sweep" / name
        assert {file.name for file in result.path.iterdir()} == set(ALL_FILES) - set(PROBE_FILES)
        read = mca.load(result.path)
        assert np.array_equal(read.F_t, result.F_t)
        assert np.array_equal(read.paths[0].stress, result.paths[0].stress)
    with pytest.raises(mca.RequestError, match="holds results already"):
        mca.run_batch(scenes, out=tmp_path / "sweep")
    mca.run_batch(scenes, out=tmp_path / "sweep", force=True)


def test_scenes_share_the_meshes_of_equal_recipes(monkeypatch):
    built, build = [], mca.Box.build
    monkeypatch.setattr(mca.Box, "build", lambda self: built.append(self) or build(self))
    mca.run_batch([hinged(mu=mu, duration=1e-6) for mu in (0.1, 0.2, 0.3)], refine=1.25)  # no other run has these
    assert len(built) == 2


def test_finished_meshes_are_taken():
    scene = hinged(duration=2e-6)
    meshes = mca.mesh(hinged(cells=2))
    results = mca.run_batch([scene, scene], meshes=[meshes, mca.mesh(scene)])
    assert results[0].summary["n_elements"] < results[1].summary["n_elements"]
    with pytest.raises(mca.RequestError, match="number of meshes = 1"):
        mca.run_batch([scene, scene], meshes=[meshes])


@pytest.mark.parametrize(
    ("scenes", "message"),
    [
        ([], r"scenes = \[\]: give at least one"),
        ([hinged(), hinged(duration=3e-5)], r"scenes\[1\].impact.duration = 3e-05: .*scenes\[0\] has 4e-05"),
        ([hinged(), hinged(), hinged(output_interval=2e-6)], r"scenes\[2\].impact.output_interval = 2e-06"),
        ([hinged(), replace(hinged(), contacts=())], r"scenes\[1\].contacts = 0: scenes\[0\] has 1"),
        ([hinged(), driven(1.0, 0.3, (0, 1, 0))], r"contacts\[0\].master = 'RigidPlane': .*Surface"),
        (
            [hinged(), replace(hinged(), contacts=(replace(hinged().contacts[0], two_way=False),))],
            r"scenes\[1\].contacts\[0\].two_way = False",
        ),
        ([hinged(), replace(hinged(), fixed=(mca.Fixed(body="low", nodes="top"),))], r"scenes\[1\]: .*top"),
    ],
)
def test_what_scenes_must_share_is_named(scenes, message, tmp_path):
    with pytest.raises(mca.RequestError, match=message) as refused:
        mca.run_batch(scenes, out=tmp_path / "out")
    assert refused.value.exit_status == 2
    assert not (tmp_path / "out").exists()


def test_durations_that_differ_by_rounding_are_one():
    """Many scenes compute theirs from what a sweep changes: 1.2 v / (mu g) is 0.012 s or 0.011999999999999999 s."""
    scenes = [mca.make_scene("sliding_block", mu=mu, v=3.0 * mu) for mu in (0.1, 0.3)]
    assert len({scene.impact.duration for scene in scenes}) == 2
    assert check_alike(scenes) == scenes[0].impact.duration


def test_one_duration_for_all():
    results = mca.run_batch([hinged(), hinged(duration=3e-5)], duration=2e-6)
    assert [len(result.time) for result in results] == [3, 3]


@pytest.mark.parametrize(
    ("scenes", "settings", "message"),
    [
        (hinged(), {}, r"scenes = 'Scene': give a list of scenes"),
        ("two_link", {}, r"scenes = 'two_link': give a list of scenes"),
        (["two_link"], {}, r"scenes\[0\] = 'two_link': give a warp_mca.Scene"),
        ([hinged()], {"duration": "x"}, r"duration = 'x': give a finite time"),
        ([hinged()], {"meshes": {"low": None}}, r"meshes = 'dict': give a list"),
        ([hinged()], {"out": 5}, r"out = 5: name a folder"),
    ],
)
def test_another_kind_of_argument_is_refused_by_name(scenes, settings, message):
    with pytest.raises(mca.RequestError, match=message):
        mca.run_batch(scenes, **settings)


def test_scenes_may_come_one_by_one():
    assert len(mca.run_batch(hinged(mu=mu) for mu in (0.1, 0.2, 0.3))) == 3


def test_force_leaves_no_files_of_an_earlier_batch(tmp_path):
    plain = replace(hinged(cells=2, duration=2e-6), paths=())  # without a figure of them
    sound, stopped = plain, replace(plain, impact=replace(plain.impact, energy_tolerance=1e-12))
    mca.run_batch([sound] * 11, out=tmp_path)
    for name in ("2024", "notes"):  # no results; not numbered
        (tmp_path / name).mkdir()
    (tmp_path / "2024" / "forces.png").touch()
    (tmp_path / "notes" / "summary.json").touch()
    (tmp_path / "10" / "mine.txt").touch()
    mca.run_batch([sound, sound], out=tmp_path, force=True)
    assert {path.name for path in tmp_path.iterdir()} == {"0", "1", "10", "2024", "notes"}
    assert [path.name for path in (tmp_path / "10").iterdir()] == ["mine.txt"]
    results = mca.run_batch([sound, stopped], out=tmp_path, force=True)
    assert results[1].stopped
    assert {path.name for path in tmp_path.iterdir()} == {"0", "10", "2024", "notes"}
    assert [path.name for path in (tmp_path / "notes").iterdir()] == ["summary.json"]
    assert [path.name for path in (tmp_path / "2024").iterdir()] == ["forces.png"]


def test_scenes_whose_masters_have_several_sides_give_the_bits_that_they_give_alone():
    """Faces of the second scene's slave were looked for among the nodes of the first."""
    scenes = [in_frame("L", ("every",), velocity) for velocity in ((-2.0, -3.0, 0.5), (-3.0, -2.5, 0.0))]
    scenes = [replace(scene, impact=replace(scene.impact, duration=1e-4)) for scene in scenes]
    for scene, together in zip(scenes, mca.run_batch(scenes), strict=True):
        alone = mca.run(scene)
        assert all(np.array_equal(together[name], alone[name], equal_nan=True) for name in alone.history)
        assert alone.F_n.max() > 0.0
