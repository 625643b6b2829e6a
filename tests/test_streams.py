"""What a GPU may compute side by side in a step that records: which stages wait for which."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
import warp as wp
from impacts import begun, figures, finished, flushing
from test_multi_rate import hinged

from warp_mca.physics.contact.stage import ContactStage
from warp_mca.step.replay import Replay
from warp_mca.step.solver import Solver
from warp_mca.system import stage
from warp_mca.system.stage import Stage, Step, Streams
from warp_mca.system.state import State
from warp_mca.system.threads import Split, whole

ENERGIES = {"element energies", "paths, frames: stress", "element sums", "spring sums"}
Done = set[str]


class Stream:
    """All that has ended when what comes next in it begins."""

    def __init__(self) -> None:
        self.done: Done = set()


class Order:
    """Stands for `warp` in `warp_mca.system.stage`: what each stage waits for, in `waits`."""

    def __init__(self, streams: Streams) -> None:
        streams.streams = {name: Stream() for name in streams.streams}
        self.main = self.current = Stream()
        self.waits: dict[str, Done] = {}

    def launched(self, name: str) -> None:
        self.waits[name] = set(self.current.done)
        self.current.done.add(name)

    def record_event(self) -> Done:
        return set(self.current.done)

    def wait_event(self, event: Done) -> None:
        self.current.done |= event

    def wait_stream(self, stream: Stream) -> None:
        self.current.done |= stream.done

    @contextmanager
    def ScopedStream(self, stream: Stream, sync_enter: bool) -> Iterator[None]:
        assert not sync_enter
        self.current = stream
        yield
        self.current = self.main


def launched(solver: Solver, step: Step, monkeypatch: pytest.MonkeyPatch) -> tuple[Order, Streams]:
    """The stages of a step, which only note in what order they are launched."""
    streams = Streams(False)
    order = Order(streams)
    monkeypatch.setattr(stage, "wp", order)

    def noting(item: Stage) -> Stage:
        return replace(item, launch=lambda _: order.launched(item.name))

    streams.run([[noting(item) for item in group] for group in solver.groups], step)
    return order, streams


@pytest.mark.parametrize("groups", [None, 3])
def test_nodes_move_beside_energies_and_the_search_and_all_have_ended_after_the_step(
    groups: int | None, monkeypatch: pytest.MonkeyPatch
):
    impact = begun(hinged(), multi_rate=groups)
    order, streams = launched(impact.solver, Step(impact.state, records=True), monkeypatch)
    waits, moved = order.waits, {"free nodes", "joints, driven nodes"}
    for name in moved:
        assert {"element forces", "contact", "displacements kept", "places, sections", "frames: contact"} <= waits[name]
        assert not waits[name] & (ENERGIES | {"search after contact"})
    assert waits["search after contact"] >= {"contact", "displacements kept", "boxes of faces"}
    assert "displacements kept" in waits["boxes of faces"]
    assert not waits["boxes of faces"] & {"contact", "search before contact"}
    assert "element forces" not in waits["search after contact"]
    assert waits["contact"] == {"search before contact"}
    for name in ("element energies", "paths, frames: stress"):
        assert {"element forces", "displacements kept"} <= waits[name] and "contact" not in waits[name]
    assert {"element energies", "next record"} <= waits["element sums"]
    assert {"contact", "next record"} <= waits["spring sums"]
    assert {"free nodes", "joints, driven nodes"} <= waits["motion sums"]
    assert ("velocities kept" in waits["motion sums"]) == (groups is not None)
    names = {item.name for group in impact.solver.groups for item in group}
    last = {"paths, frames: nodal stress"}
    assert {"paths, frames: stress", "next record"} <= waits["paths, frames: nodal stress"]
    assert names - order.main.done == (last | {"motion sums"} if groups else last)
    streams.finish()
    assert order.main.done == names


def test_steps_without_a_record_wait_for_contact_before_nodes_move(monkeypatch: pytest.MonkeyPatch):
    impact = begun(hinged())
    order, streams = launched(impact.solver, Step(impact.state), monkeypatch)
    assert order.waits["free nodes"] == order.waits["joints, driven nodes"] == {"element forces", "contact"}
    assert order.waits["contact"] == set() and order.main.done == set(order.waits)
    streams.finish()


def eager(self: Replay, state: State, name: str, body: Callable[[Split], None], count: int = 1) -> None:
    """In place of `Replay.program`: a CPU's graphs hold no search."""
    with wp.ScopedDevice(self.device), flushing():
        for _ in range(count):
            body(whole)


@pytest.mark.parametrize("groups", [None, 3])
def test_a_search_behind_contact_gives_the_bits_of_one_before_it(groups: int | None, monkeypatch: pytest.MonkeyPatch):
    """As on a GPU: contact of the step that records takes the lists of the search before."""
    scene = hinged(duration=4e-5)
    plain = finished(scene, multi_rate=groups)
    assert plain.steps.spare and plain.state.contacts[0].count.numpy().any()
    monkeypatch.setattr(Replay, "program", eager)
    monkeypatch.setattr(ContactStage, "is_replayable", property(lambda own: own.bvh is not None))
    late = begun(scene, multi_rate=groups)
    late.solver.work.u_record = wp.zeros(late.solver.model.node_count, dtype=wp.vec3d, device="cpu")
    listed = []
    own = ContactStage.list_faces

    def list_faces(self: ContactStage, *given: Any) -> None:
        listed.append(self.index)
        own(self, *given)

    monkeypatch.setattr(ContactStage, "list_faces", list_faces)
    late.advance()
    assert len(listed) > late.steps.intervals // late.steps.intervals_per_search
    assert late.state.differences(plain.state) == []
    known, found = figures(plain), figures(late)
    assert [name for name in known if known[name].tobytes() != found[name].tobytes()] == []
