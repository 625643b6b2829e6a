"""Owns the library of materials, with published or typical parameters; `mca.library.STEEL_4340` is one as any other.

`SOURCES` says of each where its parameters are from, and for what they were measured. Elastic constants are those of
handbooks where the source has none. Parameters of one's own lot and temper are better than any of these: yield stresses
of one grade differ by 10 to 20 %, moduli of polymers, rubber and foam by more.
Entries that say "typical" or "in common use" have no publication behind them.
"""

from __future__ import annotations

from warp_mca.scene.elastic import Elastic
from warp_mca.scene.foams import CrushableFoam
from warp_mca.scene.metals import CowperSymonds, J2Bilinear, JohnsonCook
from warp_mca.scene.rubbers import NeoHookean, Ogden

_JC83 = (
    "Johnson and Cook, Proc. 7th Int. Symp. Ballistics (1983) 541: torsion to 400 1/s, tension by Hopkinson bar to "
    "some 650 1/s and 900 K, strains to 1 and more"
)

OFHC_COPPER = JohnsonCook(
    E=124e9, nu=0.34, rho=8960.0, A=90e6, B=292e6, n=0.31, C=0.025, m=1.09, T_melt=1356.0, c_p=383.0
)
CARTRIDGE_BRASS = JohnsonCook(
    E=110e9, nu=0.345, rho=8520.0, A=112e6, B=505e6, n=0.42, C=0.009, m=1.68, T_melt=1189.0, c_p=385.0
)
NICKEL_200 = JohnsonCook(
    E=207e9, nu=0.31, rho=8900.0, A=163e6, B=648e6, n=0.33, C=0.006, m=1.44, T_melt=1726.0, c_p=446.0
)
ARMCO_IRON = JohnsonCook(
    E=207e9, nu=0.29, rho=7890.0, A=175e6, B=380e6, n=0.32, C=0.060, m=0.55, T_melt=1811.0, c_p=452.0
)
STEEL_1006 = JohnsonCook(
    E=207e9, nu=0.29, rho=7890.0, A=350e6, B=275e6, n=0.36, C=0.022, m=1.0, T_melt=1811.0, c_p=452.0
)
STEEL_4340 = JohnsonCook(
    E=200e9, nu=0.29, rho=7830.0, A=792e6, B=510e6, n=0.26, C=0.014, m=1.03, T_melt=1793.0, c_p=477.0
)
STEEL_S7 = JohnsonCook(
    E=207e9, nu=0.29, rho=7750.0, A=1539e6, B=477e6, n=0.18, C=0.012, m=1.0, T_melt=1763.0, c_p=477.0
)
ALUMINIUM_2024_T351 = JohnsonCook(
    E=73e9, nu=0.33, rho=2770.0, A=265e6, B=426e6, n=0.34, C=0.015, m=1.0, T_melt=775.0, c_p=875.0
)
ALUMINIUM_7039 = JohnsonCook(
    E=70e9, nu=0.33, rho=2770.0, A=337e6, B=343e6, n=0.41, C=0.010, m=1.0, T_melt=877.0, c_p=875.0
)
ALUMINIUM_6061_T6 = JohnsonCook(
    E=69e9, nu=0.33, rho=2703.0, A=324e6, B=114e6, n=0.42, C=0.002, m=1.34, T_melt=925.0, c_p=896.0
)
ALUMINIUM_7075_T651 = JohnsonCook(
    E=71.7e9, nu=0.33, rho=2810.0, A=527e6, B=676e6, n=0.71, C=0.017, m=1.61, T_melt=750.0, c_p=960.0
)
STEEL_A36 = JohnsonCook(
    E=200e9, nu=0.26, rho=7850.0, A=286.1e6, B=500.1e6, n=0.2282, C=0.022, m=0.917, T_melt=1773.0, c_p=486.0
)
STEEL_304 = JohnsonCook(
    E=200e9, nu=0.29, rho=7900.0, A=310e6, B=1000e6, n=0.65, C=0.07, m=1.0, T_melt=1673.0, c_p=500.0
)
STEEL_S235 = CowperSymonds(
    E=210e9, nu=0.3, rho=7850.0, plastic_strain=(0.0, 0.015, 0.2), stress=(235e6, 240e6, 430e6), D=40.4, q=5.0
)
POLYCARBONATE = J2Bilinear(E=2.4e9, nu=0.38, rho=1200.0, sigma_y=65e6, E_t=0.0)
ABS = J2Bilinear(E=2.3e9, nu=0.37, rho=1040.0, sigma_y=45e6, E_t=0.0)
PA66_DRY = J2Bilinear(E=3.1e9, nu=0.39, rho=1140.0, sigma_y=85e6, E_t=0.0)
PA66_MOIST = J2Bilinear(E=1.2e9, nu=0.41, rho=1140.0, sigma_y=52e6, E_t=0.0)
EPDM_60 = NeoHookean(C10=0.6e6, rho=1150.0)
EPP_30 = CrushableFoam(
    E=4e6, rho=30.0, crush=(0.0, 0.25, 0.5, 0.75), stress=(0.09e6, 0.15e6, 0.21e6, 0.47e6), tension=0.4e6
)
STRUCTURAL_STEEL = Elastic(E=210e9, nu=0.3, rho=7850.0)
CONCRETE_C30 = Elastic(E=33e9, nu=0.2, rho=2400.0)
RED_OAK = Elastic(E=2.1e9, nu=0.35, rho=700.0)
NATURAL_RUBBER = Ogden(mu=(0.63e6, 0.0012e6, -0.01e6), alpha=(1.3, 5.0, -2.0), rho=930.0)

