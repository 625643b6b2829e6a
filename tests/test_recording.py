"""Recorders in real runs: what a frame holds, when it is taken, and that a run is the same with and without them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from impacts import Displaced
from rrd import rows

import warp_mca as mca
from warp_mca.base.errors import GuardError, RequestError
from warp_mca.model.build import build_model
from warp_mca.model.paths import locate
from warp_mca.recorders import AnimationFile, Cadence, FinalState, RerunStream, SnapshotFile, UsdFile, VtkHdfFile
from warp_mca.recorders.checks import check_files
from warp_mca.recorders.frames import Recording, skins
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME, Frame
from warp_mca.step.output import Output
from warp_mca.step.solver import Solver

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)


def bar(material=STEEL, velocity=(2.0, 0.0, 0.0), wall=0.1, divisions=(20, 2, 2), **more) -> mca.Scene:
    """A bar of 0.1 m along x that runs into a rough wall at x = `wall`."""
    contact = mca.Contact(
        slave=mca.Surface(body="bar", nodes="xmax"),
        master=mca.RigidPlane(point=(wall, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
        mu=0.3,
    )
    axis = mca.Line(body="bar", start=(0.1, 0.005, 0.005), end=(0.0, 0.005, 0.005))
    edge = mca.Line(body="bar", start=(0.1, 0.0, 0.0), end=(0.0, 0.0, 0.0))
    return mca.Scene(
        name="bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=mca.Box(size=(0.1, 0.01, 0.01), divisions=divisions),
                material=material,
                velocity=velocity,
            ),
        ),
        contacts=(contact,),
        paths=(
            mca.Path(name="axis", lines=(axis,), spacing=0.004),
            mca.Path(name="edge", lines=(edge,), spacing=0.01),
        ),
        **{"impact": mca.ImpactPhase(duration=4e-5, output_interval=1e-6)} | more,
    )


class Memory:
    """Keeps copies of what it is given."""

    name = "memory"

    def __init__(self, *needs: str, cadence: Cadence | None = None) -> None:
        self.needs, self.cadence = frozenset(needs), cadence or Cadence(frames=5)
        self.frames: list[Frame] = []
        self.rows: list[dict] = []
        self.ended: bool | None = None

    def start(self, info) -> None:
        self.info = info

    def frame(self, frame: Frame) -> None:
        import copy

        self.frames.append(copy.deepcopy(frame))

    def history(self, rows) -> None:
        self.rows.append(dict(rows))

    def finish(self, ok: bool) -> None:
        assert self.ended is None
        self.ended = ok


class Failing(Memory):
    """Fails at its third frame."""

    name = "failing"

    def frame(self, frame: Frame) -> None:
        super().frame(frame)
        if frame.index == 2:
            raise OSError("no space left")


@pytest.fixture(scope="module")
def plain() -> mca.Result:
    return mca.run(bar())


def same(one: mca.Result, other: mca.Result) -> bool:
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.history)


def test_frames_hold_only_what_was_asked_for():
    surface, volume = Memory(SURFACE), Memory(VOLUME, CONTACT)
    mca.run(bar(), recorders=[surface, volume])
    assert len(surface.frames) == len(volume.frames) == 5
    assert surface.frames[0].volume is None
    assert not volume.frames[0].points
    assert surface.frames[-1].points["bar"].dtype == np.float32
    assert not len(surface.frames[-1].contact_points)


def test_recorders_change_no_number_and_see_all_of_the_history(plain: mca.Result):
    one, other = Memory(SURFACE, CONTACT, PATHS, VOLUME), Memory(SURFACE, cadence=Cadence(seconds=7e-6))
    result = mca.run(bar(), recorders=[one, other])
    assert same(plain, result)
    assert np.array_equal(plain.paths[0].stress, result.paths[0].stress)
    for name, column in result.history.items():
        np.testing.assert_array_equal(np.concatenate([rows[name] for rows in one.rows]), column)
    np.testing.assert_allclose([frame.time for frame in other.frames], [0, 7e-6, 14e-6, 21e-6, 28e-6, 35e-6, 40e-6])
    assert one.ended is True


def test_a_frame_is_the_state_at_its_time(plain: mca.Result):
    """The surface is the model moved by the volume's displacement; contact and path stress are those of the results."""
    memory = Memory(SURFACE, CONTACT, PATHS, VOLUME)
    result = mca.run(bar(), recorders=[memory])
    model, nodes = memory.info.model, memory.info.surfaces["bar"].nodes
    for frame in memory.frames:
        row = round(frame.time / 1e-6)
        assert frame.step * memory.info.dt == pytest.approx(frame.time, rel=1e-12)
        volume = frame.volume
        assert volume is not None
        moved = (model.X + volume.displacement)[nodes]
        np.testing.assert_allclose(frame.points["bar"], moved, atol=1e-8)
        np.testing.assert_array_equal(frame.von_mises["bar"], volume.von_mises[nodes])
        np.testing.assert_array_equal(frame.path_stress["axis"], result.paths[0].von_mises[row])
        kinetic = 0.5 * (model.mass * (volume.velocity.astype(float) ** 2).sum(axis=1)).sum()
        # the ledger has v(n-1/2) . v(n+1/2), which differs for what rings from step to step
        assert kinetic == pytest.approx(result["E_kinetic"][row], abs=5e-3 * result["E_kinetic"][0])
    pressing = memory.frames[2]
    assert result.F_n[19:22].min() > 0.0
    assert len(pressing.contact_points) == 9
    np.testing.assert_allclose(pressing.contact_points[:, 0], 0.1, atol=1e-5)
    assert not len(memory.frames[0].contact_points)


