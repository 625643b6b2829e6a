"""Owns what each stage of a step takes: its launches alone, replayed from a captured graph."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.blocks import Held
from benchmarks.timing import Care, captured, seconds_per_call, steps_per_graph


def bodies(held: Held) -> dict[str, Callable[[], None]]:
    """The launches of each stage, by name."""
    s = held.solver

    def elements() -> None:
        for stage in s.elements:
            stage.forces(s.X, s.law, s.u, s.force)

    def contact() -> None:
        for stage in s.contacts:
            stage.touch(s.X, s.u, s.v, s.dt, s.contact_force, s.normal_force, s.flag)

    return {
        "element forces": elements,
        "contact": contact,
        "gather and integrate": lambda: s._integrate(s.dt, s.dt, s.bonds.role),
        "hinge and driven face": s._advance_bound,
    }


def shares(held: Held, care: Care) -> dict[str, float]:
    """Time of each stage [s] in a step; a record is what a step that writes one takes more."""
    found = {}
    step = held.solver._step
    for name, body in (bodies(held) | {"step": step, "record": lambda: held.solver._record_step(frozenset())}).items():
        held.reset()
        step()  # yields, so that stages find the state that a run has
        one = seconds_per_call(captured(body, 1, held.device), held.device, Care(0.02, 1))
        count = steps_per_graph(one, care)
        call = captured(body, count, held.device)
        found[name] = seconds_per_call(call, held.device, care) / count
    found["record"] -= found["step"]
    return found
