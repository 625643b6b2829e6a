"""Owns the rows about elements: nearly incompressible material, large strains taken as small, pressure that rounding
shakes up."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from warp_mca.geometry.cell_types import linear_type
from warp_mca.geometry.quality import volumes
from warp_mca.physics.elements.cells import body_cells, body_materials
from warp_mca.scene import Body
from warp_mca.scene.materials import J2Bilinear, J2Table, J2Voce, JohnsonCook, Material
from warp_mca.watch.row import Context, Finished, Kind, Values, When, row

ROUNDING = 1.4 * 2.0**-24  # of dilatation in float32 in each step, over the strain; measured, see docs/decisions.md
METALS = (J2Bilinear, J2Voce, J2Table, JohnsonCook)  # whose von Mises stress over 3 G is their elastic strain
STRAIN = 0.1  # taken as small, from which on stresses are off by a tenth of themselves
_SMALL = "the co-rotational element takes strains as small, expect stresses off by as much"


@row(
    "pressures of tet10 in body {body} scatter by a third where Poisson's ratio is {nu:.4g}:",
    "take element='tet10_mean' for walls of two layers of elements or more, which bends too far in one layer",
    0.45,
    "at most",
    kind=Kind.ADVICE,
    when=When.BEFORE,
)
def scattered_pressure(c: Context, most: float) -> Iterator[Values]:
    """Poisson's ratio of bodies with such elements."""
    for body in c.scene.bodies:
        mesh = c.meshes[body.name]
        if not body.rigid and any(part.element.name == "tet10" for part in body_cells(body, mesh)):
            # rubber at large strain has a row of its own
            soft = [item for item, _ in body_materials(body, mesh) if not item.finite_only]
            moduli = [(item.bulk_modulus, item.shear_modulus) for item in soft]
            nu = max(((3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G) for K, G in moduli), default=0.0)
            if nu > most:
                yield dict(body=body.name, nu=nu)


@row(
    "{element} {does} where rubber is nearly incompressible; body {body} has nu = {nu:.4g}:",
    "take element='hex8', or 'tet10' for tetrahedra",
    0.48,
    "Poisson's ratio at most, of materials for large strain only",
    kind=Kind.ADVICE,
    when=When.BEFORE,
)
def enriched_rubber(c: Context, most: float) -> Iterator[Values]:
    """Poisson's ratio of rubber in bodies of hexahedra with internal modes, or of `tet10_mean`."""
    stiff, soft = "is some percent too stiff,", "is too soft, and may become unstable,"
    known = {**dict.fromkeys(("hex8i", "hex8w", "hex8w3"), stiff), "tet10_mean": soft}
    for body in c.scene.bodies:
        mesh = c.meshes[body.name]
        materials = [material for material, _ in body_materials(body, mesh) if material.finite_only]
        nu = max((material.nu for material in materials), default=0.0)
        has_some = len(mesh.hexahedra) or not body.element.startswith("hex")
        if body.element in known and has_some and not body.rigid and nu > most:
            yield dict(body=body.name, element=body.element, does=known[body.element], nu=nu)


@row(
    "tet10_mean bends too far in walls of one layer of elements, as {share:.0%} of body {body} seems to be:",
    "take tet10 there, or smaller cells",
    0.5,
    "of the volume at most, in cells whose corners all lie on the skin",
    kind=Kind.ADVICE,
    when=When.BEFORE,
)
def single_layer(c: Context, most: float) -> Iterator[Values]:
    """Volume of such cells of bodies with these elements."""
    for body in c.scene.bodies:
        mesh = c.meshes[body.name]
        if body.element == "tet10_mean" and not body.rigid:
            inner = np.ones(len(mesh.points), dtype=bool)
            inner[mesh.boundary[0]] = False
            own = volumes(mesh)
            corners = [cells[:, : linear_type(name).corners] for name, cells in mesh.cells.items()]
            wall = np.concatenate([~inner[cells].any(axis=1) for cells in corners])
            share = float(own[wall].sum() / own.sum())
            if share > most:
                yield dict(body=body.name, share=share)


@row(
    f"strain reached {{strain:.2f}}; {_SMALL} where it exceeds {STRAIN},",
    "or choose kinematics='finite'{where}",
    STRAIN,
    "[-] at most",
)
def large_strain(c: Finished, most: float) -> Iterator[Values]:
    """Greatest deviatoric strain, where bodies have kinematics='corotational'."""
    if c.ledger.kept.max_strain > most:
        yield from (dict(strain=c.ledger.kept.max_strain, where=where) for where in _where_small(c, most))


@row(
    f"elements lost up to {{lost:.0%}} of their volume; {_SMALL} there,",
    "or choose kinematics='finite'{where}",
    0.15,
    "[-] at most",
)
def lost_volume(c: Finished, most: float) -> Iterator[Values]:
    """Greatest loss of volume of such bodies, which may come without that strain if sides are held."""
    lost = 1.0 - c.ledger.kept.min_jacobian
    if lost > most and c.ledger.kept.max_strain <= STRAIN:
        yield from (dict(lost=lost, where=where) for where in _where_small(c))


def _where_small(c: Finished, strain: float = math.inf) -> Iterator[str]:
    """Which bodies take strain as small, if any do, but those that did not reach `strain` if others may have."""
    flexible = [body for body in c.scene.bodies if not body.rigid]
    small = [body for body in flexible if body.kinematics == "corotational"]
    reached = [body for body in small if not _stayed_below(strain, body, c.peaks.get(body.name, {}))]
    if reached or len(small) < len(flexible):
        small = reached
    if small:
        names = " or ".join(body.name for body in small)
        yield "" if len(small) == len(flexible) else f", if that was in {names}"


def _stayed_below(strain: float, body: Body, peaks: Mapping[str, Any]) -> bool:
    """Whether elastic and plastic strain of a body of metals say so, twice over, since these peaks are of records."""
    materials = [body.material] if isinstance(body.material, Material) else list(body.material.values())
    if math.isinf(strain) or not peaks or any(item.law and not isinstance(item, METALS) for item in materials):
        return False
    elastic = peaks["max_von_mises"]["value"] / (3.0 * min(item.shear_modulus for item in materials))
    return 2.0 * (elastic + peaks["max_plastic_strain"]["value"]) < strain


@row(
    "in {steps:,} steps, rounding in mixed precision shakes up pressures of some {noise:.2g} Pa, {share:.0%} of "
    "{stress}, where Poisson's ratio is {nu:.4g}:",
    "choose --precision float64",
    0.02,
    "of the greatest stress at most",
)
def shaken_pressure(c: Finished, most: float) -> Iterator[Values]:
    """Pressure K r e sqrt(n) of n steps: rounding r pushes volumes to and fro in each, a random walk, at strain e."""
    if c.ledger.precision != "mixed":
        return
    strain, steps = c.ledger.kept.max_strain, c.steps_taken
    for K, G, yield_stress in np.pad(c.model.law, ((0, 0), (0, 1)))[:, :3]:
        stress = min(3.0 * G * strain, yield_stress) if yield_stress > 0.0 else 3.0 * G * strain
        noise = K * ROUNDING * strain * math.sqrt(steps)
        if noise > most * stress > 0.0:
            nu = (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
            limit = "the yield stress" if stress == yield_stress else "the greatest stress"
            yield dict(steps=steps, noise=noise, share=noise / stress, stress=limit, nu=nu)