def test_the_wave_behind_the_front_carries_the_stress_of_bar_theory():
    """sigma = rho c v between the wall and the front, up to the transverse inertia that makes it ring."""
    result = mca.run(bar(wall=0.1, divisions=(40, 4, 4)), duration=1.6e-5)
    axis = result.paths[0]
    c = STEEL.wave_speeds["bar"]
    behind = axis.position < 0.6 * c * result.time[-1]  # as much as 0.3 and 0.4 differ, +-0.9 %, is ringing
    along = axis.stress[-1, behind, 0].mean()
    assert along == pytest.approx(-STEEL.rho * c * 2.0, rel=5e-3)
    assert np.abs(axis.stress[-1, axis.position > 1.2 * c * result.time[-1]]).max() < 0.01 * abs(along)


def test_free_flight_moves_the_skin_exactly(tmp_path):
    file = tmp_path / "flight.rrd"
    memory = Memory(SURFACE)
    mca.run(bar(velocity=(2.0, 1.0, -0.5), wall=1.0), recorders=[memory, RerunStream(file, cadence=Cadence(frames=5))])
    model, nodes = memory.info.model, memory.info.surfaces["bar"].nodes
    last = (model.X + 4e-5 * model.V)[nodes]
    np.testing.assert_allclose(memory.frames[-1].points["bar"], last, atol=1e-8)
    positions = sorted((step, value) for _, step, value in rows(file, "/world/bar", "Mesh3D:vertex_positions"))
    assert len(positions) == 5
    np.testing.assert_array_equal(positions[-1][1], memory.frames[-1].points["bar"])


def test_a_recording_of_a_run_holds_topology_frames_forces_and_paths(tmp_path):
    file = tmp_path / "bar.rrd"
    result = mca.run(bar(), recorders=[RerunStream(file, cadence=Cadence(frames=9))])
    ((static, _, _),) = rows(file, "/world/bar", "Mesh3D:triangle_indices")
    assert static
    assert len(list(rows(file, "/world/bar", "Mesh3D:vertex_positions"))) == 9
    force = sorted((step, value[0]) for _, step, value in rows(file, "/plots/force/F_n_N", "Scalars:scalars"))
    assert [value for _, value in force] == result.F_n.tolist()
    curves = sorted((step, value) for _, step, value in rows(file, "/paths/axis", "BarChart:values"))
    np.testing.assert_allclose(curves[-1][1][0]["buffer"], 1e-6 * result.paths[0].von_mises[-1], rtol=1e-6)


