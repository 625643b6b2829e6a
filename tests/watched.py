"""What rows of the table of warnings look at, made up for tests: they need no run."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from warp_mca.results.contact_history import ContactHistory
from warp_mca.watch import histories
from warp_mca.watch.row import Row


def told(row: Row, **facts: Any) -> list[str]:
    """What a row says where only these `facts` are known."""
    return row.told(SimpleNamespace(**facts))


def of_contacts(
    contacts: Sequence[ContactHistory], axes: np.ndarray | None = None, held: Sequence[int] = ()
) -> list[str]:
    """What rows about histories of contacts say, with axes as `Model.contact_axes` has them.

    `held`: of the slave's nodes of the first contact, the axes along which they are fixed as bits.
    """
    passes = [SimpleNamespace(contact=0, sign=1.0, slave=np.arange(len(held)))] if held else []
    axes = np.zeros((len(contacts), 2, 3)) if axes is None else axes
    model = SimpleNamespace(contact_axes=axes, passes=passes, fixed_axes=np.array(held, dtype=np.int32))
    rows = [row for row in vars(histories).values() if isinstance(row, Row)]
    return [text for row in rows for text in told(row, contacts=contacts, model=model)]
