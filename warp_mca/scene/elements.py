"""Owns the table of element formulations by the name that `Body.element` gives; `physics/elements/` fills it."""

from __future__ import annotations

from typing import Any

# Of `physics.elements.Element`. The first of a cell type computes cells of that type in bodies whose own element takes
# another type.
ELEMENTS: dict[str, Any] = {}