def test_a_recorder_that_fails_is_a_warning_and_the_run_goes_on(plain: mca.Result):
    failing, memory = Failing(SURFACE), Memory(VOLUME)
    result = mca.run(bar(), recorders=[failing, memory])
    assert same(plain, result)
    assert len(failing.frames) == 3
    assert failing.ended is False
    assert len(memory.frames) == 5
    assert memory.ended is True
    assert "failing: recording stopped after 2 frames: no space left" in result.warnings


def test_a_recorder_that_cannot_start_stops_the_run_before_it_begins(tmp_path):
    class Unwilling(Memory):
        def start(self, info) -> None:
            raise RequestError("no room")

    first = Memory(SURFACE)
    with pytest.raises(RequestError, match="no room"):
        mca.run(bar(), recorders=[first, Unwilling(SURFACE)], out=tmp_path / "out")
    assert first.ended is False
    assert not list(tmp_path.iterdir())


def test_what_other_recorders_made_is_removed_when_one_cannot_start(tmp_path):
    class Unwilling(Memory):
        def start(self, info) -> None:
            raise RequestError("no room")

    (tmp_path / "old.vtkhdf").write_text("older")
    files = RerunStream(tmp_path / "new" / "a.rrd"), UsdFile(tmp_path / "a.usdc"), VtkHdfFile(tmp_path / "old.vtkhdf")
    with pytest.raises(RequestError, match="no room"):
        mca.run(bar(), recorders=[*files, Unwilling(SURFACE)])
    assert [path.name for path in tmp_path.iterdir()] == ["old.vtkhdf"]
    assert (tmp_path / "old.vtkhdf").read_text() == "older"


def test_a_recording_knows_which_recorders_failed(bars):
    class Unable(Memory):
        name = "unable"

        def finish(self, ok: bool) -> None:
            raise OSError("no space left")

    silent, good = Memory(SURFACE), Memory(SURFACE)
    silent.name, silent.failed = "silent", True
    recording = Recording([Unable(SURFACE), silent, good], bars.info, 10, 1, None)
    recording.finish(True)
    assert recording.failed == ["unable", "silent"]


@pytest.mark.parametrize("kind", [UsdFile, RerunStream, FinalState, VtkHdfFile])
def test_a_file_that_cannot_be_made_is_refused_before_any_recorder_starts(kind):
    suffix = {UsdFile: "usdc", RerunStream: "rrd", FinalState: "vtu", VtkHdfFile: "vtkhdf"}[kind]
    if not Path("/proc").is_dir():
        pytest.skip("no folder here that takes no file even of root")
    with pytest.raises(RequestError, match="/proc cannot be written to"):
        kind(f"/proc/a.{suffix}")


@pytest.mark.parametrize("kind", [UsdFile, RerunStream, FinalState])
def test_two_recorders_of_one_file_are_refused(tmp_path, kind):
    """The second file of USD replaced the stage of the first, which broke off with a warning."""
    suffix = {UsdFile: "usdc", RerunStream: "rrd", FinalState: "vtu"}[kind]
    recorders = [kind(tmp_path / f"a.{suffix}"), kind(tmp_path / "." / f"a.{suffix}")]
    with pytest.raises(RequestError, match="two outputs write this file"):
        mca.run(bar(), recorders=recorders)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("names", "out", "words"),
    [
        (["a.usdc"], "a.usdc", "cannot be there beside .*a.usdc/summary.json"),
        (["a.rrd"], "a.rrd/o", "cannot be there beside"),
        (["a.usdc", "a.usdc/b.rrd"], None, "cannot be there beside"),
        (["a.usdc/b.rrd", "a.usdc"], None, "cannot be there beside"),
        (["a.xdmf", "a.xmf"], None, "two outputs write this file"),  # both take a.h5
        (["a.xdmf"], "a.h5", "cannot be there beside"),
        (["o/forces.png"], "o", "two outputs write this file"),
    ],
)
def test_outputs_that_cross_are_refused(tmp_path, monkeypatch, names: list[str], out: str | None, words: str):
    monkeypatch.chdir(tmp_path)
    kinds = {".usdc": UsdFile, ".rrd": RerunStream, ".png": partial(SnapshotFile, time=0.0)}
    recorders = [kinds.get(Path(name).suffix, FinalState)(name) for name in names]
    with pytest.raises(RequestError, match=f"^recorders = '.*': .*{words}[^\n]*$"):
        check_files(recorders, out)


