"""Swings and impacts in turn: one history, one ledger, momenta kept where one kind of phase follows the other."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.phases.cycle import Cycle
from warp_mca.phases.impact_driver import bending_period
from warp_mca.phases.motion import ImpactPart, Part, SwingPart
from warp_mca.phases.prepare import Request, Setup
from warp_mca.phases.settings import Settings
from warp_mca.rigid.handback import HandBack
from warp_mca.step.state_figures import max_plastic_strain

pytestmark = pytest.mark.usefixtures("no_figures")

COARSE = {
    "section": 2,
    "ring": 1,
    "axial": 6,
    "focus_layers": 2,
    "focus_size": 2e-3,
    "plate_core": 4,
    "plate_core_depth": 2,
    "plate_layers": 3,
    "plate_extension": 3,
    "output_interval": 2e-6,
}
T_END = {"single_link": 0.5, "three_link": 0.85}


def scene(name: str, **parameters) -> mca.Scene:
    made = mca.make_scene(name, **COARSE, **{"t_end": T_END[name], **parameters})
    last = made.bodies[-2].name
    end = mca.Probe(name="end", body=last, nodes="tip")
    return replace(
        made, probes=(end,), sections=(mca.Section(name="cut", body=last, at=(0.1, 0, 0), normal=(1, 0, 0)),)
    )


@cache
def cycle(name: str, inertia: str = "mesh", duration: float = 1.5e-3) -> tuple[Setup, list[Part], mca.Result]:
    """A run of two impacts, in float64."""
    request = Request(span=duration, settings=Settings("cpu", "float64", 1))
    run = Cycle(scene(name, rigid_inertia=inertia), None, request)
    result = run.run()
    return run.setup, run.story.parts, result


def impacts(name: str, inertia: str = "mesh") -> list[ImpactPart]:
    return [part for part in cycle(name, inertia)[1] if isinstance(part, ImpactPart)]


NAMES = pytest.mark.parametrize("name", ["single_link", "three_link"])


@NAMES
def test_impacts_follow_each_other_until_the_time_is_up(name: str):
    setup, _, result = cycle(name)
    phases = result.summary["phases"]
    assert [phase["kind"] for phase in phases] == ["rigid", "impact", "rigid", "impact", "rigid"]
    assert [phase["ended_by"] for phase in phases] == ["touch", "separation", "touch", "separation", "t_end"]
    for before, after in pairwise(phases):
        assert after["start"] == before["end"]
    assert phases[-1]["end"] == setup.t_end
    assert len(result.summary["contacts"]) >= 2
    lasted = sum(part.end - part.start for part in impacts(name))
    assert result.summary["simulated_time"] == pytest.approx(lasted, rel=1e-12)
    assert result.summary["n_steps"] == sum(part.impact.state.steps - 1 for part in impacts(name))
    for (start, end), part in zip(result.summary["contacts"], impacts(name), strict=False):
        assert part.start - impacts(name)[0].start <= start < end


@NAMES
def test_the_ledger_of_all_phases_closes(name: str):
    result = cycle(name)[2]
    energy = result.summary["energy"]
    spent = ("kinetic", "elastic", "plastic", "hourglass", "contact", "friction", "contact_loss", "joint", "lost")
    unexplained = sum(energy[key] for key in spent) - energy["external_work"] - energy["hand_off"] - energy["initial"]
    assert energy["error"] == pytest.approx(unexplained, abs=1e-15)
    scale = max(np.abs(result["external_work"]).max(), energy["initial"])
    assert np.abs(result["E_total_error"]).max() < 5e-4 * scale
    assert result.summary["energy_error"] < 5e-4
    assert energy["lost"] > 0.01 * scale  # vibration that does not go on


@NAMES
def test_one_history_without_gaps(name: str):
    setup, _, result = cycle(name)
    time = result.time
    assert (np.diff(time) > 0.0).all() and time[0] == -impacts(name)[0].start
    assert all(len(column) == len(time) for column in result.history.values())
    assert all(len(contact.pressure) == len(time) for contact in result.contacts)
    pressed = result.F_n > 0.0
    spans = [(part.start - impacts(name)[0].start, part.end - impacts(name)[0].start) for part in impacts(name)]
    inside = np.any([(time >= start) & (time <= end) for start, end in spans], axis=0)
    assert pressed.any() and not (pressed & ~inside).any()
    for link in setup.chain.links:
        theta = result[f"theta_{link.body}"]
        step = np.abs(np.diff(theta))
        assert step.max() < 0.1  # of a swing's samples; angles go on where phases change
    E = result["E_kinetic"]
    assert E[0] == 0.0 and (result["E_lost"][1:] >= result["E_lost"][:-1] - 1e-12).all()


@NAMES
def test_energy_and_momenta_are_kept_at_the_hand_off(name: str):
    result = cycle(name)[2]
    assert max(result.summary["handoff_mismatch"].values()) < 1e-12
    for part in impacts(name):
        model = part.impact.ready[0].model
        kinetic = 0.5 * model.mass @ (model.V**2).sum(axis=1)
        assert abs(part.jump) < 1e-12 * kinetic


@NAMES
def test_generalised_momenta_are_kept_at_the_hand_back(name: str):
    for part in impacts(name):
        back = part.back
        assert isinstance(back, HandBack)
        rigid, nodes = back.momenta
        assert np.abs(rigid - nodes).max() < 1e-12 * np.abs(nodes).max()
        _, v = part.impact.at_last_record()
        mass = part.impact.ready[0].model.mass
        total = 0.5 * mass @ (v**2).sum(axis=1)
        assert back.kinetic_energy + back.vibration_energy + back.drive_work == pytest.approx(total, rel=1e-12)
        assert part.lost > back.vibration_energy > 0.0  # elastic energy of vibration is lost too


@NAMES
def test_permanent_deformation_goes_on_and_vibration_does_not(name: str):
    """The shape at rest has next to no stress in place of what the vibrating one has, and the plastic strain stays."""
    _, parts, _ = cycle(name)
    swings = [part for part in parts if isinstance(part, SwingPart)]
    strains = [max_plastic_strain(part.impact.solver, part.impact.state) for part in impacts(name)]
    assert 0.0 < strains[0] <= strains[1]
    for swing, part in zip(swings[1:], impacts(name), strict=False):
        ended = part.impact.scene_runs[0].ledger.energy()
        assert 0.0 < swing.motion.elastic < 0.8 * ended["elastic"]
        assert swing.motion.plastic == pytest.approx(ended["plastic"], rel=0.02)
        assert max(np.abs(shape).max() for shape in swing.motion.shapes.values()) > 1e-7
    first, second = (item.motion for item in swings[1:3])
    p = [max(block.history[5::6].max(initial=0.0) for block in motion.history) for motion in (first, second)]
    assert p[0] <= p[1]


def test_later_impacts_begin_in_equilibrium():
    """Nothing vibrates before the second touch: forces on free nodes are small, bodies just apart."""
    part = impacts("single_link")[1]
    ledger = part.impact.scene_runs[0].ledger
    energies = ledger.energies()
    before = int(np.argmax(ledger.springs(np.array(ledger.kept.sums))[:, 0, 6] > 0.0))  # rows before the touch
    assert before >= 1
    # the elastic energy at the start is that at rest
    motion = next(p.motion for p in cycle("single_link")[1][2:3] if isinstance(p, SwingPart))
    assert energies["elastic"][0] + energies["hourglass"][0] == pytest.approx(
        motion.elastic + motion.hourglass - part.settled, rel=1e-6
    )
    assert energies["plastic"][0] == pytest.approx(motion.plastic, rel=1e-9)


def test_what_slender_rods_change_is_booked():
    result = cycle("single_link", "slender")[2]
    jumps = [part.jump + part.jump_back for part in impacts("single_link", "slender")]
    assert all(abs(part.jump) > 1e-3 * result["E_kinetic"].max() for part in impacts("single_link", "slender"))
    assert result.summary["energy"]["hand_off"] == pytest.approx(sum(jumps), rel=1e-12)
    assert result.summary["energy_error"] < 1e-3


def test_hinges_give_the_impulse_that_makes_the_motion_rigid():
    """On the whole chain it is the change of its nodes' momentum."""
    part = impacts("three_link")[0]
    model, back = part.impact.ready[0].model, part.back
    assert back is not None
    _, v = part.impact.at_last_record()
    chain = slice(0, model.node_start["plate"])
    mass = model.mass[chain]
    momentum = back.chain.moved_to(part.end).momentum(back.theta, back.theta_dot) if back.chain else np.zeros(2)
    change = momentum - mass @ v[chain, :2]
    assert part.hinge_impulse["OA"] == pytest.approx(change, abs=1e-12 * np.abs(mass @ np.abs(v[chain, :2])).max())


