"""Owns what a claim of the paper is, and how ours is put beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from warp_mca.paper.evidence import Evidence, MissingRunError, Runs
from warp_mca.paper.studies import MESH, PENALTY

NOT_RUN = "not run at this level"


@dataclass(frozen=True)
class Words:
    """Ours where the claim is not a number: what was found, and whether it is what the paper says."""

    text: str
    agrees: bool


Found = float | Words


@dataclass(frozen=True)
class Claim:
    """One thing that the paper says.

    Attributes:
        id: of the claim.
        source: where the paper says it.
        what: the claim, in words.
        paper: the published value, a number in `unit`, or words.
        ours: takes it from the runs of one variant, in `unit`; None: no run gives it yet.
        unit: of `paper` and `ours`.
        tolerance: greatest relative difference that counts as agreement; of claims with a number.
        reason: why ours differs, where that is known.
    """

    id: str
    source: str
    what: str
    paper: float | str
    ours: Callable[[Evidence], Found] | None
    unit: str = ""
    tolerance: float = 0.05
    reason: str = ""


@dataclass(frozen=True)
class Verdict:
    """A claim beside ours.

    Attributes:
        claim: of the paper.
        ours: a number in the claim's unit, or words; None if no run gives it.
        agrees: None where ours is missing.
        why: the reason, in a sentence.
        mesh_change: relative change of ours from the main mesh to the other one; words where ours is words; None where
            it is not known.
        penalty_change: the same from one penalty to another on the other mesh.
    """

    claim: Claim
    ours: float | str | None
    agrees: bool | None
    why: str
    mesh_change: float | str | None = None
    penalty_change: float | str | None = None

    def as_json(self) -> dict[str, object]:
        """The entry of `claims` in paper.json."""
        claim = self.claim
        return {
            "id": claim.id,
            "source": claim.source,
            "what": claim.what,
            "paper": claim.paper,
            "ours": self.ours,
            "unit": claim.unit,
            "agrees": self.agrees,
            "why": self.why,
            "mesh_change": self.mesh_change,
            "penalty_change": self.penalty_change,
        }


def judge(claims: Sequence[Claim], runs: Runs) -> list[Verdict]:
    """Each claim with ours beside it."""
    return [_judged(claim, runs) for claim in claims]


def _judged(claim: Claim, runs: Runs) -> Verdict:
    if claim.ours is None:
        return Verdict(claim, None, None, claim.reason or NOT_RUN)
    try:
        found = claim.ours(Evidence(runs))
    except MissingRunError as missing:
        return Verdict(claim, None, None, str(missing))
    coarse, softer = (_try(claim, Evidence(runs, variant)) for variant in (MESH, PENALTY))
    agrees, why = _compared(claim, found)
    changes = _change(found, coarse), _change(coarse, softer)
    why += _doubt(claim, changes)
    ours = found.text if isinstance(found, Words) else found
    return Verdict(claim, ours, agrees, why, *changes)


def _try(claim: Claim, evidence: Evidence) -> Found | None:
    try:
        return claim.ours(evidence) if claim.ours else None
    except MissingRunError:
        return None


def _compared(claim: Claim, found: Found) -> tuple[bool, str]:
    """Whether ours agrees, and why that is said."""
    if isinstance(found, Words):
        agrees = bool(found.agrees)  # numpy has truth values of its own
        why = "as the paper says" if agrees else "not as the paper says"
    else:
        assert not isinstance(claim.paper, str), claim.id
        difference = found / claim.paper - 1.0
        agrees = abs(difference) <= claim.tolerance
        why = f"{100 * difference:+.1f} %, {'within' if agrees else 'beyond'} {100 * claim.tolerance:g} %"
    return agrees, why if agrees or not claim.reason else f"{why}: {claim.reason}"


def _doubt(claim: Claim, changes: Sequence[float | str | None]) -> str:
    """What to add where the mesh or the penalty changes ours by more than the tolerance, or turns words round."""
    moved = [
        name
        for name, change in zip(("mesh", "penalty"), changes, strict=True)
        if (abs(change) > claim.tolerance if isinstance(change, float) else change not in (None, "same"))
    ]
    return f"; unsure, as another {' or '.join(moved)} changes it" if moved else ""


def _change(first: Found | None, second: Found | None) -> float | str | None:
    """From the first to the second: a share, or the words of the second where they change."""
    if isinstance(first, Words) and isinstance(second, Words):
        return "same" if bool(first.agrees) == bool(second.agrees) else second.text
    if isinstance(first, float) and isinstance(second, float) and first != 0.0:
        return second / first - 1.0
    return None
