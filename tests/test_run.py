"""Whole runs: bar theory, precision, repetition, guards, and that a scene pays only for what it has."""

import numpy as np
import pytest
import warp as wp

import warp_mca as mca
from warp_mca.errors import RequestError

ALUMINIUM = {"E": 70e9, "nu": 0.0, "rho": 2700.0}
C = np.sqrt(70e9 / 2700.0)


def bar(material=None, *, position=(0.0, 0.0, 0.0), penalty=1.0, **impact):
    """A bar of 0.2 m with one element across, nu = 0, that runs into a wall at 1 m/s."""
    point = (0.2 + position[0], position[1], position[2])
    return mca.Scene(
        name="bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=mca.Box(size=(0.2, 0.01, 0.01), divisions=(100, 1, 1)),
                material=material or mca.Elastic(**ALUMINIUM),
                position=position,
                velocity=(1.0, 0.0, 0.0),
            ),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="bar", nodes="xmax"),
                master=mca.RigidPlane(point=point, normal=(-1, 0, 0)),
                penalty=penalty,
            ),
        ),
        impact=mca.ImpactPhase(**{"duration": 1.2e-4, "output_interval": 1e-6} | impact),
        tip=mca.Point(body="bar", at=(0.1, 0.0, 0.0)),
    )


def test_bar_follows_wave_theory():
    """F = rho c A v for 2 L / c; the middle stops when the front passes it."""
    result = mca.run(bar())
    plateau = result.F_n[(result.time > 1e-5) & (result.time < 7e-5)]
    assert plateau.mean() == pytest.approx(2700.0 * C * 1e-4, rel=2e-3)
    assert result.summary["contact_duration"] == pytest.approx(0.4 / C, rel=0.03)
    front = np.interp(-0.5, -result["tip_vx"][:40], result.time[:40])
    assert 0.1 / front == pytest.approx(C, rel=0.03)  # the wall's springs take half a microsecond to push
    assert result.summary["energy_error"] < 1e-3
    assert (result.F_n * result.time[1]).sum() == pytest.approx(2.0 * 2700.0 * 0.2e-4, rel=0.02)  # it flies back


def test_yielding_bar_carries_the_elastic_precursor_and_a_slower_plastic_wave():
    """Uniaxial bilinear bar, Karman and Taylor: the wall sees sigma_y + rho c_t (v - v_y), c_t = sqrt(E_t / rho)."""
    sigma_y, E_t = 8e6, 17.5e9
    v_y = sigma_y / (2700.0 * C)
    result = mca.run(bar(mca.J2Bilinear(**ALUMINIUM, sigma_y=sigma_y, E_t=E_t)))
    wall = 1e-4 * (sigma_y + 2700.0 * np.sqrt(E_t / 2700.0) * (1.0 - v_y))
    assert result.F_n[(result.time > 1e-5) & (result.time < 6e-5)].mean() == pytest.approx(
        wall, rel=0.01
    )  # it spreads sideways
    plateau = (result.time > 2.4e-5) & (result.time < 3.4e-5)  # between the two waves at the middle
    assert result["tip_vx"][plateau].mean() == pytest.approx(1.0 - v_y, rel=0.03)
    assert result.summary["max_plastic_strain"] > 0.0
    assert result.summary["energy_error"] < 2e-3


def test_precisions_agree():
    one, two = (mca.run(bar(), precision=name).F_n for name in ("mixed", "float64"))
    assert one == pytest.approx(two, abs=1e-4 * two.max())


def test_runs_repeat_bit_for_bit():
    one, two = mca.run(bar()), mca.run(bar())
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)


def test_last_row_is_the_end_whatever_the_interval():
    result = mca.run(bar(), duration=1.05e-5)
    assert result.time[-1] == pytest.approx(1.05e-5, rel=1e-12)
    assert result.summary["simulated_time"] == pytest.approx(1.05e-5, rel=1e-12)


def test_step_beyond_the_limit_blows_up_and_is_caught(monkeypatch):
    """The largest element eigenvalue bounds the bar's own closely: 10 % more than the stable step is too much."""
    mca.run(bar(time_step_scale=1.0))
    scene = bar()
    object.__setattr__(scene.impact, "time_step_scale", 1.1)
    with pytest.raises(mca.GuardError, match="energy"):
        mca.run(scene)


def test_free_fall_is_a_parabola_to_the_last_digit(monkeypatch):
    """Central differences are exact for it, if they start from the velocity of half a step before t = 0."""
    last = {}
    solver = "warp_mca.solver.Solver"
    monkeypatch.setattr(f"{solver}.max_plastic_strain", lambda self, scene: last.update(u=self.u.numpy()) or 0.0)
    falling = mca.Scene(**{**vars(bar()), "contacts": (), "gravity": (0.0, -1e4, 0.0)})
    result = mca.run(falling)
    t = 1.2e-4 + result.summary["dt"]
    assert last["u"] == pytest.approx(np.broadcast_to([t, -0.5e4 * t**2, 0.0], (404, 3)), rel=1e-10)
    assert result.summary["energy_error"] < 1e-12


