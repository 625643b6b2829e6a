"""Owns the claims of Sect. 3.4.3: Figs. 16 to 18 and Table 3, stiffness of the tip, the rods' bodies and both."""

from __future__ import annotations

from warp_mca.paper import readings as read
from warp_mca.paper import word_checks as check
from warp_mca.paper.claims import Claim

_SOFT = "these runs take penalty 1; the contact's springs decide: the table of durations has what others give"
_LIGHT = (
    "from 1 ms on ours presses with a hundredth of its peak between three compressions, and when it parts hangs on the "
    "mesh and the hinge: at 1.79 ms with 1,408 elements, with pins at 1.68"
)
_STICK = (
    "ours counts the time in which sticking nodes carry half of the normal force; the paper gives no numbers, and says "
    "that “compliances increase” both of stiffer and of softer bodies: its durations fall as they increase"
)


def _compliance(study: str, figure: str, soft: float, stiff: float, reason: str = _SOFT) -> tuple[Claim, ...]:
    what = {"tip": "tip", "body": "rod body", "rod": "whole rod"}[study]
    return (
        Claim(
            f"{study}_trend",
            f"Fig. {figure}",
            f"the impact gets shorter as the {what} gets stiffer",
            "falls",
            check.trend(study, read.event_duration, "ms", rises=False),
        ),
        Claim(
            f"{study}_soft",
            f"Fig. {figure}",
            f"duration of the impact with a {what} of 0.7 GPa, succession collisions included",
            soft,
            check.of(study, 0.7, read.event_duration),
            "ms",
            0.12,
            reason,
        ),
        Claim(
            f"{study}_stiff",
            f"Fig. {figure}",
            f"duration of the impact with a {what} of 7000 GPa",
            stiff,
            check.of(study, 7000.0, read.event_duration),
            "ms",
            0.12,
            _SOFT,
        ),
    )


COMPLIANCE: tuple[Claim, ...] = (
    *_compliance("tip", "16", 1.0, 0.33),
    *_compliance("body", "17", 1.39, 0.22),
    *_compliance("rod", "18", 1.57, 0.14, _LIGHT),
    Claim(
        "body_succession",
        "Fig. 17",
        "succession collisions with a soft body",
        "several contacts",
        check.succession("body"),
    ),
    Claim(
        "rod_succession",
        "Fig. 18",
        "succession collisions with a soft rod",
        "several contacts",
        check.succession("rod"),
        reason="contacts are counted at 7 GPa or less; ours may stay in one long contact",
    ),
    Claim(
        "body_compressions",
        "Sect. 3.4.3",
        "several compressions with a rod body of 70 GPa or less",
        "several",
        check.many_compressions,
        reason="at 70 GPa the second one hangs on the hinge",
    ),
    Claim(
        "tip_stick",
        "Sect. 3.4.3",
        "a stiffer tip sticks more easily",
        "stiffer: more",
        check.sticking("tip", rises=True),
        reason=_STICK,
    ),
    Claim(
        "body_stick",
        "Sect. 3.4.3",
        "a stiffer body slips more easily",
        "stiffer: less",
        check.sticking("body", rises=False),
        reason=_STICK,
    ),
)