def test_outputs_replace_links_and_leave_what_these_point_to(tmp_path):
    """rerun, USD and pictures wrote through them, to wherever that was."""
    kinds: dict[str, Callable] = {
        "a.rrd": RerunStream,
        "a.usdc": UsdFile,
        "a.vtkhdf": VtkHdfFile,
        "a.vtu": FinalState,
        "a.gif": lambda file: AnimationFile(file, cadence=Cadence(frames=2)),
        "a.png": lambda file: SnapshotFile(file, time=0.0),
    }
    (tmp_path / "else").mkdir()
    for name in kinds:
        (tmp_path / name).symlink_to(tmp_path / "else" / name)
        if name != "a.rrd":  # of that it points to nothing
            (tmp_path / "else" / name).write_text("kept")
    mca.run(bar(), recorders=[make(tmp_path / name) for name, make in kinds.items()], duration=4e-6)
    for name in kinds:
        assert not (tmp_path / name).is_symlink() and (tmp_path / name).stat().st_size > 100
    assert {file.name: file.read_text() for file in (tmp_path / "else").iterdir()} == dict.fromkeys(
        [name for name in kinds if name != "a.rrd"], "kept"
    )


def test_outputs_side_by_side_are_fine(tmp_path):
    files = UsdFile(tmp_path / "o" / "a.usdc"), FinalState(tmp_path / "o" / "a.xdmf"), RerunStream(viewer=True)
    check_files(files, tmp_path / "o")


def test_a_snapshot_after_the_end_is_refused(tmp_path):
    """It showed the last state, in a file named after the time that was asked for, and other files were replaced."""
    names = "a.rrd", "a.usdc"
    for name in names:
        (tmp_path / name).write_text("older")
    files = RerunStream(tmp_path / "a.rrd"), UsdFile(tmp_path / "a.usdc")
    with pytest.raises(RequestError, match=r"^time of .*a\.png = 0\.0001: the run ends at 4e-05 s"):
        mca.run(bar(), recorders=[*files, SnapshotFile(tmp_path / "a.png", time=1e-4)])
    assert [(tmp_path / name).read_text() for name in names] == ["older"] * 2
    mca.run(bar(), recorders=[SnapshotFile(tmp_path / "a.png", time=4e-5)])
    assert (tmp_path / "a.png").is_file()


