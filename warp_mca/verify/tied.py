"""Owns the case of tied meshes: what a tie of a fine mesh to a coarse one sends back of a pulse."""

from __future__ import annotations

import dataclasses

import numpy as np

from warp_mca.verify.case import SHAPES, Row, Setup, case


@case(
    group="waves",
    title="A tie of a fine mesh to one of twice its cells sends back nothing of a pulse but what the cells do",
    reference="One-dimensional wave theory: bars of one impedance send back nothing; Graff, Wave Motion in Elastic "
    "Solids (1975), chapter 2.",
    elements=SHAPES,
)
def tied_bar(setup: Setup) -> list[Row]:
    """Square bar, nu = 0; the pulse beside that in a longer bar of the fine mesh, on both sides of the tie."""
    counts = setup.choose((25, 50), (25, 50, 100))
    back, on = [], []
    for count in counts:
        curves = []
        scene = setup.scene("tied_bar", axial_fine=2 * count, axial=count, length=0.3)
        long = setup.scene("tied_bar", axial_fine=4 * count, axial=1, length=0.6)  # whose tie the pulse does not reach
        for item in (scene, dataclasses.replace(long, impact=scene.impact)):
            path = setup.run(item).paths[0]
            probes = (int(np.argmin(np.abs(path.position - x))) for x in (0.15, 0.36))
            curves.append([path.stress[:, probe, 0].astype(np.float64) for probe in probes])
        (near, far), (alone, beyond) = curves
        top = np.abs(alone).max()
        back.append(float(np.abs(near - alone).max() / top))
        on.append(float(np.abs(far).max() / np.abs(beyond).max()))
    sizes = tuple(1.0 / count for count in counts)
    cells = counts[-1] * 2 // 5
    why = f"dispersion: cells of twice the length carry waves more slowly, with {cells} of them in the pulse"
    sent, through = (f"share of the stress that is {what}" for what in ("sent back", "let through"))
    order = setup.by_element(1.8, tet4=None)
    return [
        Row(sent, 0.0, back, "-", 5e-3, why, scale=1.0, sizes=sizes, least_order=order),
        Row(through, 1.0, on, "-", 5e-3, why, sizes=sizes),
    ]
