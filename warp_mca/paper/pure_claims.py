"""Owns the claims of Table 2 and Fig. 9: rigid links until the touch beside finite elements alone."""

from __future__ import annotations

from warp_mca.paper.claims import Claim, Found, Words
from warp_mca.paper.evidence import Evidence, MissingRunError
from warp_mca.paper.table_2 import enough


def peak(evidence: Evidence) -> Found:
    """The first peak, as a share of that of finite elements alone.

    Raises:
        MissingRunError: they were not run.
    """
    ratio = evidence.comparison()["mca"]["ratio"].get("F_n_first_peak")
    if ratio is None:
        raise MissingRunError("F_n has no peak")
    return Words(f"{100 * ratio:.2f} %", abs(ratio - 1.0) <= 0.015)


def cost(evidence: Evidence) -> Found:
    """The cost, with an impact that ends by its event, as a share of that of finite elements alone.

    Raises:
        MissingRunError: they were not run.
    """
    event = enough(evidence.comparison())
    if event is None:
        return Words("no open time of 1 ms or less suffices", False)
    ratio, steps = event["ratio"]["cost_total"], event["ratio"]["n_steps"]
    said = f"the impact ends {1e3 * event['open_time']:g} ms after its contact, and finite elements alone see no other"
    return Words(f"{100 * ratio:.3f} %, of steps {100 * steps:.3f} %: {said}", ratio <= 0.00705)


def configuration(evidence: Evidence) -> Found:
    """How far the links are from where rigid links are, at most, before contact.

    Raises:
        MissingRunError: they were not run.
    """
    error = evidence.comparison()["configuration_error"]
    return Words(f"{error:.1e} of the links' length", error < 0.005)


PURE: tuple[Claim, ...] = (
    Claim(
        "fem_peak",
        "Table 2",
        "first peak over that of pure finite elements",
        "98.5 %",
        peak,
    ),
    Claim(
        "fem_cost",
        "Table 2",
        "cost over that of pure finite elements",
        "0.705 %",
        cost,
        reason="rows, searches and the start of the impact cost more beside the steps of a small mesh",
    ),
    Claim(
        "fem_motion",
        "Fig. 9a",
        "angles differ from pure finite elements by less than 0.5 %",
        "< 0.5 %",
        configuration,
    ),
)
