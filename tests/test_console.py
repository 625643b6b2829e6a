"""What the command line prints of a run with swings and impacts in turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from warp_mca.cli.console import print_summary
from warp_mca.results.headlines import MAX_PHASES
from warp_mca.results.result import Result


def _summary(phases: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    return {
        "t_contact": 0.25,
        "v_n": 2.0,
        "v_t": 3.0,
        "phases": phases,
        "F_n_peaks": [],
        "F_t_min": 0.0,
        "F_t_max": 0.0,
        "contacts": [],
        "sticks": [],
        "max_plastic_strain": 0.0,
        "energy_error": 0.0,
        "n_elements": 1200,
        "n_steps": 500,
        "dt": 1e-7,
        "simulated_time": 5e-5,
        "wall": {},
        "element_steps_per_s": None,
        **more,
    }


def _phase(kind: str, start: float, end: float, ended_by: str, lost: float = 0.0) -> dict[str, Any]:
    return {"kind": kind, "start": start, "end": end, "ended_by": ended_by, "lost": lost}


def _printed(capsys, summary: dict[str, Any]) -> list[str]:
    print_summary(Result(summary, {"time_s": np.zeros(1)}, None, ()), ())
    return [line.rstrip() for line in capsys.readouterr().out.splitlines()]


def test_phases_are_listed_with_what_ended_them_and_what_was_lost(capsys):
    phases = [
        _phase("rigid", 0.0, 0.25, "touch"),
        _phase("impact", 0.25, 0.251, "separation", 0.24592),
        _phase("rigid", 0.251, 0.9, "touch"),
        _phase("impact", 0.9, 0.9002, "t_end"),
    ]
    lines = _printed(capsys, _summary(phases))
    first = next(k for k, line in enumerate(lines) if line.startswith("phases"))
    assert lines[first].split(maxsplit=1)[1] == "rigid  0.000000 to 0.250000 s, ended by touch"
    assert lines[first + 1].strip() == "impact 0.250000 to 0.251000 s, ended by separation, 0.246 J of vibration lost"
    assert lines[first + 2].strip() == "rigid  0.251000 to 0.900000 s, ended by touch"
    assert lines[first + 3].strip() == "impact 0.900000 to 0.900200 s, ended by t_end"


def test_a_long_list_of_phases_is_cut(capsys):
    phases = [_phase("rigid", float(k), k + 1.0, "touch") for k in range(MAX_PHASES + 3)]
    lines = _printed(capsys, _summary(phases))
    assert sum("ended by touch" in line for line in lines) == MAX_PHASES
    assert any(line.strip() == "and 3 more, see summary.json" for line in lines)


def test_a_run_without_impact_counts_no_steps(capsys):
    lines = _printed(capsys, _summary([], n_steps=0, dt=0.0, simulated_time=0.0))
    assert "model           1,200 elements, no impact" in lines
    assert not any(line.startswith("phases") for line in lines)