@NAMES
def test_probes_and_sections_record_swings_and_impacts(name: str):
    """Probes move on through hand-offs and ways back; rigid links have no force in sections."""
    _, _, result = cycle(name)
    (end,), (cut,) = result.probes, result.sections
    starts = [np.argmin(np.abs(end.time + result.summary["t_contact"] - p.start)) for p in impacts(name)]
    inside = [k + n for k, p in zip(starts, impacts(name), strict=True) for n in range(p.impact.rows)]
    known = np.zeros(len(end.time), dtype=bool)
    known[inside] = True
    back = known[:-1] & ~known[1:]  # steps at whose start vibration is left out
    moved, before, after = np.diff(end.position, axis=0), end.velocity[:-1], end.velocity[1:]
    way = np.where(back[:, None], after, 0.5 * (before + after)) * np.diff(end.time)[:, None]
    error = np.linalg.norm(moved - way, axis=1) / np.linalg.norm(moved, axis=1).max()
    assert error[~back].max() < 2e-3 and error[back].max() < 0.04
    assert np.array_equal(~np.isnan(cut.force[:, 0]), known) and np.nanmax(np.abs(cut.force)) > 10.0
    assert [len(result.impact(k).probes[0].time) for k in (0, 1)] == [p.impact.rows for p in impacts(name)]


