"""Any consistent units give the same impact: millimetres and tonnes, or a body of a micrometre."""

from __future__ import annotations

import numpy as np
import pytest

import warp_mca as mca


def rod(element: str, L: float, M: float, T: float) -> mca.Scene:
    """A metal bar of 40 mm that strikes a rough wall aslant, in units of L [m], M [kg] and T [s]."""
    stress = M / (L * T**2)
    metal = mca.J2Bilinear(
        E=210e9 / stress, nu=0.3, rho=7850.0 * L**3 / M, sigma_y=200e6 / stress, E_t=2e9 / stress, beta=0.5
    )
    box = mca.Box(size=(0.04 / L, 0.01 / L, 0.01 / L), divisions=(8, 2, 2))
    wall = mca.RigidPlane(point=(0.04 / L, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    return mca.Scene(
        name="units",
        bodies=(
            mca.Body(
                name="bar", geometry=box, material=metal, element=element, velocity=(20.0 * T / L, 5.0 * T / L, 0.0)
            ),
        ),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall, mu=0.2),),
        impact=mca.ImpactPhase(duration=30e-6 / T, output_interval=0.5e-6 / T),
        tip=mca.Point(body="bar", at=(0.04 / L, 0.0, 0.0)),
    )


@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4"])
@pytest.mark.parametrize(
    "units", [(1e-3, 1e3, 1.0), (1e-3, 1.0, 1e-3), (1e4, 1e12, 1e4)], ids=["mm t s", "mm kg ms", "tiny"]
)
def test_units_do_not_matter(element, units):
    L, M, T = units
    known, found = mca.run(rod(element, 1.0, 1.0, 1.0)), mca.run(rod(element, L, M, T))
    for key in ("F_n", "F_t"):
        force = getattr(found, key) * M * L / T**2
        # forces of elements are rounded to 3e-5 of their greatest, with both signs; hex8r shows 3e-6 of the contact's
        assert force == pytest.approx(getattr(known, key), abs=5e-6 * np.abs(known.F_n).max())
    peaks = [[t * T, F * M * L / T**2] for t, F in found.summary["F_n_peaks"]]
    assert np.array(peaks) == pytest.approx(np.array(known.summary["F_n_peaks"]), rel=1e-5)
    for key in ("contacts", "sticks"):
        assert T * np.array(found.summary[key]) == pytest.approx(np.array(known.summary[key]), rel=1e-9)
    assert found["closing_speed"] * L / T == pytest.approx(known["closing_speed"], abs=1e-3, nan_ok=True)
    assert known.summary["max_plastic_strain"] > 1e-3
    assert found.summary["max_plastic_strain"] == pytest.approx(known.summary["max_plastic_strain"], rel=1e-5)
