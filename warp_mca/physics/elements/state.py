"""Owns what elements keep from one step to the next."""

from __future__ import annotations

from dataclasses import dataclass

import warp as wp

from warp_mca.physics.elements.failing import FailureState


@dataclass(eq=False)
class ElementState:
    """State of a block of elements.

    Attributes:
        yielded: not 0 where an element has yielded [-], shape (element_count,), int32; empty where elastic.
        history: history that the law keeps at each integration point [-], as `kernels.materials.laws.Law.history` says,
            point by point, then what the element keeps besides, shape (row_count, element_count), float32 or float64;
            empty where elastic.
        extreme: greatest square of the deviatoric strain and greatest loss of volume 1 - J of any step [-], from 0 on;
            where internal vectors lag behind, the energy that this took [J]; of viscous elements, what
            `kernels.elements.viscosity` lists; shape (row_count, element_count), float32 or float64.
        peak: greatest von Mises stress [Pa] and plastic strain [-] at any record since the start of the impact, and the
            numbers of these, `kernels.records.extremes`, shape (3 or 5, element_count), float32.
        failing: of elements that may fail, `FailureState`; None of others.
    """

    yielded: wp.array
    history: wp.array
    extreme: wp.array
    peak: wp.array
    failing: FailureState | None = None