@pytest.mark.parametrize("kind", [UsdFile, RerunStream, VtkHdfFile, None])
def test_a_cadence_beyond_the_end_is_refused(tmp_path, kind):
    """The last state was taken instead, and nobody was told."""
    suffix = {UsdFile: "usdc", RerunStream: "rrd", VtkHdfFile: "vtkhdf"}
    cadence = Cadence(times=(1e-5, 1.0))
    recorder = kind(tmp_path / "new" / f"a.{suffix[kind]}", cadence=cadence) if kind else Memory(cadence=cadence)
    with pytest.raises(RequestError, match=r"^time of .* = 1\.0: the run ends at 4e-05 s; give times until then$"):
        mca.run(bar(), recorders=[recorder], out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_breaks_a_guard_leaves_all_frames_until_then(tmp_path):
    """The USD file lacked those since it was saved last."""
    import h5py
    from pxr import Usd

    usd, vtkhdf, cadence = tmp_path / "a.usda", tmp_path / "a.vtkhdf", Cadence(seconds=1e-6)
    impact = mca.ImpactPhase(duration=1e-3, output_interval=1e-6, energy_tolerance=1e-4)
    scene = bar(impact=impact)
    scene = dataclasses.replace(scene, contacts=(dataclasses.replace(scene.contacts[0], penalty=1.0),))
    with pytest.raises(GuardError):
        mca.run(scene, recorders=[UsdFile(usd, cadence=cadence), VtkHdfFile(vtkhdf, cadence=cadence)])
    with h5py.File(vtkhdf) as file:
        count = int(file["VTKHDF/Steps"].attrs["NSteps"])
    assert count % 5
    assert Usd.Stage.Open(str(usd)).GetEndTimeCode() == count - 1.0


def test_a_run_that_breaks_a_guard_closes_its_recorders():
    memory = Memory(SURFACE)
    with pytest.raises(GuardError):
        impact = mca.ImpactPhase(duration=1e-4, output_interval=1e-6, energy_tolerance=1e-9)
        mca.run(bar(impact=impact), recorders=[memory])
    assert memory.ended is False


def test_a_snapshot_is_drawn_at_its_time(tmp_path):
    mca.run(bar(), recorders=[SnapshotFile(tmp_path / "new" / "a.png", time=2e-5)])
    assert (tmp_path / "new" / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("cadence", "expected"),
    [
        (Cadence(frames=2), [0, 10]),
        (Cadence(frames=4), [0, 3, 7, 10]),
        (Cadence(frames=99), list(range(11))),
        (Cadence(seconds=4e-6), [0, 4, 8, 10]),
        (Cadence(seconds=1e-9), list(range(11))),
        (Cadence(seconds=1.0), [0, 10]),
        (Cadence(times=(3.2e-6, 99.0)), [3, 10]),
    ],
)
def test_frames_fall_on_the_ends_of_output_intervals(cadence: Cadence, expected: list[int]):
    assert np.flatnonzero(cadence.rows(10, 1e-6)).tolist() == expected


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, r"Cadence = \(None, None, None\)"),
        ({"frames": 3, "seconds": 1.0}, r"Cadence = \(3, 1.0, None\)"),
        ({"frames": 1}, "frames = 1"),
        ({"frames": 2.5}, "frames = 2.5"),
        ({"frames": "3"}, "frames = '3'"),
        ({"frames": True}, "frames = True"),
        ({"seconds": 0.0}, "seconds = 0.0"),
        ({"seconds": "1"}, "seconds = '1'"),
        ({"seconds": np.ones(2)}, "seconds = 'ndarray'"),
        ({"times": (-1.0,)}, r"times = \(-1.0,\)"),
        ({"times": ()}, r"times = \(\)"),
        ({"times": ("a",)}, r"times = \('a',\)"),
        ({"times": 5}, "times = 5"),
        ({"times": np.ones((2, 2))}, "times = 'ndarray'"),
    ],
)
def test_bad_cadences_are_refused_in_one_sentence(given: dict, words: str):
    with pytest.raises(RequestError, match=f"^{words}: give [^\n]*$"):
        Cadence(**given)


def test_times_may_be_an_array():
    assert Cadence(times=np.array([1e-6, 3e-6])) == Cadence(times=(1e-6, 3e-6))  # type: ignore[arg-type]


