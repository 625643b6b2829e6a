"""Materials of decks: each card gives the law with its equations, in SI units, or is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_decks import deck, read

import warp_mca as mca

STEEL: dict[str, Any] = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
HEAD = "7,7.85e-9,2.1e5,0.3"
H = 210e9 * 1e9 / 209e9  # hardening modulus of E_t = 1 GPa [Pa]
JOHNSON = "*MAT_JOHNSON_COOK\n7,8.96e-9,46000,124000,0.34,0,0,0\n90,292,0.31,0.025,1.09,1356,293,1.\n3.83e8,0,2,0,"
COPPER: dict[str, Any] = {
    **{"E": 124e9, "nu": 0.34, "rho": 8960.0, "A": 90e6, "B": 292e6, "n": 0.31, "C": 0.025, "m": 1.09},
    **{"T_melt": 1356.0, "T_room": 293.0, "c_p": 383.0, "beta": 1.0},
}


def law(tmp_path: Path, cards: str, more: str = "") -> mca.Elastic:
    """Law of the first part of a deck with these cards."""
    material = read(tmp_path, deck("commas", more, cards)).bodies[0].material
    assert isinstance(material, mca.Elastic)
    return material


@pytest.mark.parametrize(
    ("cards", "wanted"),
    [
        (f"*MAT_ELASTIC\n{HEAD}\n", mca.Elastic(**STEEL)),
        (
            f"*MAT_003\n{HEAD},250,1000,1.\n0,0,0.4\n",
            mca.J2Bilinear(**STEEL, sigma_y=250e6, E_t=1e9, beta=1.0, failure=mca.PlasticStrainFailure(strain=0.4)),
        ),
        (
            f"*MAT_PLASTIC_KINEMATIC_TITLE\nsteel\n{HEAD},250,1000,1.\n40.4,5.,0,1\n",
            mca.CowperSymonds(**STEEL, plastic_strain=(0.0, 10.0), stress=(250e6, 250e6 + 10.0 * H), D=40.4, q=5.0),
        ),
        (
            f"*MAT_024\n{HEAD},250,1000,0.2\n",
            mca.J2Bilinear(**STEEL, sigma_y=250e6, E_t=1e9, beta=1.0, failure=mca.PlasticStrainFailure(strain=0.2)),
        ),
        (
            f"*MAT_PIECEWISE_LINEAR_PLASTICITY\n{HEAD}\n40,5\n0,.1,.5\n250,300,340\n",
            mca.CowperSymonds(
                **STEEL,
                plastic_strain=(0.0, 0.1, 0.5, 10.0),
                stress=(250e6, 300e6, 340e6, 1290e6),
                D=40.0,
                q=5.0,
            ),
        ),
        (
            f"*MAT_024\n{HEAD}\n0,0,9\n*DEFINE_CURVE\n9,0,1,2.\n0,125.\n.1,150.\n.5,150.\n",
            mca.J2Table(**STEEL, plastic_strain=(0.0, 0.1, 0.5), stress=(250e6, 300e6, 300e6)),
        ),
        (f"{JOHNSON}0\n", mca.JohnsonCook(**COPPER)),
        (
            f"{JOHNSON}.54,4.89,3.03,.014\n1.12,,,0.01\n",
            mca.JohnsonCook(
                **COPPER,
                failure=mca.JohnsonCookFailure(D1=0.54, D2=4.89, D3=-3.03, D4=0.014, D5=1.12, least_strain=0.01),
            ),
        ),
    ],
)
def test_a_card_gives_the_law(tmp_path: Path, cards: str, wanted: mca.Elastic):
    assert law(tmp_path, cards) == wanted


def test_the_bulk_modulus_may_come_from_an_equation_of_state(tmp_path: Path):
    """K = 140 GPa and G = 46 GPa: E = 9 K G / (3 K + G)."""
    text = deck("commas", "*EOS_LINEAR_POLYNOMIAL\n3,0,140000\n0,1.\n", f"{JOHNSON}0\n")
    found = read(tmp_path, text.replace("hammer\n2, 1, 7\n", "hammer\n2, 1, 7, 3\n")).bodies[1].material
    assert isinstance(found, mca.JohnsonCook)
    assert (found.bulk_modulus, found.shear_modulus) == pytest.approx((140e9, 46e9))


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        (f"*MAT_003\n{HEAD},250,1000,.5\n40,5\n", r"line \d+: SRC with BETA below 1 is not read"),
        (f"*MAT_003\n{HEAD},-250\n0\n", r"line \d+: J2Bilinear.sigma_y = -250000000.0"),
        (f"*MAT_024\n{HEAD},250,0,0,1e-9\n", "TDEL = 1e-9 is not read: elements fail by strain; set it to 0"),
        (f"*MAT_024\n{HEAD},250\n40,5,0,0,1.\n", r"VP = 1 adds SIGY \(rate / C\)"),
        (f"*MAT_024\n{HEAD},250\n0,0,99\n", "there is no .DEFINE_CURVE 99; add it to the deck"),
        (f"{JOHNSON.replace('3.83e8,0', '3.83e8,-5.')}0\n", "PC is not read: tension is not cut off here"),
        (f"*MAT_RIGID\n{HEAD}\n-1,4\n", "CMO = -1 is not read"),
        (
            f"*MAT_COMPOSITE_DAMAGE\n{HEAD}\n",
            r"\*MAT_COMPOSITE_DAMAGE \(line \d+\) is not read; write the deck without",
        ),
    ],
)
def test_a_card_of_another_law_is_refused(tmp_path: Path, cards: str, words: str):
    with pytest.raises(mca.RequestError, match=words):
        law(tmp_path, cards)
