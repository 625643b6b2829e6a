"""Tests the pictures of a run other than its forces: what they show, with which units, and that they are PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_energies import TIME, result

from warp_mca.pictures.snapshot import Look, Skin, plot_snapshot, save_snapshot
from warp_mca.recorders.colours import PALETTE, ColourScale, levels, packed
from warp_mca.results.energy_figure import plot_energies, save_energies
from warp_mca.results.figure_style import engineering
from warp_mca.results.force_figure import plot_forces
from warp_mca.results.path_figures import plot_paths, plot_waves, save_path_curves, save_waves
from warp_mca.results.paths import PathHistory
from warp_mca.results.result import Result
from warp_mca.scene.materials import Elastic

ALUMINIUM = Elastic(E=70e9, nu=0.27, rho=2700.0)


def assert_png(path: Path) -> None:
    """A PNG that is neither empty nor too large for a report."""
    content = path.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert 10_000 < len(content) < 500_000


def pulse(speed: float, name: str = "Path 2") -> PathHistory:
    """Stress of 30 MPa that travels along 0.4 m at `speed` [m/s]."""
    position = np.linspace(0.0, 0.4, 81)
    stress = np.zeros((len(TIME), len(position), 6), dtype=np.float32)
    stress[..., 0] = 30e6 * np.exp(-(((position - speed * TIME[:, None]) / 0.02) ** 2))
    return PathHistory(name, position, stress)


def along(path: PathHistory) -> Result:
    """The result with stress along a path."""
    run = result()
    return Result(run.summary | {"wave_speeds": ALUMINIUM.wave_speeds}, run.history, paths=(path,))


def test_jumps_between_the_lines_of_a_path_are_left_white():
    path = pulse(5092.0)
    keep = (path.position < 0.19) | (path.position > 0.23)
    figure = plot_paths(TIME, [PathHistory(path.name, path.position[keep], path.stress[:, keep])], instants=(20e-6,))
    x, y = figure.axes[0].lines[0].get_data()
    assert np.array_equal(np.isnan(y), (x > 187.0) & (x < 233.0) & ~np.isin(np.round(x, 3), (190.0, 230.0)))


def cube() -> Skin:
    """Unit cube of 1 m with 100 MPa on the face towards +z."""
    points = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    return Skin(points, quads, np.where(points[:, 2] > 0.5, 100e6, 0.0))


def test_energies_are_drawn_in_a_fitting_unit_and_split_into_elastic_and_plastic():
    energies, balance = plot_energies(result()).axes
    assert energies.get_ylabel() == "energy [mJ]"
    assert balance.get_ylabel() == "error [µJ]"
    assert balance.get_xlabel() == "time after first contact [ms]"
    last = {line.get_label(): line.get_ydata()[-1] for line in energies.lines}
    assert last["elastic"] == pytest.approx(1e3 / 3.0)
    assert last["plastic work"] == pytest.approx(1e3 / 3.0)
    assert last["kinetic, change"] == pytest.approx(-1e3, rel=0.01)
    assert energies.get_title(loc="left") == "toy: kinetic energy at first contact 1.998 J"


def test_paths_are_drawn_at_the_chosen_instants():
    paths = [pulse(5092.0, f"Path {k}") for k in (1, 2, 3)]
    figure = plot_paths(TIME, paths, instants=(20e-6, 40e-6))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["Path 1", "Path 2", "Path 3"]
    assert figure.axes[-1].get_xlabel() == "position along the path, from the struck end [mm]"
    assert figure.axes[0].get_ylabel() == "von Mises [MPa]"
    early, late = figure.axes[1].lines
    assert [early.get_label(), late.get_label()] == ["20 µs", "40 µs"]
    assert early.get_xdata()[np.argmax(early.get_ydata())] == pytest.approx(101.8, abs=5.0)
    assert late.get_xdata()[np.argmax(late.get_ydata())] == pytest.approx(203.7, abs=5.0)


def test_wave_speeds_of_aluminium():
    assert list(ALUMINIUM.wave_speeds.values()) == pytest.approx([5092.0, 5692.0, 3195.0], abs=1.0)


def test_lines_of_wave_speeds_have_their_slope():
    speeds = ALUMINIUM.wave_speeds
    diagram = plot_waves(TIME, [pulse(5092.0)], speeds).axes[0]
    assert diagram.get_xlabel() == "time after first contact [µs]"
    assert diagram.get_ylabel() == "position [mm]"
    for line, speed in zip(diagram.lines, speeds.values(), strict=True):
        (t0, t1), (x0, x1) = line.get_xdata(), line.get_ydata()
        assert 1e3 * (x1 - x0) / (t1 - t0) == pytest.approx(speed)


@pytest.mark.parametrize("factor", [1.0, -7e-7, 8888.0])
def test_everything_drawn_is_within_its_figure(factor: float):
    run = result()
    names = ("E_absorbed", *(f"{point}_v{axis}" for point in ("tip", "plate") for axis in "xyz"), "closing_speed")
    ramp = {name: factor * np.linspace(0.5, 1.0, len(TIME)) for name in names}
    history = {name: column if name == "time_s" else factor * column for name, column in run.history.items()} | ramp
    run = Result(run.summary, history)
    paths = [pulse(5092.0, f"Path {k}") for k in (1, 2, 3)]
    waves = plot_waves(TIME, paths, {r"$\sqrt{E/\rho}$": 5092.0, "$c_d$": 5692.0, "$c_s$": 3195.0})
    for figure in (plot_forces(run), plot_energies(run), plot_paths(TIME, paths), waves):
        box, size = figure.get_tightbbox(figure.canvas.get_renderer()), figure.get_size_inches()  # type: ignore[union-attr]
        assert (box.min >= 0.0).all() and (box.max <= size).all()


def test_a_snapshot_shows_the_faces_towards_the_eye_in_their_colours():
    figure = plot_snapshot({"cube": cube()}, 40e-6, Look(limit=100e6))
    picture, bar = figure.axes
    assert bar.get_ylabel() == "von Mises stress [MPa]"
    assert picture.get_title(loc="left") == "40.0 µs after first contact"
    (image,) = picture.images
    shown = np.asarray(image.get_array()).reshape(-1, 3)
    seen = shown[shown.min(axis=1) < 250]
    assert seen.shape[0] > 0.6 * shown.shape[0]
    assert float(np.median(seen[seen[:, 0] > 180].sum(axis=1))) == pytest.approx(
        float(PALETTE[255].sum()), rel=0.25
    )  # less the shade
    faces = np.unique(np.round(seen / 12.0), axis=0, return_counts=True)[1]
    assert (faces > 0.1 * len(seen)).sum() >= 1  # the face towards +z has one colour


def test_panels_of_paths_say_what_they_are_and_have_scales_of_their_own():
    loud, weak = pulse(5092.0, "Path 1"), pulse(5092.0, "Path 2")
    weak = PathHistory("Path 2", weak.position, np.float32(1e-3) * weak.stress)
    headings = {"Path 1": "Path 1: upper surface"}
    for figure in (plot_paths(TIME, [loud, weak], headings=headings), plot_waves(TIME, [loud, weak], {}, headings)):
        panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
        assert [axes.get_title(loc="left") for axes in panels] == ["Path 1: upper surface", "Path 2"]
    units = [axes.get_ylabel() for axes in plot_paths(TIME, [loud, weak]).axes]
    assert units[0] != units[1]  # 1000 times as much


def test_files_are_png_of_sensible_size(tmp_path: Path):
    assert_png(save_energies(tmp_path / "energies.png", result()))
    assert_png(save_snapshot(tmp_path / "snapshot.png", {"cube": cube()}, 0.0))
    assert_png(save_path_curves(tmp_path / "paths.png", along(pulse(5092.0))))
    assert_png(save_waves(tmp_path / "waves.png", along(pulse(5092.0))))


def test_bodies_at_rest_can_be_drawn(tmp_path: Path):
    still = Skin(cube().points, cube().quads, np.zeros(8))
    assert save_snapshot(tmp_path / "still.png", {"cube": still}, 0.0).stat().st_size > 0
    silent = PathHistory("Path 1", np.linspace(0.0, 0.4, 5), np.zeros((len(TIME), 5, 6), dtype=np.float32))
    assert all(save(tmp_path / "silent.png", along(silent)).is_file() for save in (save_path_curves, save_waves))


@pytest.mark.parametrize(
    ("greatest", "expected"), [(2e3, (1e-3, "kN")), (30.0, (1.0, "N")), (2e-3, (1e3, "mN")), (0.0, (1.0, "N"))]
)
def test_units_suit_the_greatest_value(greatest: float, expected: tuple[float, str]):
    assert engineering(greatest, "N") == expected


def test_accelerations_are_in_kilometres_per_second_squared():
    assert engineering(6.4e8, "m/s²") == (1e-3, "km/s²")
    assert engineering(12.0, "m/s²") == (1.0, "m/s²")


def test_the_palette_is_viridis():
    from matplotlib import colormaps

    viridis = 255.0 * colormaps["viridis"](np.arange(256))[:, :3]
    assert PALETTE.dtype == np.uint8
    assert np.abs(PALETTE - viridis).max() <= 2.5


def test_stress_is_coloured_from_zero_to_the_limit():
    stress = np.array([0.0, 25e6, 100e6, 500e6, np.nan], dtype=np.float32)
    assert levels(stress, 100e6).tolist() == [0, 128, 255, 255, 0]
    assert packed(stress, 100e6)[0] == 0x440154FF
    assert packed(stress, 0.0).tolist() == [0x440154FF] * 5


def test_a_scale_is_fixed_at_the_yield_stress_or_runs(single_body):
    elastic, plastic = single_body(ALUMINIUM), single_body("plastic")
    scale = ColourScale(plastic)
    assert (scale.limit, scale.fixed) == (110e6, True)
    assert not scale.include(1e9)
    assert "fixed (yield stress)" in scale.label
    running = ColourScale(elastic)
    assert running.include(3e6)
    assert not running.include(2e6)
    assert running.limit == 3e6
    assert "running maximum" in running.label
    assert ColourScale(elastic, 5e6).limit == 5e6


@pytest.fixture
def single_body():
    """Makes a scene of one bar of a material."""
    import warp_mca as mca

    def make(material):
        if material == "plastic":
            material = mca.J2Bilinear(E=70e9, nu=0.27, rho=2700.0, sigma_y=110e6, E_t=27e9)
        bar = mca.Body(name="bar", geometry=mca.Box(size=(0.1, 0.01, 0.01), divisions=(10, 1, 1)), material=material)
        return mca.Scene(name="bar", bodies=(bar,), impact=mca.ImpactPhase(duration=1e-5))

    return make