_GRADES = (
    "typical of unfilled grades for moulding at 23 degrees C, of no one data sheet: take that of the grade; slow "
    "tension up to the yield point, where necking begins; stronger at higher rates"
)
SOURCES: dict[str, str] = {
    **dict.fromkeys(
        "OFHC_COPPER CARTRIDGE_BRASS NICKEL_200 ARMCO_IRON STEEL_1006 STEEL_4340 STEEL_S7 ALUMINIUM_2024_T351 "
        "ALUMINIUM_7039".split(),
        _JC83,
    ),
    "ALUMINIUM_6061_T6": "Lesuer, Kay and LeBlanc, Lawrence Livermore report UCRL-JC-134118 (2001): large strain, "
    "rates to some 10^4 1/s",
    "ALUMINIUM_7075_T651": "Brar, Joshi and Harris, AIP Conf. Proc. 1195 (2009) 945: tension, slow and by Hopkinson "
    "bar, to 520 K",
    "NATURAL_RUBBER": "Ogden, Proc. R. Soc. A 326 (1972) 565, fitted to Treloar, Trans. Faraday Soc. 40 (1944) 59: "
    "vulcanised with 8 % of sulphur, without filler, slow tension to 7.6 times its length, equal tension of two axes "
    "to 4.5, shear; the bulk modulus is that of the default nu, lower than the real one",
    "STEEL_304": "values in common use for annealed austenitic steel, not held against a measurement here",
    "STEEL_S235": "EN 10025-2: least yield stress, and tensile strength as true stress at the least uniform strain; "
    "rates after Cowper and Symonds (1957) for mild steel, small strains",
    "POLYCARBONATE": _GRADES,
    "ABS": _GRADES,
    "PA66_DRY": f"{_GRADES}; dry as moulded",
    "PA66_MOIST": f"{_GRADES}; in balance with air of 50 % humidity",
    "EPDM_60": "Young's modulus 3.6 MPa of 60 Shore A by Gent, Trans. Inst. Rubber Ind. 34 (1958) 46: slow, to 1.5 "
    "times the length",
    "EPP_30": "typical of expanded polypropylene of 30 kg/m^3 at 25, 50 and 75 %, of no one data sheet: take that of "
    "the grade; slow; stronger at higher rates",
    "STRUCTURAL_STEEL": "EN 1993-1-1, 3.2.6: it does not yield; for floors and fixtures",
    "CONCRETE_C30": "EN 1992-1-1, table 3.1, secant modulus of C30/37, and 3.1.3: it does not crack; density of plain "
    "concrete after EN 1991-1-1; for floors",
    "RED_OAK": "Wood Handbook (USDA FPL-GTR-282, 2021), tables 5-1 and 5-3a: northern red oak at 12 % of moisture, "
    "radial modulus, 0.154 of the longitudinal one; as an isotropic stand-in that does not dent, for floors that are "
    "loaded across the grain",
    "STEEL_A36": "Schwer, 6th European LS-DYNA Users' Conference (2007), after Seidt and others: to 2000 1/s",
}


def materials() -> dict[str, Elastic]:
    """All of them by name."""
    return {name: globals()[name] for name in SOURCES}
