"""Owns element-steps per second: each element, precision and set of features, with forces checked in the same run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from benchmarks.blocks import FULL, RATES, SAVINGS, Held
from benchmarks.memory import memory
from benchmarks.stages import shares
from benchmarks.timing import Care, clock, ratio, seconds_per_call, steps_per_graph
from warp_mca.system.model import Model
from warp_mca.system.stage import Step


def steps_of(held: Held, care: Care) -> int:
    """Steps of a captured graph."""
    if held.case.record:
        return held.case.record
    first = seconds_per_call(lambda: held.solver.step(held.state, 1), held.device, Care(0.02, 1), held.reset)
    return steps_per_graph(first, care)


def step_seconds(held: Held, care: Care) -> float:
    """Time of a step [s], replayed from captured graphs as a run does."""
    count = steps_of(held, care)
    return seconds_per_call(lambda: held.advance(count), held.device, care, held.reset) / count


def saving(whole: Held, part: Held, care: Care) -> float:
    """Share of the step of `whole` that `part` does without [-], timed in turns."""
    counts = [steps_of(held, care) for held in (part, whole)]
    calls = [(lambda h=h, n=n: h.advance(n), h.reset) for h, n in zip((part, whole), counts, strict=True)]
    return 1.0 - ratio(calls[0], calls[1], whole.device, care) * counts[1] / counts[0]


def _row(held: Held, care: Care) -> dict[str, Any]:
    seconds = step_seconds(held, care)
    count = held.solver.model.element_count
    row = {"seconds_per_step": seconds, "rate": count / seconds, "n_elements": count}
    return row | {"yielded": held.yielded(), "sound": held.sound()}


def measure_rates(
    model: Model, where: dict[str, Any], precisions: list[str], device: str, care: Care, cases: Sequence[str]
) -> list[dict]:
    """A row for each feature set of RATES that `cases` names and each precision; `where` goes into every row."""
    rows = []
    for name in cases:
        case = RATES[name]
        exact: np.ndarray | None = None
        if "mixed" in precisions:
            exact = Held(model, case, device, "float64").forces()
        for precision in precisions:
            held = Held(model, case, device, precision)
            row = where | {"precision": precision, "case": name} | _row(held, care)
            if precision == "mixed" and exact is not None:
                row["force_error"] = float(np.abs(held.forces() - exact).max() / np.abs(exact).max())
            if name in ("elastic", "plastic, 5 % yield"):
                row |= memory(held)
            rows.append(row)
            say(row)
    return rows


def measure_savings(model: Model, where: dict[str, Any], precisions: list[str], device: str, care: Care) -> list[dict]:
    """For each precision, the step with everything, its stages, and what leaving out each feature saves of it."""
    rows = []
    for precision in precisions:
        held = Held(model, FULL, device, precision)
        row = where | {"precision": precision, "case": "everything"} | _row(held, care)
        row["stages"] = shares(held, care)
        row["saves"] = {
            name: saving(held, Held(model, case, device, precision), care) for name, case in SAVINGS.items()
        }
        rows.append(row)
        say(row)
        print("    stages: " + ", ".join(f"{k} {1e6 * v:.1f} us" for k, v in row["stages"].items()))
        print("    saves:  " + ", ".join(f"{k} {100 * v:.1f} %" for k, v in row["saves"].items()), flush=True)
    return rows


def measure_host(model: Model, where: dict[str, Any], device: str, care: Care) -> dict[str, Any]:
    """Host time to launch a step: replayed from a graph of 20 steps, and kernel by kernel without a graph."""
    held = Held(model, FULL, device, "mixed")
    solver, state = held.solver, held.state
    steps, launches, now = 20, 5, clock(device)
    solver.step(state, steps)

    def host(call: Any) -> float:
        times = []
        for _ in range(care.repeats):
            wp.synchronize_device(device)
            begun = now()
            for _ in range(launches):
                call()
            times.append(now() - begun)
        wp.synchronize_device(device)
        return float(np.median(times)) / launches

    def plain() -> None:
        with wp.ScopedDevice(device):
            solver._step(Step(state))

    whole = seconds_per_call(lambda: solver.step(state, steps), device, care, held.reset) / steps
    found = {"host_graph": host(lambda: solver.step(state, steps)) / steps, "host_plain": host(plain), "step": whole}
    found["step_plain"] = seconds_per_call(plain, device, care, held.reset)
    row = where | {"n_elements": solver.model.element_count} | found
    print("host   ", ", ".join(f"{k} {1e6 * v:.2f} us" for k, v in found.items()), flush=True)
    return row


def say(row: dict[str, Any]) -> None:
    """One line of the table on the terminal."""
    more = f"  forces {row['force_error']:.1e}" if "force_error" in row else ""
    more += f"  yielded {row['yielded']:.3f}" if row["yielded"] else ""
    print(
        f"{row['element']:6}{row['n_elements']:>11,}  {row['precision']:8}{row['case']:32}"
        f"{1e6 * row['seconds_per_step']:>12.1f} us/step{row['rate'] / 1e6:>10.2f} M element-steps/s{more}"
        + ("" if row["sound"] else "  NOT SOUND"),
        flush=True,
    )