def test_a_run_that_ends_before_the_first_touch_is_a_swing():
    result = mca.run(scene("three_link", t_end=0.1))
    summary = result.summary
    assert [(p["kind"], p["ended_by"]) for p in summary["phases"]] == [("rigid", "t_end")]
    assert summary["n_steps"] == 0 and not summary["touched"] and summary["contacts"] == []
    assert result.time[0] == 0.0 and result.time[-1] == 0.1  # counted from the release
    assert np.abs(result["E_total_error"]).max() < 1e-9 * result["E_kinetic"].max()
    assert any("touched" in warning for warning in result.warnings)


def test_an_impact_lasts_as_long_as_asked_at_most():
    result = mca.run(scene("single_link"), duration=1e-4)
    phase = result.summary["phases"][-1]
    assert (phase["kind"], phase["ended_by"]) == ("impact", "duration")
    assert phase["end"] - phase["start"] == pytest.approx(1e-4, rel=1e-12)
    assert result.summary["contact_open_at_end"]
    assert any("had not ended after duration" in warning for warning in result.warnings)


def test_the_open_time_ends_an_impact():
    asked = scene("single_link", t_end=0.2)
    ends = []
    for open_time in (1e-4, 3e-4):
        result = mca.run(replace(asked, impact=replace(asked.impact, open_time=open_time)), duration=1.5e-3)
        phase = result.summary["phases"][1]
        (_, closed), interval = result.summary["contacts"][-1], 2e-6
        ends.append(phase["end"] - phase["start"] - closed)
        assert open_time - 2 * interval <= ends[-1] <= open_time + 40 * interval
    assert ends[1] > ends[0]


def test_the_default_open_time_is_the_bending_period_of_a_rod():
    """T = 2 pi L^2 / (3.9266^2 c kappa): 0.54 ms for the rods of the paper."""
    setup = cycle("single_link")[0]
    L, kappa, c = 0.21, 0.013 / 2.0, np.sqrt(70e9 / 2700.0)
    assert bending_period(setup, "OA") == pytest.approx(2.0 * np.pi * L**2 / (3.9266**2 * c * kappa), rel=0.15)


def test_a_touch_where_no_contact_is_defined_ends_the_run_with_a_reason():
    asked = scene("single_link")
    ground = mca.Contact(slave=mca.Surface(body="plate", nodes="bottom"), master=mca.RigidPlane(point=(0.0, -9.0, 0.0)))
    result = mca.run(replace(asked, contacts=(ground,)))
    assert [(p["kind"], p["ended_by"]) for p in result.summary["phases"]] == [("rigid", "touch")]
    assert any("OA touches the target" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"t_end": -1.0}, "t_end"),
        ({"t_end": 1.0, "rigid": None}, "RigidPhase"),
    ],
)
def test_ends_that_cannot_be_reached_are_refused(change: dict, words: str):
    with pytest.raises(mca.RequestError, match=words):
        replace(scene("single_link"), **change)


def test_batches_refuse_cycles():
    with pytest.raises(mca.RequestError, match="t_end"):
        mca.run_batch([scene("single_link")])


def test_a_saved_cycle_is_loaded_as_it_was(tmp_path):
    result = mca.run(scene("single_link", t_end=0.2), duration=3e-4, out=tmp_path / "run")
    loaded = mca.load(tmp_path / "run")
    assert loaded.summary["phases"] == result.summary["phases"]
    assert all(np.array_equal(loaded[name], result[name], equal_nan=True) for name in result.history)


@NAMES
def test_each_impact_can_be_looked_at_by_itself(name: str):
    _, _, result = cycle(name)
    for k, part in enumerate(impacts(name)):
        own, alone = result.impact(k), part.impact.scene_runs[0].history()
        assert own.time == pytest.approx(alone["time_s"], abs=1e-12)
        assert np.array_equal(own.F_n, alone["F_n_N"]) and len(own.contacts[0].pressure) == len(own.time)
    with pytest.raises(mca.RequestError, match="the run has 2"):
        result.impact(2)
