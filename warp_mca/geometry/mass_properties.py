"""Owns the check of the mass, the centre and the inertia that a user gives a rigid body."""

from __future__ import annotations

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value

FLATTEST = 1e-6  # by which two principal inertias may fall short of the third, as a share of it: files round them
SQUARE = 1e-9  # difference of opposite entries, as a share of the greatest
LIGHTEST, HEAVIEST = 1e-15, 1e15  # masses that may be given [kg]
SMALLEST, LARGEST = 1e-30, 1e30  # principal inertias that may be given [kg m^2]
Matrix = tuple[tuple[float, ...], ...]


def inertia_matrix(owner: str, inertia: object) -> Matrix:
    """The inertia as three rows [kg m^2], where it is given so or by three principal values.

    Raises:
        RequestError: it is no inertia of a body: not symmetric, not positive, or one principal value exceeds the sum of
            the others.
    """
    field = f"{owner}.inertia"
    shape = "give three principal values or a 3 x 3 matrix of finite numbers, in kg m^2"
    try:
        found = np.array(inertia, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise bad_value(field, validate.brief(inertia), shape) from error
    found = np.diag(found) if found.shape == (3,) else found
    if found.shape != (3, 3) or not np.isfinite(found).all():
        raise bad_value(field, inertia, shape)
    if np.abs(found - found.T).max() > SQUARE * np.abs(found).max():
        raise bad_value(field, inertia, "it is not symmetric; give equal entries across its diagonal")
    found = 0.5 * (found + found.T)
    low, middle, high = np.linalg.eigvalsh(found)
    if high > LARGEST or 0.0 < low < SMALLEST:
        raise bad_value(field, inertia, f"give principal values from {SMALLEST:g} to {LARGEST:g} kg m^2")
    if low <= 0.0:
        raise bad_value(field, inertia, f"its least principal value is {low:.4g}; give one above 0")
    if low + middle < (1.0 - FLATTEST) * high:
        what = f"its principal values {low:.4g}, {middle:.4g} and {high:.4g} break the triangle inequality"
        raise bad_value(field, inertia, f"{what}; no body has one above the sum of the others, check it")
    return tuple(tuple(float(x) for x in row) for row in found)
