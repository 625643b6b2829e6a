"""Tests the USD recorder by reading its files back with USD's own validators and a stage of their own."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from flying_bars import DT, STEPS, FlyingBars
from test_full_disk import files_up_to

from warp_mca.base.errors import RequestError
from warp_mca.recorders import UsdFile, usd_file, usd_prims
from warp_mca.recorders.colours import PALETTE
from warp_mca.recorders.recorder import SurfaceMesh

FRAMES = 9


def record(file: Path, bars: FlyingBars, frames: int = FRAMES, **options: object) -> None:
    """A whole recording."""
    recorder = UsdFile(file, **options)
    recorder.start(bars.info)
    for index in range(frames):
        recorder.frame(bars.frame(index))
    recorder.finish(True)


def opened(file: Path):
    """The stage as another program sees it."""
    from pxr import Sdf, Usd

    return Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(file)))


@pytest.fixture
def stage(bars: FlyingBars, tmp_path: Path):
    record(tmp_path / "bars.usdc", bars)
    return opened(tmp_path / "bars.usdc")


def mesh(stage, name: str):
    from pxr import UsdGeom

    return UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}"))


@pytest.mark.parametrize("suffix", [".usdc", ".usda"])
def test_usd_s_own_validators_find_nothing(bars: FlyingBars, tmp_path: Path, suffix: str):
    from pxr import UsdValidation

    file = tmp_path / f"bars{suffix}"
    record(file, bars)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    stage = opened(file)
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not [error.GetErrorAsString() for error in errors]


def test_topology_is_valid_and_written_once(stage, bars: FlyingBars):
    from pxr import UsdGeom

    for name, body in (("upper_bar", "upper bar"), ("lower", "lower")):
        prim = mesh(stage, name)
        counts, indices = prim.GetFaceVertexCountsAttr(), prim.GetFaceVertexIndicesAttr()
        points = prim.GetPointsAttr().Get(0)
        valid, reason = UsdGeom.Mesh.ValidateTopology(indices.Get(), counts.Get(), len(points))
        assert valid, reason
        assert counts.GetNumTimeSamples() == indices.GetNumTimeSamples() == 0
        np.testing.assert_array_equal(np.reshape(indices.Get(), (-1, 4)), bars.info.surfaces[body].quads)
        assert prim.GetPrim().GetDisplayName() == body


def test_every_frame_has_its_own_time_code_and_the_model_s_positions(stage, bars: FlyingBars):
    for name, body in (("upper_bar", "upper bar"), ("lower", "lower")):
        attribute = mesh(stage, name).GetPointsAttr()
        assert attribute.GetTimeSamples() == list(range(FRAMES))
        for code in range(FRAMES):
            expected = bars.positions(STEPS * code)[bars.info.surfaces[body].nodes].astype(np.float32)
            np.testing.assert_array_equal(np.array(attribute.Get(code)), expected)
            low, high = np.array(mesh(stage, name).GetExtentAttr().Get(code))
            np.testing.assert_array_equal([low, high], [expected.min(axis=0), expected.max(axis=0)])


def test_the_layer_says_units_axes_and_physical_times(stage):
    from pxr import UsdGeom

    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetDefaultPrim().GetPath() == "/World"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, FRAMES - 1.0)
    facts = stage.GetRootLayer().customLayerData["warp_mca"]
    np.testing.assert_allclose(facts["times_s"], np.arange(FRAMES) * STEPS * DT, rtol=1e-15)
    assert facts["time_step_s"] == DT
    np.testing.assert_allclose(facts["colour_limits_Pa"], 1e6 * np.arange(FRAMES))


def test_gravity_along_z_turns_the_stage(bars: FlyingBars, tmp_path: Path):
    from pxr import UsdGeom

    scene = dataclasses.replace(bars.info.scene, gravity=(0.0, 0.0, -9.8))
    bars.info = dataclasses.replace(bars.info, scene=scene)
    record(tmp_path / "z.usdc", bars, 1)
    assert UsdGeom.GetStageUpAxis(opened(tmp_path / "z.usdc")) == "Z"


def test_stress_colours_and_plastic_strain(stage):
    from pxr import UsdGeom

    prim = mesh(stage, "lower")
    colour = prim.GetDisplayColorPrimvar()
    count = len(prim.GetPointsAttr().Get(0))
    palette = np.array(colour.Get())
    # sRGB again: what a viewer shows is the palette
    shown = np.where(palette <= 0.0031308, 12.92 * palette, 1.055 * palette ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(255.0 * shown, PALETTE, atol=0.01)
    assert colour.GetInterpolation() == "vertex"
    assert colour.GetIndicesAttr().GetTimeSamples() == list(range(FRAMES))
    assert np.array(colour.GetIndices(3)).tolist() == [255] * count
    primvars = UsdGeom.PrimvarsAPI(prim)
    for name, slope in (("vonMises", 1e6), ("plasticStrain", 1e-3)):
        primvar = primvars.GetPrimvar(name)
        assert primvar.GetInterpolation() == "vertex"
        for code in range(FRAMES):
            np.testing.assert_allclose(np.array(primvar.Get(code)), np.full(count, slope * code), rtol=1e-6)


def test_values_keep_their_size_to_four_thousandths(bars: FlyingBars, tmp_path: Path):
    from pxr import UsdGeom

    rng = np.random.default_rng(5)
    frame = bars.frame(1)
    stress = {body: (1e8 * rng.random(len(x)) ** 2).astype(np.float32) for body, x in frame.points.items()}
    recorder = UsdFile(tmp_path / "a.usdc", limit=2e7)  # colours end at 20 MPa, values do not
    recorder.start(bars.info)
    recorder.frame(dataclasses.replace(frame, von_mises=stress))
    recorder.finish(True)
    stage = opened(tmp_path / "a.usdc")
    found = np.array(UsdGeom.PrimvarsAPI(mesh(stage, "lower")).GetPrimvar("vonMises").Get(0))
    assert np.abs(found - stress["lower"]).max() < 0.004 * stress["lower"].max()


def test_plastic_strain_that_does_not_change_is_held(bars: FlyingBars, tmp_path: Path):
    from pxr import UsdGeom

    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    history = [0.0, 0.0, 0.0, 1e-3, 1e-3, 1e-3, 4e-3]
    for index, p in enumerate(history):
        frame = bars.frame(index)
        plastic = {body: np.full(len(x), p, dtype=np.float32) for body, x in frame.points.items()}
        recorder.frame(dataclasses.replace(frame, plastic_strain=plastic))
    recorder.finish(True)
    stage = opened(tmp_path / "a.usdc")
    primvar = UsdGeom.PrimvarsAPI(mesh(stage, "lower")).GetPrimvar("plasticStrain")
    assert len(primvar.GetTimeSamples()) == 5
    np.testing.assert_allclose([primvar.Get(code)[0] for code in range(len(history))], history, rtol=1e-6)


def test_contact_points_stick_or_slip(stage):
    from pxr import UsdGeom

    points = UsdGeom.Points(stage.GetPrimAtPath("/World/contact"))
    colour = points.GetDisplayColorPrimvar()
    assert [len(points.GetPointsAttr().Get(code)) for code in range(4)] == [0, 1, 2, 0]
    assert list(colour.GetIndices(2)) == [1, 0]
    slip, stick = np.array(colour.Get())
    assert stick[1] > slip[1]  # yellow, vermilion


def test_a_frame_of_20000_vertices_takes_at_most_280_kB(
    bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Waves over a grid that moves, too flat to turn its normals; plastic strain grows on a fifth of it."""
    n = 142
    index = np.arange((n - 1) ** 2)
    corner = (index // (n - 1) * n + index % (n - 1)).astype(np.int32)
    quads = np.stack([corner, corner + 1, corner + n + 1, corner + n], axis=1)
    nodes = np.zeros(n * n, dtype=np.int32)
    bars.info = dataclasses.replace(bars.info, surfaces={"grid": SurfaceMesh(nodes, quads)})
    rng = np.random.default_rng(3)
    x, y = np.divmod(np.arange(n * n), n)
    monkeypatch.setattr(usd_file, "SAVE_AFTER", 0.0)
    recorder = UsdFile(tmp_path / "grid.usdc")
    recorder.start(bars.info)
    first = usd_file.WRITE_EVERY  # the first frames hold the normals of all
    for code in range(3 * first):
        if code == first:
            begun = (tmp_path / "grid.usdc").stat().st_size
        height = 0.001 * np.sin(0.1 * x + code) * np.cos(0.07 * y)
        stress = (1e11 * np.abs(height)).astype(np.float32)
        frame = dataclasses.replace(
            bars.frame(code),
            points={"grid": np.stack([x + rng.random(n * n), y, height], axis=1).astype(np.float32)},
            von_mises={"grid": stress},
            plastic_strain={"grid": 1e-10 * stress * (code + 1) * (x < 0.2 * n)},
        )
        recorder.frame(frame)
    recorder.finish(True)
    per_frame = ((tmp_path / "grid.usdc").stat().st_size - begun) / (2 * first)
    assert per_frame * 20_000 / (n * n) < 280e3


def test_a_killed_run_leaves_every_saved_frame(tmp_path: Path):
    """In a process of its own: a copy of one with threads, as USD begins them, may wait for these for ever."""
    file = tmp_path / "killed.usdc"
    run = f"""
        import os, signal
        from flying_bars import FlyingBars
        from warp_mca.recorders import UsdFile, usd_file
        usd_file.SAVE_AFTER = 0.0
        bars, recorder = FlyingBars(), UsdFile({str(file)!r})
        recorder.start(bars.info)
        for index in range(13):
            recorder.frame(bars.frame(index))
        os.kill(os.getpid(), signal.SIGKILL)
    """
    command = [sys.executable, "-c", textwrap.dedent(run)]
    assert subprocess.run(command, cwd=Path(__file__).parent, timeout=120.0).returncode == -signal.SIGKILL
    stage = opened(file)
    assert stage.GetEndTimeCode() == 9.0
    assert mesh(stage, "lower").GetPointsAttr().GetTimeSamples() == list(range(10))


@pytest.mark.parametrize("ok", [True, False])
def test_a_recording_that_ends_early_holds_all_frames(bars: FlyingBars, tmp_path: Path, ok: bool):
    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    for index in range(8):
        recorder.frame(bars.frame(index))
    recorder.finish(ok)
    stage = opened(tmp_path / "a.usdc")
    assert stage.GetEndTimeCode() == 7.0
    assert len(stage.GetRootLayer().customLayerData["warp_mca"]["times_s"]) == 8


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_frames_are_whole_when_their_writing_is_interrupted(
    bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
):
    def interrupted(*values: object) -> np.ndarray:
        os.kill(os.getpid(), number)
        return levels(*values)

    recorder, levels = UsdFile(tmp_path / "a.usdc"), usd_prims.levels
    recorder.start(bars.info)
    last = usd_file.WRITE_EVERY - 1  # with which all are written
    for index in range(last):
        recorder.frame(bars.frame(index))
    monkeypatch.setattr(usd_prims, "levels", interrupted)
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            recorder.frame(bars.frame(last))
    finally:
        signal.signal(number, before)
    recorder.finish(False)
    stage = opened(tmp_path / "a.usdc")
    assert stage.GetEndTimeCode() == last
    for name in ("upper_bar", "lower"):
        assert mesh(stage, name).GetPointsAttr().GetTimeSamples() == list(range(last + 1))
    assert len(np.array(mesh(stage, "contact").GetPrim().GetAttribute("points").Get(1))) == 1


def test_a_second_run_replaces_the_file_of_the_first(bars: FlyingBars, tmp_path: Path):
    from pxr import Usd

    file = tmp_path / "a.usdc"
    record(file, bars)
    watching = Usd.Stage.Open(str(file))  # as a viewer in the same process would
    record(file, FlyingBars(), 3)
    assert opened(file).GetEndTimeCode() == 2.0
    assert watching.GetEndTimeCode() == 2.0


def test_names_become_identifiers_of_their_own(bars: FlyingBars, tmp_path: Path):
    surfaces = dict(zip(("contact", "a b", "a-b", "é"), [*bars.info.surfaces.values()] * 2, strict=True))
    bars.info = dataclasses.replace(bars.info, surfaces=surfaces)
    frame = bars.frame(0)
    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    recorder.frame(frame)
    recorder.finish(True)
    stage = opened(tmp_path / "a.usdc")
    names = [prim.GetName() for prim in stage.GetPrimAtPath("/World").GetChildren()]
    assert sorted(names) == ["__", "a_b", "a_b_", "contact", "contact_", "setting"]


def test_a_recorder_serves_a_second_run(bars: FlyingBars, tmp_path: Path):
    recorder = UsdFile(tmp_path / "a.usdc")
    for count in (3, 2):
        recorder.start(bars.info)
        for index in range(count):
            recorder.frame(bars.frame(index))
        recorder.finish(True)
    stage = opened(tmp_path / "a.usdc")
    assert stage.GetEndTimeCode() == 1.0
    assert mesh(stage, "lower").GetPointsAttr().GetTimeSamples() == [0.0, 1.0]


def test_a_file_that_broke_while_it_was_written_is_removed(
    bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(usd_file, "SAVE_AFTER", 0.0)
    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    with files_up_to(9000), pytest.raises(OSError, match="File too large; the broken file is removed"):
        for index in range(100):
            recorder.frame(bars.frame(index))
    recorder.finish(False)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_waits_until_usd_is_imported(tmp_path: Path):
    """It was lost in there: TypeError: No to_python converter."""
    script = """
        import os, signal, sys
        from flying_bars import FlyingBars
        from warp_mca.recorders import UsdFile

        class Interrupt:
            def find_spec(self, name, *args):
                if name == "pxr.UsdGeom":
                    os.kill(os.getpid(), signal.SIGINT)

        bars = FlyingBars()
        sys.meta_path.insert(0, Interrupt())
        try:
            UsdFile(sys.argv[1]).check(bars.info)
        except KeyboardInterrupt:
            print(hasattr(sys.modules.get("pxr.UsdGeom"), "Mesh"))
    """
    command = [sys.executable, "-c", textwrap.dedent(script), str(tmp_path / "a.usdc")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=Path(__file__).parent)
    assert (done.stdout, done.stderr) == ("True\n", "")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_no_utf_8_is_refused(tmp_path: Path):
    with pytest.raises(RequestError, match=r"^usd = .*caf.udce9\.usdc': USD takes names in UTF-8 only"):
        UsdFile(tmp_path / os.fsdecode(b"caf\xe9.usdc"))


@pytest.mark.parametrize(("name", "remedy"), [("file/a.usdc", "not a folder"), ("a.usdx", "suffix")])
def test_a_file_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path, name: str, remedy: str):
    (tmp_path / "file").write_text("")
    with pytest.raises(RequestError, match=remedy):
        UsdFile(tmp_path / name)


def test_a_full_disk_leaves_the_frames_saved_before(bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(usd_file, "SAVE_AFTER", 0.0)
    recorder = UsdFile(tmp_path / "a.usdc")
    recorder.start(bars.info)
    for index in range(usd_file.WRITE_EVERY):
        recorder.frame(bars.frame(index))
    monkeypatch.setattr(usd_file.shutil, "disk_usage", lambda path: SimpleNamespace(free=1 << 20))
    with pytest.raises(OSError, match="are free on its disk"):
        for index in range(usd_file.WRITE_EVERY, 3 * usd_file.WRITE_EVERY):
            recorder.frame(bars.frame(index))
    recorder.finish(False)
    assert opened(tmp_path / "a.usdc").GetEndTimeCode() == usd_file.WRITE_EVERY - 1.0
