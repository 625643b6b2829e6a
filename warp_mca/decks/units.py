"""Owns the systems of units of decks, and exact conversion to SI."""

from __future__ import annotations

import math
from decimal import Decimal

from warp_mca.base.errors import bad_value

UNITS = {
    **{"SI": (0, 0, 0), "t-mm-s": (3, -3, 0), "kg-mm-ms": (0, -3, -3), "g-mm-ms": (-3, -3, -3)},
    "g-cm-us": (-3, -2, -6),  # stresses in Mbar
}
"""Powers of ten of the units of mass [kg], length [m] and time [s] by the name of the system."""

_QUANTITIES = {  # powers of mass, length and time in what cards hold
    "number": (0, 0, 0),
    "length": (0, 1, 0),
    "time": (0, 0, 1),
    "rate": (0, 0, -1),
    "velocity": (0, 1, -1),
    "slowness": (0, -1, 1),
    "acceleration": (0, 1, -2),
    "density": (1, -3, 0),
    "stress": (1, -1, -2),
    "heat capacity": (0, 2, -2),
}


class Units:
    """A system of units.

    Args:
        name: out of UNITS.

    Raises:
        RequestError: there is no such system.
    """

    def __init__(self, name: object) -> None:
        if not isinstance(name, str) or name not in UNITS:
            raise bad_value("units", name, f"decks name none; give {', '.join(UNITS)}")
        self._powers = UNITS[name]

    def power(self, quantity: str) -> int:
        """The power of ten by which a quantity becomes one in SI units."""
        return sum(own * unit for own, unit in zip(_QUANTITIES[quantity], self._powers, strict=True))

    def si(self, value: float, quantity: str) -> float:
        """A value in SI units, rounded once: 7.85e-9 t/mm^3 is 7850 kg/m^3."""
        power = self.power(quantity)
        return float(Decimal(repr(value)).scaleb(power)) if power and math.isfinite(value) else value

    @property
    def length(self) -> float:
        """Metres for one unit of length."""
        return 10.0 ** self._powers[1]
