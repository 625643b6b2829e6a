"""Where the time of an output interval goes: `python -m benchmarks.substeps --device cuda:0 --multi-rate 4 --rows 560`.

Takes `two_link` to a row of its history, in contact or after it, then times the graphs that a run replays, and parts of
them: the search, the step that records and its stages one by one; with steps of several rates also each task of a
chain, and the substeps with some chains left out or with more places for the slower ones. Times of parts alone do not
add up, where parts overlap.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

import warp as wp

import warp_mca as mca
from benchmarks.timing import QUICK, seconds_per_call
from warp_mca.phases.carry_out import begin
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.physics.elements.patch_stage import PatchStage
from warp_mca.scene.catalogue import load_source
from warp_mca.scene.options import with_options
from warp_mca.step.rate_chains import Chains, Task
from warp_mca.system.stage import Stage, Step

TURNS = 10  # launches of a part in one graph
SPAN = 5e-3  # of the impact phase, which sets its steps [s]
Body = Callable[[], None]
Part = tuple[str, Body, int]  # name, what is captured, how many of what is timed that holds


def begun(preset: str, device: str, rate: int | None, mass_scaling: float | None) -> Impact:
    """The impact phase of `two_link` before its first step."""
    source = load_source("two_link")
    scene = with_options(source.build(source.resolve(preset)), None, mass_scaling, None)
    request = Request(span=SPAN, settings=Settings(device, "mixed", 1, rate))
    return begin([prepare(scene, mca.mesh(scene), request)], request)


def repeated(launch: Body) -> Body:
    """What it launches, TURNS times."""

    def body() -> None:
        for _ in range(TURNS):
            launch()

    return body


def recording(impact: Impact) -> Step:
    """A step that records a row and, on a GPU, searches for contact."""
    search = "after" if impact.solver.contacts.is_replayable else ""
    return Step(impact.state, records=True, is_row=True, search=search)


def wholes(impact: Impact) -> Iterator[Part]:
    """Graphs of a run, and the search between them."""
    solver, state, count = impact.solver, impact.state, impact.steps.per_interval
    rates = solver.model.rates

    def steps() -> None:
        solver._schedule()
        solver._steps(state, count)

    def interval() -> None:
        solver._schedule()
        solver._step(recording(impact))
        solver._steps(state, count - 1)
        solver._streams.finish()

    yield "substep", steps, count * (rates.substeps if rates else 1)
    yield "interval with its record", interval, 1
    yield "search", lambda: solver.contacts.search_all(state), 1


def record_parts(impact: Impact) -> Iterator[Part]:
    """Steps of all elements, with a record and without, and the stages of a record by themselves."""
    solver, step = impact.solver, recording(impact)

    def whole(kind: Step) -> None:
        solver._streams.run(solver.groups, kind)
        solver._streams.finish()

    for name, kind in (("step of all elements", Step(impact.state)), ("the same with a record", step)):
        yield name, repeated(lambda kind=kind: whole(kind)), TURNS
    yield "order of patches", repeated(solver._schedule), TURNS
    for group in solver.groups:
        for stage in group:
            yield f"stage: {stage.name}", repeated(lambda stage=stage: stage.launch(step)), TURNS


def chain_parts(impact: Impact, chains: Chains) -> Iterator[Part]:
    """Tasks by themselves; substeps with some chains only, and with places for slower ones."""
    state, (_, steps, count) = impact.state, next(wholes(impact))
    for chain, level, moves in chains.groups:
        task = Task(chain, level, moves, ())
        name = f"task: chain {chain}, level {level}, {'nodes' if moves else 'forces'}"
        yield name, repeated(lambda task=task: chains.launch(task, Step(state))), TURNS
    everything = dict(chains.groups)
    kept: dict[str, Callable[[int, Stage], bool]] = {
        "no contact": lambda chain, stage: stage.name != "contact",
        "chain 0 alone": lambda chain, stage: chain == 0,
        "the other chains alone": lambda chain, stage: chain > 0,
    }
    for name, keep in kept.items():
        for key, groups in everything.items():
            chains.groups[key] = [[stage for stage in group if keep(key[0], stage)] for group in groups]
        yield f"substep: {name}", steps, count
    chains.groups.update(everything)
    patches = [stage for stage in impact.solver.elements if isinstance(stage, PatchStage)]
    own = [stage.beside for stage in patches]
    for places in (1, 2, 4):
        for stage in patches:
            stage.beside = places * wp.get_device(impact.solver.device).sm_count
        yield f"substep: slower chains have {places} places", steps, count
    for stage, beside in zip(patches, own, strict=True):
        stage.beside = beside


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--multi-rate", type=int)
    parser.add_argument("--mass-scaling", type=float)
    parser.add_argument("--rows", type=int, default=560, help="rows of the history before the measurement")
    given = parser.parse_args()
    impact = begun(given.preset, given.device, given.multi_rate, given.mass_scaling)
    solver, state = impact.solver, impact.state
    impact.advance(until=given.rows * impact.steps.per_interval)
    saved = state.copy()
    parts = [wholes(impact), record_parts(impact), *([chain_parts(impact, solver.chains)] if solver.chains else [])]
    for number, (name, body, count) in enumerate(part for some in parts for part in some):

        def call(body: Body = body, graph: str = f"part {number}") -> None:
            solver.replay.graph(state, graph, body)

        def reset() -> None:
            with wp.ScopedDevice(solver.device):
                state.assign(saved)

        reset()
        seconds = seconds_per_call(call, solver.device, QUICK, reset) / count
        print(f"| {name} | {1e6 * seconds:.2f} |", flush=True)


if __name__ == "__main__":
    main()
