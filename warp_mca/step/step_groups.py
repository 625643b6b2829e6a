"""Owns the stages of a time step and their order, as docs/architecture.md lists them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warp_mca.step.stage import (
    ASIDE,
    BESIDE,
    BEYOND,
    LAST,
    LISTS,
    MAIN,
    SHOWN,
    SPRINGS,
    SUMS,
    Group,
    Stage,
    Step,
)

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver


def step_groups(solver: Solver, level: int | None = None) -> list[Group]:
    """The stages of a step in their order, or those of a substep that computes elements up to a level."""
    rates = solver.model.rates
    common = level is None or rates is None or level >= rates.common
    return [
        _frames(solver),
        _forces(solver, level, common),
        _energies(solver),
        _sums(solver),
        _advance(solver, level, common),
        _follow(solver, common),
        _motion(solver),
    ]


def chain_groups(solver: Solver, level: int, chain: int) -> tuple[list[Group], list[Group]]:
    """Stages of one chain in a substep that computes elements up to a level: (its forces; what moves its nodes).

    They record nothing.
    """
    assert solver.model.rates
    common = chain == solver.model.rates.common
    return (
        [_forces(solver, level, common, chain)],
        [_advance(solver, level, common, chain), _follow(solver, common)],
    )


def _forces(solver: Solver, level: int | None, common: bool, chain: int | None = None) -> Group:
    """Forces on nodes, and what couplings need of their places.

    Elements go before contact: blocks of threads that find a multiprocessor at rest divide its memory as they want it,
    and patches want another division than contact.
    """
    work = solver.work
    active = [e for e in solver.elements if level is None or e.parts(level, chain)]
    found = [Stage("element forces", lambda s, e=e: e.launch(work, s.state, s.split, level, chain)) for e in active]
    if common:
        found += _contact(solver)
    if common and solver.couplings.count:
        found.append(Stage("couplings: responses", solver.couplings.find_responses, ASIDE))
    return [
        *found,
        Stage("next record", solver.records.next_row, BESIDE, only_records=True),
        Stage("displacements kept", lambda s: work.keep(s.state), BESIDE, only_records=True),
        *(_late_search(solver) if common else []),
    ]


def _contact(solver: Solver) -> Group:
    """Contact of each pass, after the search or ahead of it."""
    work, dt = solver.work, solver.nodes.dt

    def search(step: Step) -> None:
        for contact in solver.contacts if step.search == "before" else []:
            contact.search(work, step.state)

    passes = [Stage("contact", lambda s, c=c: c.launch(work, s.state, dt, s.split), BEYOND) for c in solver.contacts]
    return [Stage("search before contact", search, BEYOND, only_records=True), *passes] if passes else []


def _late_search(solver: Solver) -> Group:
    """Search while nodes move, for the steps that follow."""
    if not solver.contacts:
        return []

    work = solver.work

    def boxes(step: Step) -> None:
        for contact in solver.contacts if step.search == "after" else []:
            contact.find_boxes(work, work.at_record(step.state))

    def lists(step: Step) -> None:
        for contact in solver.contacts if step.search == "after" else []:
            contact.list_faces(work, step.state, work.at_record(step.state))

    return [
        Stage("boxes of faces", boxes, LISTS, only_records=True, after=(BESIDE,)),
        Stage("search after contact", lists, LISTS, only_records=True, after=(BEYOND,)),
    ]


def _energies(solver: Solver) -> Group:
    """Stresses and energies at t(n); a GPU takes them from the displacements that were kept, while nodes move."""
    work = solver.work

    def stress(step: Step) -> None:
        if solver.output and step.is_row:
            solver.output.before_step(step.state, step.needs)

    energies = [
        Stage(
            "element energies",
            lambda s, e=e: e.energies(work, s.state, s.split, work.at_record(s.state)),
            SUMS,
            only_records=True,
        )
        for e in solver.elements
    ]
    return [
        *energies,
        Stage("paths, frames: stress", stress, SHOWN, only_records=True),
        Stage("places, sections", lambda s: solver.sensors.before_step(s), BESIDE, only_records=True),
    ]


def _sums(solver: Solver) -> Group:
    """Sums over springs and elements, and what is shown of springs and of stresses at the corners of elements."""
    records = solver.records

    def points(step: Step) -> None:
        if solver.output and step.is_row:
            solver.output.contact_points(step.state, step.needs)

    def nodal(step: Step) -> None:
        if solver.output and step.is_row:
            solver.output.nodal_stress(step.needs)

    springs = [
        Stage("spring sums", lambda s, c=c: records.sum_springs(s, c), SPRINGS, only_records=True)
        for c in solver.contacts
    ]
    return [
        Stage("frames: contact", points, only_records=True),
        Stage("element sums", records.sum_elements, SUMS, only_records=True),
        *springs,
        Stage("paths, frames: nodal stress", nodal, LAST, only_records=True, after=(SHOWN,)),
    ]


def _advance(solver: Solver, level: int | None, common: bool, chain: int | None = None) -> Group:
    """Stages that move nodes, those up to a level or all; `common` tells that contact and joints act now."""
    nodes, found = solver.nodes, []
    if common and solver.constraints.count:
        found.append(Stage("joints, driven nodes", lambda s: nodes.advance_bound(s, level), BESIDE))
    if common and len(solver.constraints.rails):
        found.append(Stage("sliders on rails", nodes.slide, BESIDE))
    if common and solver.couplings.count:
        found.append(Stage("couplings", solver.couplings.couple, BESIDE))
    if common and solver.model.bases:
        found.append(Stage("bases", solver.loads.move_bases, BESIDE))
    if len(solver.absorbing.active(level, chain)):
        found.append(Stage("absorbing boundaries", lambda s: solver.absorbing.advance(s, level, chain), BESIDE))
    if common and solver.rigid.count:
        found.append(Stage("rigid bodies", lambda s: solver.rigid.advance(s, level), BESIDE))
    if common and solver.ties.count:
        found.append(Stage("masters of ties", lambda s: solver.ties.advance(s, level), BESIDE))
    return [*found, Stage("free nodes", lambda s: nodes.advance(s, level, chain))]


def _follow(solver: Solver, common: bool) -> Group:
    """Stages that follow when nodes have moved."""
    dt = solver.nodes.dt
    found = [Stage("slaves of ties", solver.ties.follow)] if common and solver.ties.count else []
    if common and solver.model.hinge_loads:
        found.append(Stage("joint torques", lambda s: solver.loads.torques(s.state, dt, dt)))
    if solver.nodes.rated:
        found.append(Stage("velocities kept", lambda s: solver.nodes.end_record(s.state), only_records=True))
    return found


def _motion(solver: Solver) -> Group:
    """Sums over nodes and velocities at t(n), from those half a step before and after it.

    Where nodes have kept all that the sums read, these may go on beside later steps.
    """
    kept = solver.nodes.rated and not solver.constraints.driven

    def after(step: Step) -> None:
        if solver.output and step.is_row:
            solver.output.after_step(step.state, step.needs)
        solver.sensors.after_step(step)

    motion = [
        Stage(
            "motion sums",
            lambda s: solver.records.sum_motion(s, solver.constraints, solver.nodes),
            LAST if kept else MAIN,
            only_records=True,
        ),
        Stage("frames: velocity", after, only_records=True),
    ]
    if solver.loads.kernels():
        motion.append(Stage("joint and base sums", solver.loads.sums, only_records=True))
    return [*motion, *solver.absorbing.record_stages(solver.records)]


def _frames(solver: Solver) -> Group:
    """Displacements in floating frames, which follow their bodies.

    They do not go with the forces, because contact would begin before the elements.
    """
    if not solver.floating.count:
        return []
    return [
        Stage("floating frames", solver.floating.follow, only_records=True),
        Stage("nodes in floating frames", solver.floating.see),
    ]
