"""Owns the check that a contact law with a dashpot says how much it damps, which the stable step needs."""

from __future__ import annotations

from collections.abc import Sequence

from warp_mca.base.errors import bad_value
from warp_mca.kernels.contact.laws import law_functions
from warp_mca.system.contact import ContactPass


def check_dashpots(items: Sequence[ContactPass]) -> None:
    """Check one contact of each scene of a batch.

    Raises:
        RequestError: the law has a dashpot and no damping, or the reverse.
    """
    has = law_functions(items[0].law).dashpot is not None
    for item in items:
        if has != (item.damping > 0.0):
            remedy = "give the greatest slope of the dashpot over k [s]" if has else "its module has no dashpot; give 0"
            raise bad_value("ContactLaw.damping()", item.damping, remedy)
