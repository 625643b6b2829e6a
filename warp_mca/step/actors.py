"""Owns the table of all that acts in a step, in the order in which the stages of each group are launched."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.physics.absorbing.stage import AbsorbingStage
from warp_mca.physics.contact.actor import Contacts
from warp_mca.physics.elements.actor import Elements
from warp_mca.physics.floating.stage import FloatingStage
from warp_mca.physics.joints.constraint_stage import ConstraintStage
from warp_mca.physics.joints.coupling_stage import CouplingStage
from warp_mca.physics.loads.stage import LoadStage
from warp_mca.physics.rigid.stage import RigidStage
from warp_mca.physics.ties.stage import TieStage
from warp_mca.scene.loads import LOADS
from warp_mca.step.node_stage import NodeStage
from warp_mca.step.rated_nodes import node_stage
from warp_mca.step.record_stage import RecordStage
from warp_mca.system.actor import Actor, System

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.model import Model

ACTORS: dict[str, Callable[[Solver], Actor]] = {
    "elements": Elements,
    "contacts": Contacts,
    "constraints": ConstraintStage,
    "couplings": CouplingStage,
    "loads": LoadStage,
    "absorbing": AbsorbingStage,
    "rigid": RigidStage,
    "ties": TieStage,
    "floating": FloatingStage,
    "nodes": node_stage,
    "records": RecordStage,
}


def actors_of(model: Model) -> dict[str, Callable[[Solver], Actor]]:
    """All of ACTORS, and behind them the kinds of loads that a model has.

    Raises:
        RequestError: a kind has the name of one of ACTORS, or does not say its stage.
    """
    for kind in ACTORS.keys() & model.loads.keys():
        raise bad_value("Scene.loads", kind, "the solver has a part of this name; give the class another one")
    stages = {kind: validate.call("Scene.loads", kind, "stage()", LOADS[kind].stage) for kind in model.loads}
    return ACTORS | {kind: partial(stage, name=kind) for kind, stage in stages.items()}


class Made(System):
    """The actors of ACTORS by their names, with their types."""

    elements: Elements
    contacts: Contacts
    constraints: ConstraintStage
    couplings: CouplingStage
    loads: LoadStage
    absorbing: AbsorbingStage
    rigid: RigidStage
    ties: TieStage
    floating: FloatingStage
    nodes: NodeStage
    records: RecordStage
