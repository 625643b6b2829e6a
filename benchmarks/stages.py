"""Owns what each stage of a step takes: its launches alone, replayed from a captured graph."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.blocks import Held
from benchmarks.timing import Care, captured, seconds_per_call, steps_per_graph
from warp_mca.system.stage import Step


def bodies(held: Held) -> dict[str, Callable[[], None]]:
    """The launches of each stage, by name."""
    s, state = held.solver, held.state

    def elements() -> None:
        for stage in s.elements:
            stage.launch(s.work, state)

    def contact() -> None:
        for stage in s.contacts:
            stage.launch(s.work, state, s.dt)

    return {
        "element forces": elements,
        "contact": contact,
        "gather and integrate": lambda: s.nodes.advance_free(Step(state)),
        "hinge and driven face": lambda: s.nodes.advance_bound(Step(state)),
    }


def shares(held: Held, care: Care) -> dict[str, float]:
    """Time of each stage [s] in a step; a record is what a step that writes one takes more."""
    found = {}
    whole: dict[str, Callable[[], None]] = {
        "step": lambda: held.solver._step(Step(held.state)),
        "record": lambda: held.solver._step(Step(held.state, records=True, is_row=True)),
    }
    for name, body in (bodies(held) | whole).items():
        held.reset()
        whole["step"]()  # yields, so that stages find the state that a run has
        one = seconds_per_call(captured(body, 1, held.device), held.device, Care(0.02, 1))
        count = steps_per_graph(one, care)
        call = captured(body, count, held.device)
        found[name] = seconds_per_call(call, held.device, care) / count
    found["record"] -= found["step"]
    return found
