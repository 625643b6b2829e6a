"""Owns where a run records motion and force over time: probes at points or node sets, sections through bodies."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3

SAMPLES = 10.0  # sampling rate over the channel frequency class at least, SAE J211-1
MOST_SAMPLES = 1e6  # from which on the coefficients of the filter lose their digits


def check_class(field: str, cfc: float, interval: float, slack: float = 1.0) -> None:
    """Refuse a channel frequency class [Hz] that rows at an interval [s] are too few or too many for.

    Raises:
        RequestError: so it is.
    """
    samples = 1.0 / (interval * cfc) if interval * cfc > 0.0 else MOST_SAMPLES
    if samples * slack < SAMPLES:
        remedy = f"SAE J211 wants {SAMPLES:g} rows in 1 / cfc: take an output_interval of {0.1 / cfc:.3g} s at most"
        raise bad_value(field, cfc, f"rows every {interval:.3g} s are too few; {remedy}")
    if samples >= MOST_SAMPLES:
        raise bad_value(field, cfc, f"there would be {samples:.2g} rows in 1 / cfc; take a greater class, as 60 Hz")


@dataclass(frozen=True, kw_only=True)
class Probe:
    """A point or a node set of a body whose position, velocity and acceleration are recorded.

    Attributes:
        name: unique among probes and sections.
        body: that it belongs to.
        at: point in the body's frame [m], which moves with the element around it; or None.
        nodes: node set, in place of `at`: the motion is that of the mass centre of its nodes.
        cfc: channel frequency class of SAE J211, as 60, 180, 600 or 1000 [Hz], by which the acceleration is filtered
            besides; None for the raw one alone.
    """

    name: str
    body: str
    at: Vec3 | None = None
    nodes: str | None = None
    cfc: float | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Probe", name=self.name)
        validate.texts(self.title, body=self.body)
        if (self.at is None) == (self.nodes is None):
            raise bad_value(f"{self.title}.at", self.at, "give either a point by at=(x, y, z) or a node set by nodes=")
        if self.at is not None:
            validate.vectors(self.title, at=self.at)
        if self.nodes is not None:
            validate.texts(self.title, nodes=self.nodes)
        if self.cfc is not None:
            validate.positive(self.title, cfc=self.cfc)

    @property
    def title(self) -> str:
        """How errors call it."""
        return f"Probe {self.name}"


@dataclass(frozen=True, kw_only=True)
class Section:
    """A cut through a body by a plane, whose resultant force and moment are recorded.

    The force is that of the side to which `normal` points on the other one: along `normal` in tension.

    Attributes:
        name: unique among probes and sections.
        body: that is cut.
        at: point of the plane in the body's frame [m].
        normal: of the plane in that frame, of any length [-].
    """

    name: str
    body: str
    at: Vec3
    normal: Vec3

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Section", name=self.name)
        validate.texts(self.title, body=self.body)
        validate.vectors(self.title, at=self.at)
        validate.directions(self.title, normal=self.normal)

    @property
    def title(self) -> str:
        """How errors call it."""
        return f"Section {self.name}"
