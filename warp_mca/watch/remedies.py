"""Owns what helps against an imbalance of energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.model import Model

MEETING = 0.05  # of the master's smallest edge: nodes of both surfaces so near to each other meet
NODES = 4  # that meet, from which on surfaces lie on each other with matching meshes


def imbalance_remedy(model: Model, touched: bool, turned: bool) -> str:
    """What helps: penalty only where contact was touched, float64 only for what `turned` in mixed precision."""
    found = "lower time_step_scale"
    if touched:
        found += " or a contact's penalty"
        if _meet_at_corners(model):
            found = "give the curved contact without friction a mu, or its surfaces meshes whose nodes do not meet"
    if model.rates:
        found += ", take fewer groups in multi_rate"
    if turned:
        found += ", choose --precision float64 for bodies that turn so far"
    return found


def pair_of(model: Model, item: ContactPass) -> str:
    """What a contact keeps apart."""
    if item.pairs is not None:
        return "general contact"

    def body(node: int) -> str:
        return max((first, name) for name, first in model.node_start.items() if first <= node)[1]

    return f"{body(int(item.slave[0]))} on {'a plane' if item.plane is not None else body(int(item.master[0]))}"


def let_go(item: ContactPass) -> str:
    """What helps where springs of a contact between bodies lost energy.

    A node that slides off an edge leaves that of its spring behind, which goes with the square of its depth.
    """
    both = "" if item.pairs is not None else " and give two_way=True"
    cause = "since springs that are pressed deep let go of nodes at edges"
    return f"raise its penalty, as to 10{both}, {cause}, or lower time_step_scale"


def _meet_at_corners(model: Model) -> bool:
    """Whether curved surfaces without friction start with their nodes on each other.

    A node at a corner of facets goes from one to the other and back while it presses; each time its force turns by the
    angle between them, which makes energy at any step. Friction holds it.
    """
    from scipy.spatial import KDTree

    for item in model.passes:
        if item.mu == 0.0 and len(item.face) and item.curved:
            apart, _ = KDTree(model.X[item.master]).query(model.X[item.slave])
            if (np.asarray(apart) < MEETING * np.sqrt(item.smallest_area)).sum() >= NODES:
                return True
    return False