@pytest.mark.filterwarnings("ignore:overflow")
def test_overflow_of_the_elements_precision_stops_the_run():
    """Stress of 1e39 Pa is beyond float32."""
    with pytest.raises(mca.GuardError, match="not a number"):
        mca.run(bar(mca.Elastic(E=1e39, nu=0.0, rho=2700e28)), duration=1e-6)


def test_energy_tolerance_stops_the_run():
    with pytest.raises(mca.GuardError, match=r"energy imbalance .* exceeds energy_tolerance = 1e-09"):
        mca.run(bar(energy_tolerance=1e-9))


def test_inverted_element_stops_the_run():
    """One end is pushed through the other."""
    scene = mca.Scene(
        name="crush",
        bodies=(
            mca.Body(
                name="box",
                geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 1, 1)),
                material=mca.Elastic(E=1e6, nu=0.0, rho=1000.0),
            ),
        ),
        fixed=(mca.Fixed(body="box", nodes="xmin"),),
        prescribed=(mca.Prescribed(body="box", nodes="xmax", axis="x", times=(0.0,), velocities=(-1.0,)),),
        impact=mca.ImpactPhase(duration=2e-2, output_interval=1e-4, energy_tolerance=1e9),
    )
    with pytest.raises(mca.GuardError, match="inside out"):
        mca.run(scene)


def test_bar_that_sinks_into_its_wall_stops_the_run():
    with pytest.raises(mca.GuardError, match="sank deeper"):
        mca.run(bar(penalty=1e-7, duration=1e-2, output_interval=1e-4))


def test_scene_too_far_from_the_origin_is_refused():
    with pytest.raises(RequestError, match=r"Body.position.*lost.*closer to the origin"):
        mca.run(bar(position=(1e9, 0.0, 0.0)))


def test_large_strain_is_warned_of():
    soft = mca.Elastic(E=5e4, nu=0.0, rho=2700.0)
    result = mca.run(bar(soft, duration=1e-2, output_interval=1e-4, energy_tolerance=1.0))
    assert any("strain reached" in warning for warning in result.warnings)


def launched(scene, monkeypatch):
    """Names of the kernels that a run launches."""
    names, launch = set(), wp.launch

    def note(kernel, *args, **kwargs):
        names.add(kernel.key.split("__locals__")[-1].strip("_"))
        return launch(kernel, *args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(wp, "launch", note)
        mca.run(scene, duration=4e-6)
    return names


def test_scene_launches_only_what_it_has(monkeypatch):
    free = mca.Scene(**{**vars(bar()), "contacts": ()})
    base = launched(free, monkeypatch)
    assert not {"advance_bound", "touch_plane", "touch_surface", "react", "sum_springs"} & base
    assert launched(bar(), monkeypatch) - base == {"touch_plane", "sum_springs"}
    joint = mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0))
    driven = mca.Prescribed(body="bar", nodes="xmax", axis="x", times=(0.0,), velocities=(0.0,))
    for bound in ({"joints": (joint,)}, {"prescribed": (driven,)}):
        assert launched(mca.Scene(**{**vars(free), **bound}), monkeypatch) - base == {"advance_bound"}


def test_elastic_scene_keeps_no_history(monkeypatch):
    from warp_mca.solver import Solver

    sizes = []
    monkeypatch.setattr(Solver, "compile", lambda self: sizes.extend(e.history.size for e in self.elements))
    for material in (mca.Elastic(**ALUMINIUM), mca.J2Bilinear(**ALUMINIUM, sigma_y=1e8, E_t=1e9)):
        mca.run(bar(material), duration=1e-6)
    assert sizes == [0, 48 * 100]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"material": mca.Elastic(E=1e10, nu=0.3, rho=1e-300)},
            r"largest eigenvalue of element 0 .* check their units",
        ),
        ({"penalty": 1e300}, r"largest eigenvalue of element \d+ .* check their units"),
        ({"output_interval": 1e-30}, r"output_interval = 1e-30: .* rows, a history holds"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_what_no_number_or_history_holds_is_refused(changes, words):
    """They ended in LinAlgError and OverflowError, or never."""
    with pytest.raises(mca.RequestError, match=words):
        mca.run(bar(**changes))


def test_a_duration_that_never_ends_is_refused():
    with pytest.raises(mca.RequestError, match=r"rows, a history holds"):
        mca.run(bar(), duration=1e30)
