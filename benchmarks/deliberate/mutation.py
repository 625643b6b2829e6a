"""Owns what a deliberate error is: a change of the engine's text that verification cases must notice."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutation:
    """A deliberate error.

    Attributes:
        what: is wrong then, to end the sentence "fails when …".
        file: that is changed, from the repository's root.
        old: text that stands there once.
        new: what takes its place.
        element: with which the case must be run to notice.
    """

    what: str
    file: str
    old: str
    new: str
    element: str = "hex8"
