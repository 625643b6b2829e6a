"""What is said before a run and while it goes on: its step and time, lines where output is piped, `progress=True`."""

from __future__ import annotations

import logging
import re
import time
from dataclasses import replace

import pytest
from impacts import begun
from test_gpu import oblique
from test_multi_rate import free_bar
from test_run import bar

import warp_mca as mca
from warp_mca.base import progress
from warp_mca.base.progress import Lines, duration_words
from warp_mca.phases.forecast import forecast, step_time


def test_lines_come_every_ten_seconds_and_twentieth(capsys: pytest.CaptureFixture[str]):
    now = [0.0]
    tell = Lines(lambda: now[0])
    for t, stage, done in (
        (0.0, "mesh", 0.0),
        (9.0, "impact", 0.001),  # too early
        (19.0, "impact", 0.2),
        (28.0, "impact", 0.9),  # too early
        (30.0, "impact", 0.22),  # too little
        (59.0, "impact", 0.5),
        (1000.0, "impact", 0.51),  # silent for long
    ):
        now[0] = t
        tell(stage, done)
    assert capsys.readouterr().err.splitlines() == [
        "impact: 20% done, 40 s left",
        "impact: 50% done, 50 s left",
        "impact: 51% done, 15.9 min left",
    ]


@pytest.mark.parametrize(("seconds", "words"), [(0.04, "0.04 s"), (12.3, "12 s"), (600, "10.0 min"), (9000, "2.5 h")])
def test_times_are_said_as_people_say_them(seconds: float, words: str):
    assert duration_words(seconds) == words


def test_a_run_says_before_it_starts_what_sets_its_step(caplog: pytest.LogCaptureFixture):
    caplog.set_level(logging.INFO, "warp_mca")
    order: list[str] = []
    mca.run(bar(penalty=10.0), threads=1, progress=lambda stage, _: order.append(f"{stage} {len(caplog.records)}"))
    (said,) = [record.message for record in caplog.records if record.levelno == logging.INFO]
    what = r"bar: 100 elements, 1,440 steps of [\d.e-]+ s, set by element 99 of bar"
    assert re.fullmatch(rf"{what} \(\d+% of omega\^2 by contact springs\); about [\d.]+ s on cpu, 1 thread", said)
    assert "compile 0" in order and "impact 1" in order and "impact 0" not in order


def test_the_forecast_tells_groups_and_batches():
    two = begun(free_bar(element="hex8r"), multi_rate=3)
    assert re.search(r"s \(of 3 groups; the shortest [\d.e-]+ s\), set by element 0 of bar", forecast(two))
    both = begun(oblique(), oblique())
    assert forecast(both).startswith("oblique and 1 more: 1,432 elements")
    rigid = begun(replace(bar(), bodies=(replace(bar().bodies[0], rigid=True),)))
    assert "0 elements" in forecast(rigid) and "set by contact springs and joints" in forecast(rigid)


@pytest.mark.parametrize("contact", ["general", "listed"])
def test_a_step_takes_as_long_as_forecast(contact: str, monkeypatch: pytest.MonkeyPatch):
    """Blocks of few layers, whose contact takes longer than their elements, by processor time: others work too."""
    monkeypatch.setattr(time, "perf_counter", time.process_time)
    geometry = mca.Box(size=(0.02, 0.02, 0.01), divisions=(12, 12, 2))
    blocks = [
        mca.Body(
            name=name,
            geometry=geometry,
            material=mca.Elastic(E=1e10, nu=0.3, rho=3000.0),
            velocity=(0.0, 0.0, speed),
            position=(0.0, 0.0, z),
        )
        for name, z, speed in (("low", 0.0, 0.0), ("high", 0.0101, -5.0))
    ]
    skins = [mca.Surface(body=block.name, nodes="boundary") for block in blocks]
    touching = mca.ContactAll() if contact == "general" else mca.Contact(slave=skins[0], master=skins[1], two_way=True)
    phase = mca.ImpactPhase(duration=4e-5, output_interval=1e-6)
    scene = mca.Scene(name="blocks", bodies=tuple(blocks), contacts=(touching,), impact=phase)
    wanted = step_time(begun(scene))
    summary = mca.run(scene, device="cpu", threads=1).summary
    assert summary["wall"]["fe"] / summary["n_steps"] == pytest.approx(wanted, rel=2.0 / 3.0)


def test_true_shows_lines_where_nobody_watches(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(progress, "LINE_TIME", 0.0)
    mca.run(bar(), threads=1, progress=True)
    assert re.search(r"^impact: \d+% done, .* left$", capsys.readouterr().err, re.MULTILINE)
    assert len(mca.run_batch([bar(), bar()], progress=True, threads=1)) == 2
    assert "impact: " in capsys.readouterr().err
    mca.run(bar(), threads=1, progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(mca.RequestError, match=r"progress = 3\.0: give a function"):
        mca.run(bar(), progress=3.0)
