"""Owns the materials of a deck: each as the law of this program that it is, in SI units, or refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from warp_mca.decks.cards import Card, Content
from warp_mca.decks.places import Places
from warp_mca.geometry.keyword_text import Keyword
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.failure import JohnsonCookFailure, PlasticStrainFailure
from warp_mca.scene.metals import CowperSymonds, J2Bilinear, J2Table, JohnsonCook

FAR = 10.0  # plastic strain up to which tables go on with their last slope [-]
STRONG = 1e10  # tension beyond which no metal is pulled [Pa]


@dataclass(frozen=True)
class DeckMaterial:
    """A material of a deck.

    Attributes:
        law: in SI units.
        rigid: whether its parts are rigid.
        held: axes along which the centre of mass and about which a rigid part is held, as ("xy", "z").
    """

    law: Elastic
    rigid: bool = False
    held: tuple[str, str] = ("", "")


def materials(content: Content, places: Places) -> dict[tuple[int, int], DeckMaterial]:
    """The materials by their number and that of the equation of state that a part gives, 0 for none.

    Raises:
        ValueError: one is not a law of this program.
    """
    used = {(card.whole("mid"), card.whole("eosid")) for card in _parts(content)}
    eos = {content.card(item, 0, "id").whole("id"): item for item in content.found["eos"]}
    found = {}
    for kind, read in _KINDS.items():
        for item in content.found[kind]:
            number = content.card(item, 0, "mid").whole("mid")
            for state in {state for own, state in used if own == number}:
                if state and kind != "johnson_cook":
                    raise ValueError(f"{item.place}: *{item.name} takes no equation of state; leave it out of *PART")
                if state and state not in eos:
                    raise ValueError(f"{item.place}: there is no *EOS_LINEAR_POLYNOMIAL {state}; add it to the deck")
                try:
                    found[number, state] = read(content, places, item, eos.get(state))
                except ValueError as error:
                    text = str(error)
                    raise ValueError(text if text.startswith("line ") else f"{item.place}: {text}") from error
    return found


def _parts(content: Content) -> list[Card]:
    """The second card of each part."""
    names = "pid secid mid eosid hgid grav adpopt tmid"
    return [
        content.card(item, 2 * k + 1, names)
        for item in content.found["part"]
        for k in range((len(item.lines) + 1) // 2)
        if 2 * k + 1 < len(item.lines)
    ]


def _moduli(card: Card) -> dict[str, Any]:
    return {"E": card.number("e", "stress"), "nu": card.number("pr"), "rho": card.number("ro", "density")}


def _elastic(content: Content, places: Places, item: Keyword, eos: Keyword | None) -> DeckMaterial:
    """*MAT_ELASTIC."""
    return DeckMaterial(Elastic(**_moduli(content.card(item, 0, "mid ro e pr da db k"))))


def _failure(strain: float) -> PlasticStrainFailure | None:
    """A plastic strain at failure; none for 0 and for the large defaults."""
    return PlasticStrainFailure(strain=strain) if 0.0 < strain < 1e6 else None


def _rates(content: Content, item: Keyword, card: Card, names: tuple[str, str]) -> dict[str, Any] | None:
    """C and P of Cowper and Symonds, or None without."""
    C, P = card.number(names[0], "rate"), card.number(names[1])
    if not (C and P):
        return None
    if card.number("vp") != 1.0:
        content.notes.append(
            f"{item.place}: *{item.name} counts rates of total strain (VP = 0), here they are those of plastic strain"
        )
    return {"D": C, "q": P}


def _kinematic(content: Content, places: Places, item: Keyword, eos: Keyword | None) -> DeckMaterial:
    """*MAT_PLASTIC_KINEMATIC: E_p = E E_t / (E - E_t), isotropic by the share beta; rates scale the yield stress."""
    card = content.card(item, 0, "mid ro e pr sigy etan beta")
    more = content.card(item, 1, "src srp fs vp")
    moduli, failure = _moduli(card), _failure(more.number("fs"))
    sigma_y, E_t, beta = card.number("sigy", "stress"), card.number("etan", "stress"), card.number("beta")
    law = J2Bilinear(**moduli, sigma_y=sigma_y, E_t=E_t, beta=beta, failure=failure)
    if rates := _rates(content, item, more, ("src", "srp")):
        if beta != 1.0 and E_t:
            raise ValueError(f"{item.place}: SRC with BETA below 1 is not read: rates go with BETA = 1 here")
        stress = (sigma_y, sigma_y + FAR * law.hardening_modulus)
        table: dict[str, Any] = {"plastic_strain": (0.0, FAR), "stress": stress}
        return DeckMaterial(CowperSymonds(**moduli, **table, **rates, failure=failure))
    return DeckMaterial(law)


def _rigid(content: Content, places: Places, item: Keyword, eos: Keyword | None) -> DeckMaterial:
    """*MAT_RIGID, with constraints along the axes of the world."""
    card = content.card(item, 0, "mid ro e pr n couple m alias")
    card.refuse("n couple m", "couplings to other programs are not made; set it to 0")
    more = content.card(item, 1, "cmo con1 con2")
    held = ("", "")
    if cmo := more.number("cmo"):
        if cmo != 1.0:
            raise ValueError(f"{more.place}: CMO = {cmo:g} is not read: give constraints in the world's axes, CMO = 1")
        held = codes(more.whole("con1")), codes(more.whole("con2"))
    return DeckMaterial(Elastic(**_moduli(card)), rigid=True, held=held)


def codes(code: int) -> str:
    """Axes of a code of constraints.

    Raises:
        ValueError: there is no such code.
    """
    if not 0 <= code <= 7:
        raise ValueError(f"the code {code} of constraints is none; give 0 to 7")
    return ("", "x", "y", "z", "xy", "yz", "xz", "xyz")[code]


def _piecewise(content: Content, places: Places, item: Keyword, eos: Keyword | None) -> DeckMaterial:
    """*MAT_PIECEWISE_LINEAR_PLASTICITY: a curve, or points, or a tangent modulus; last slopes go on."""
    card = content.card(item, 0, "mid ro e pr sigy etan fail tdel")
    more = content.card(item, 1, "c p lcss lcsr vp")
    card.refuse("tdel", "elements fail by strain; set it to 0")
    more.refuse("lcsr", "give rates by C and P")
    if card.number("fail") < 0.0:
        raise ValueError(f"{card.place}: FAIL below 0 is not read: give the plastic strain at failure, or 0")
    moduli, failure = _moduli(card), _failure(card.number("fail"))
    sigma_y = card.number("sigy", "stress")
    rates = _rates(content, item, more, ("c", "p"))
    if rates and more.number("vp") == 1.0 and sigma_y:
        raise ValueError(f"{more.place}: VP = 1 adds SIGY (rate / C)^(1 / P), which is not read; set SIGY = 0")
    names = [" ".join(f"{name}{k}" for k in range(1, 9)) for name in ("eps", "es")]
    points = content.card(item, 2, names[0]), content.card(item, 3, names[1])
    if curve := more.whole("lcss"):
        strains, stresses = places.curve(curve)
        stresses = [content.units.si(stress, "stress") for stress in stresses]
    elif any(points[1].numbers(names[1])):
        strains, stresses = points[0].numbers(names[0]), points[1].numbers(names[1], "stress")
        count = max(k for k in range(8) if stresses[k]) + 1
        strains, stresses = strains[:count], stresses[:count]
    else:
        law = J2Bilinear(**moduli, sigma_y=sigma_y, E_t=card.number("etan", "stress"), beta=1.0, failure=failure)
        if not rates:
            return DeckMaterial(law)
        strains, stresses = [0.0, FAR], [sigma_y, sigma_y + FAR * law.hardening_modulus]
    if len(strains) > 1 and strains[-1] < FAR and stresses[-1] != stresses[-2]:
        slope = (stresses[-1] - stresses[-2]) / (strains[-1] - strains[-2])
        stresses, strains = [*stresses, stresses[-1] + slope * (FAR - strains[-1])], [*strains, FAR]
    more_points: dict[str, Any] = {"plastic_strain": tuple(strains), "stress": tuple(stresses)}
    if rates:
        return DeckMaterial(CowperSymonds(**moduli, **more_points, **rates, failure=failure))
    return DeckMaterial(J2Table(**moduli, **more_points, failure=failure))


def _johnson_cook(content: Content, places: Places, item: Keyword, eos: Keyword | None) -> DeckMaterial:
    """*MAT_JOHNSON_COOK; all plastic work becomes heat. D3 of either sign makes tension worse, as other readers do.

    Bulk modulus: C1 of *EOS_LINEAR_POLYNOMIAL, else that of E and PR.
    """
    card = content.card(item, 0, "mid ro g e pr dtf vp rateop")
    a = content.card(item, 1, "a b n c m tm tr epso")
    b = content.card(item, 2, "cp pc spall it d1 d2 d3 d4")
    c = content.card(item, 3, "d5 c2 erod efmin")
    card.refuse("dtf rateop", "set it to 0, for the law of 1983 without deletion by time step")
    c.refuse("c2", "leave it out, for the law of 1983")
    if abs(b.number("pc", "stress")) not in (0.0, math.inf) and abs(b.number("pc", "stress")) < STRONG:
        raise ValueError(f"{b.place}: PC is not read: tension is not cut off here; set it to 0")
    G = card.number("g", "stress")
    E, nu = card.number("e", "stress"), card.number("pr")
    if eos is not None:
        K = _bulk_modulus(content, eos)
        E, nu = 9.0 * K * G / (3.0 * K + G), (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
    elif not E and 0.0 < nu < 0.5:
        E = 2.0 * G * (1.0 + nu)
    elif not nu and G:
        nu = E / (2.0 * G) - 1.0
    D = b.numbers("d1 d2 d3 d4")
    failure = None
    rate_0 = a.number("epso", "rate") or content.units.si(1.0, "rate")
    if any(D):
        c.refuse("erod", "points that fail are removed with their element; set it to 0")
        least = c.number("efmin") or 1e-6
        more = {"D1": D[0], "D2": D[1], "D3": -abs(D[2]), "D4": D[3], "D5": c.number("d5")}
        failure = JohnsonCookFailure(**more, rate_0=rate_0, least_strain=least)
    law = JohnsonCook(
        E=E,
        nu=nu,
        rho=card.number("ro", "density"),
        A=a.number("a", "stress"),
        B=a.number("b", "stress"),
        n=a.number("n"),
        C=a.number("c"),
        m=a.number("m"),
        T_melt=a.number("tm"),
        T_room=a.number("tr"),
        c_p=b.number("cp", "heat capacity"),
        rate_0=rate_0,
        beta=1.0,
        failure=failure,
    )
    return DeckMaterial(law)


def _bulk_modulus(content: Content, item: Keyword) -> float:
    """C1 of *EOS_LINEAR_POLYNOMIAL [Pa], where nothing but it and C0 = 0 is given."""
    card = content.card(item, 0, "id c0 c1 c2 c3 c4 c5 c6")
    card.refuse("c0 c2 c3 c4 c5 c6", "pressure is linear here; set it to 0")
    more = content.card(item, 1, "e0 v0")
    more.refuse("e0", "pressure follows volume alone here; set it to 0")
    if more.number("v0", default=1.0) not in (0.0, 1.0):
        raise ValueError(f"{more.place}: V0 is not read: volumes begin at 1; leave it out")
    return card.number("c1", "stress")


_KINDS: dict[str, Callable[[Content, Places, Keyword, Keyword | None], DeckMaterial]] = {
    "elastic": _elastic,
    "kinematic": _kinematic,
    "rigid": _rigid,
    "piecewise": _piecewise,
    "johnson_cook": _johnson_cook,
}
