"""Owns the order of a time step: central differences from u(n), v(n-1/2) to u(n+1), v(n+1/2).

docs/architecture.md lists the stages that actors have in each of its parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

from warp_mca.system.actor import Actor, When

if TYPE_CHECKING:
    from warp_mca.system.model import Model
    from warp_mca.system.stage import Group

# Places of stages in their order. Those of a line may overlap on a GPU where they stand in different streams; one line
# follows the other. Elements do not go with the frames that they compute in, because contact would begin before them,
# and they go before contact: blocks of threads that find a multiprocessor at rest divide its memory as they want it,
# and patches want another division than contact.
STEP: tuple[tuple[str, ...], ...] = (
    ("frames",),  # u(n) in frames that float with bodies
    ("forces", "keep", "search"),  # f(n) of elements, contacts and loads at u(n), v(n-1/2); what records read later
    ("energies",),  # at t(n), from what was kept: a GPU goes on with the nodes beside them
    ("look", "sums", "picture", "damp"),  # what recorders show of springs, whose sums then begin anew; stresses at
    # nodes; forces of damping, which follow from those of elements
    ("advance",),  # v(n+1/2) = v(n-1/2) + dt f(n) / m, u(n+1) = u(n) + dt v(n+1/2)
    ("follow", "correct"),  # nodes that others carry; torques in joints, on the velocities that all else gave
    ("motion", "works"),  # sums at t(n), from velocities half a step before and after it
)
FORCES, MOTION = slice(1, 2), slice(4, 6)
_RANK = {place: rank for rank, place in enumerate(chain.from_iterable(STEP))}


def step_groups(actors: Sequence[Actor], when: When) -> list[Group]:
    """The stages of a step in their order; those of one place in the order of the actors.

    Raises:
        KeyError: a stage has a place that STEP has not.
    """
    stages = sorted((s for actor in actors for s in actor.stages(when)), key=lambda stage: _RANK[stage.place])
    return [[stage for stage in stages if stage.place in group] for group in STEP]


def substep(model: Model, level: int) -> When:
    """A substep that computes elements up to a level."""
    return When(level, None, model.rates is None or level >= model.rates.common)


def chain_groups(actors: Sequence[Actor], model: Model, level: int, own: int) -> tuple[list[Group], list[Group]]:
    """Stages of the chain `own` in a substep that computes elements up to a level: (its forces; what moves its nodes).

    They record nothing.
    """
    assert model.rates
    groups = step_groups(actors, When(level, own, own == model.rates.common))
    return groups[FORCES], groups[MOTION]
