"""Owns the number range of mixed precision: elements and moduli outside the range of float32 are refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.geometry.boxes import cell_boxes

if TYPE_CHECKING:
    from warp_mca.system.model import Model


# Elements take the fourth power of lengths and the square of stresses, which float32 holds from 1e-38 to 3e38.
EDGES = 5e-10, 2e9  # mean edge of an element [m]
MODULI = 1e-10, 1e18  # bulk and shear modulus [Pa]
LARGEST = {"mixed": 1e30, "float64": 1e300}  # parameter of a law of flow, far above any stress
REMEDY = "choose --precision float64 (precision='float64'), or other units"


def check_range(model: Model, precision: str) -> None:
    """Raise RequestError for sizes and moduli that mixed precision cannot represent.

    Args:
        model: of one scene.
        precision: "mixed" or "float64".

    Raises:
        RequestError: an element is too small or too large, or a modulus too low or too high.
    """
    if precision != "mixed":
        return
    low, high = MODULI
    for modulus in model.law[:, :2].ravel():
        if not low <= modulus <= high:
            remedy = f"elements in float32 need {low:g} to {high:g} Pa; {REMEDY} of stress"
            raise bad_value("bulk or shear modulus [Pa]", float(modulus), remedy)
    low, high = EDGES
    for block in model.blocks:
        lower, upper = cell_boxes(model.X, block.conn.T)
        edge = np.cbrt(np.prod(upper - lower, axis=0))
        bad = np.flatnonzero((edge < low) | (edge > high))
        if len(bad):
            body, element = model.owner(int(model.element_of[block.first + bad[0]]))
            remedy = f"elements in float32 need edges of {low:g} to {high:g} m; {REMEDY} of length"
            raise bad_value(f"size of element {element} of body {body} [m]", float(f"{edge[bad[0]]:.3g}"), remedy)


def limited(law: Array, precision: str) -> Array:
    """`Model.law` with parameters of flow that `precision` holds: a yield stress of 1e300 Pa says that nothing flows.

    Infinity would not do: its product with a plastic strain of zero is not a number.
    """
    return np.column_stack([law[:, :2], np.minimum(law[:, 2:], LARGEST[precision])])
