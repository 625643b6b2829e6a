"""What rows of the table of warnings look at, made up for tests: they need no run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from impacts import prepared

import warp_mca as mca
from warp_mca.results.contact_history import ContactHistory
from warp_mca.watch import histories
from warp_mca.watch.row import Context, Row

KEPT = {
    "max_strain": 0.0,
    "min_jacobian": 1.0,
    "exchanged": 1.0,
    "energy_scale": 1.0,
    "energy_error": 0.0,
    "imbalance": 0.0,
    "initial_kinetic": 0.0,
    "touched": False,
    "turned": False,
    "count": 0,
    "records": 1,
}


def told(row: Row, **facts: Any) -> list[str]:
    """What a row says where only these `facts` are known."""
    return row.told(SimpleNamespace(**facts))


def ledger(kept: Mapping[str, Any] | None = None, **more: Any) -> SimpleNamespace:
    """A ledger that took in what `kept` says, and nothing worth a word besides."""
    own = {"precision": "mixed", "tolerance": 0.01, "exchanges": True, "exchange_error": 0.0, "remedy": "take care"}
    return SimpleNamespace(kept=SimpleNamespace(**KEPT | dict(kept or {})), **own | more)


def told_of(row: Row, scene: mca.Scene, meshes: Mapping[str, mca.Mesh] | None = None, **facts: Any) -> list[str]:
    """What a row says of a scene before its run, or with `facts` about it."""
    ready = prepared(scene, meshes)
    context = Context(scene=scene, meshes=ready.meshes, model=ready.model)
    still = np.zeros_like(ready.model.X)
    common = {"start": ready.start, "nodes": context.nodes, "u": still, "v": still, "stopped": False}
    common |= {"origin": 0.0, "peaks": {}}
    return told(row, **vars(context), **{"ledger": ledger(), **common, **facts})


def history(pressure: Sequence[float], **more: Any) -> ContactHistory:
    """A contact of which only the normal force is known [N]."""
    none = np.zeros((len(pressure), 3))
    own = {"name": "c", "force": none, "normal_force": none, "closing_speed": none[:, 0]}
    return ContactHistory(pressure=np.array(pressure, dtype=float), **own | more)


def of_contacts(
    contacts: Sequence[ContactHistory], axes: np.ndarray | None = None, held: Sequence[int] = ()
) -> list[str]:
    """What rows about histories of contacts say, with axes as `Model.contact_axes` has them.

    `held`: of the slave's nodes of the first contact, the axes along which they are fixed as bits.
    """
    own = SimpleNamespace(contact=0, sign=1.0, leads=True, bonds=None, internal=False, slave=np.arange(len(held)))
    passes = [own] if held else []
    axes = np.zeros((len(contacts), 2, 3)) if axes is None else axes
    model = SimpleNamespace(contact_axes=axes, passes=passes, fixed_axes=np.array(held, dtype=np.int32))
    rows = [row for row in vars(histories).values() if isinstance(row, Row)]
    return [text for row in rows for text in told(row, contacts=contacts, model=model)]


def pattern(row: Row) -> str:
    """A regular expression for the sentences of a row."""
    import re

    parts = re.split(r"\{[^}]*\}", f"{row.sentence} {row.remedy}".rstrip())
    return ".*".join(map(re.escape, parts))