def held_with_output(material, precision: str = "float64") -> tuple[Displaced, Output]:
    """A bar with an uneven mesh, and its output stage."""
    scene = bar(material)
    mesh = mca.mesh(scene)["bar"]
    rng = np.random.default_rng(4)
    inner = np.setdiff1d(np.arange(len(mesh.points)), np.unique(mesh.boundary[0]))
    mesh.points[inner] += rng.uniform(-1e-3, 1e-3, (len(inner), 3))
    meshes = {"bar": mesh}
    model = build_model(scene, meshes, {"bar": mesh.points}, {"bar": np.zeros_like(mesh.points)})
    solver = Solver(model, device="cpu", precision=precision, dt=1e-9)
    probes = locate(scene, model, meshes)
    np.testing.assert_allclose(
        np.einsum("pa,pai->pi", probes.weight, model.X[probes.corner])[:26],
        np.linspace((0.1, 0.005, 0.005), (0.0, 0.005, 0.005), 26),
        atol=1e-12,
    )
    solver.output = Output(solver, skins(model, meshes), probes, frozenset((SURFACE, VOLUME)))
    return Displaced(solver), solver.output


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_a_uniform_strain_gives_a_uniform_stress_that_turns_with_the_body(precision: str):
    from scipy.spatial.transform import Rotation

    held, output = held_with_output(STEEL, precision)
    strain = 1e-3 * np.array([[2.0, 0.3, 0.1], [0.3, -1.0, 0.4], [0.1, 0.4, 0.5]])
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    X = held.solver.model.X
    held.state.u.assign(X @ (turn @ (np.eye(3) + strain)).T - X)
    output.before_step(held.state, frozenset((SURFACE, VOLUME)))
    output.nodal_stress(frozenset((SURFACE, VOLUME)))
    K, G = STEEL.bulk_modulus, STEEL.shear_modulus
    deviator = strain - np.trace(strain) / 3.0 * np.eye(3)
    sigma = turn @ (2.0 * G * deviator + K * np.trace(strain) * np.eye(3)) @ turn.T
    expected = sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    tolerance = 1e-4 * np.abs(sigma).max()  # strain squared, and float32
    np.testing.assert_allclose(output.arrays[VOLUME]["stress"].numpy(), np.tile(expected, (len(X), 1)), atol=tolerance)
    path_stress = output.path_stress.numpy()[held.solver.work.row.numpy()[0]]
    np.testing.assert_allclose(path_stress, np.tile(expected, (37, 1)), atol=tolerance)
    von_mises = 2.0 * G * np.sqrt(1.5 * (deviator**2).sum())
    np.testing.assert_allclose(output.arrays[SURFACE]["von_mises"].numpy(), von_mises, rtol=1e-4)


def test_plastic_strain_at_nodes():
    """Uniaxial strain beyond yield: p = (2 G e_eq' - sigma_y) / (3 G + H) from the radial return by hand."""
    metal = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=200e6, E_t=10e9)
    held, output = held_with_output(metal)
    X = held.solver.model.X
    held.forces(X * [5e-3, 0.0, 0.0])
    output.before_step(held.state, frozenset((SURFACE, VOLUME)))
    output.nodal_stress(frozenset((SURFACE, VOLUME)))
    G, H = metal.shear_modulus, metal.hardening_modulus
    p = (2.0 * G * 5e-3 - 200e6) / (3.0 * G + H)
    np.testing.assert_allclose(output.arrays[SURFACE]["plastic_strain"].numpy(), p, rtol=1e-4)
    np.testing.assert_allclose(output.arrays[VOLUME]["von_mises"].numpy(), 2.0 * G * 5e-3 - 3.0 * G * p, rtol=1e-4)


def test_a_scene_without_paths_pays_nothing_for_them(monkeypatch: pytest.MonkeyPatch):

    from warp_mca.step import output

    monkeypatch.setattr(output.Output, "__init__", None)
    mca.run(dataclasses.replace(bar(), paths=()), duration=2e-6)


def test_a_path_that_leaves_its_body_is_refused():
    line = mca.Line(body="bar", start=(0.0, 0.005, 0.005), end=(0.2, 0.005, 0.005))
    scene = mca.Scene(
        name="bar", bodies=bar().bodies, impact=bar().impact, paths=(mca.Path(name="P", lines=(line,), spacing=0.01),)
    )
    with pytest.raises(RequestError, match=r"Path P\.lines.*outside the body"):
        mca.run(scene)


def test_results_with_paths_are_saved_and_loaded(tmp_path, plain: mca.Result):
    from warp_mca.results.storage import save

    save(plain, tmp_path / "run")
    again = mca.load(tmp_path / "run")
    assert [path.name for path in again.paths] == ["axis", "edge"]
    np.testing.assert_array_equal(again.paths[1].stress, plain.paths[1].stress)
    np.testing.assert_array_equal(again.paths[1].position, plain.paths[1].position)
    with np.load(tmp_path / "run" / "paths.npz") as arrays:
        np.testing.assert_array_equal(arrays["time_s"], plain.time)
        np.testing.assert_array_equal(arrays["axis/von_mises_Pa"], plain.paths[0].von_mises)
