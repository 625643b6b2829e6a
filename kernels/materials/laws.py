"""Owns what the kernels ask of a material law: one of three families of functions, with a history of any size.

A law of *flow* has isotropic elasticity, keeps the volume when it flows, and keeps the plastic strain and its
equivalent; `kernels.materials.j2` is one. A *rated* law of flow keeps more behind these, and is given the time step:
rates, heat, back stresses. A *general* law gives the whole stress of the whole strain: anisotropy, rubber and damage.
The module of a law has the functions that `FLOW`, `RATED` or `GENERAL` names, and the constants below.
"""

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any

from warp_mca.base.errors import bad_value

# Rows of each kind of quantity that a history may hold: a traceless symmetric tensor xx, yy, xy, yz, xz, a symmetric
# tensor xx, yy, zz, xy, yz, xz, a vector and a number. All but numbers turn with the body.
ROWS = {"deviator": 5, "tensor": 6, "vector": 3, "scalar": 1}
FLOW_HISTORY = ("deviator", "scalar")  # plastic strain and equivalent plastic strain
FLOW = ("parameters", "return_map", "plastic_energy")
RATED = ("parameters", "flow", "plastic_work")
GENERAL = ("parameters", "stress", "energies")
OPTIONAL = ("temperature",)


def row_count(history: tuple[str, ...]) -> int:
    """Rows of a history of these kinds."""
    return sum(ROWS[kind] for kind in history)


@dataclass(frozen=True)
class Law:
    """A law in the scalars of one precision. Each function is made by a factory of its name, (precision) -> function.

    Stresses and moduli are in Pa, strains have no unit, energies are in J/m^3 of the reference volume. K and G of the
    first two columns of `Model.law` bound the moduli of any state: stable step, penalty and hourglass stiffness take
    these.

    Attributes:
        parameters: (law, m, scale) -> what the law wants of row m of `Model.law`, as a vector or a struct, from column
            2 on. Stresses are multiplied by `scale`, as those that `return_map` takes and gives are; general laws are
            given 1.
        return_map: of a law of flow: (elastic, eps_p, p, G, c) -> (S, eps_p, p), with 2 G e of the deviatoric strain e
            for `elastic`, the deviatoric stress S, the plastic strain eps_p, symmetric and traceless, the equivalent
            plastic strain p, which must not shrink, and c from `parameters`. The first flow comes where the von Mises
            stress passes column 2 of `Model.law`. Where nothing flows, p comes back bit for bit.
        plastic_energy: of a law of flow: (eps_p, p, c) -> plastic work, stored and dissipated: a function of state.
        flow: of a rated law: (elastic, history, dt, G, c) -> (S, history, dp), as `return_map`, with the history as a
            vector of rows, 0 at first, and the growth dp of p, 0 where nothing flows. The history is kept where dp > 0.
            dt [s] is the step, above 0. The scale of `parameters` is 1.
        plastic_work: of a rated law: (history, c) -> plastic work, stored and dissipated.
        stress: of a general law: (strain, history, dt, c) -> (stress, history). The strain is measured in the axes of
            the reference, which have turned with the element where strains are small, and is logarithmic where
            `Body.kinematics` is finite; the stress is the one conjugate to it. The history is a vector of the law's
            rows, 0 at first. dt [s] is the time since the history was kept; 0 asks for the stress of the history as it
            stands.
        temperature: of a law with heat, may be left out: (history, c) -> T*, from 0 where nothing softens to 1 where
            it melts.
        energies: of a general law: (strain, history, c) -> (stored, dissipated), with the history that `stress` gave.
        history: kinds of what each point keeps, out of `ROWS`; HISTORY of the module of a rated or general law. That
            of a rated law begins with `FLOW_HISTORY`.
        plastic_row: of the equivalent plastic strain in the history, which must not shrink; PLASTIC_ROW of a general
            law, -1 where it has none.
    """

    parameters: Any = None
    return_map: Any = None
    plastic_energy: Any = None
    flow: Any = None
    plastic_work: Any = None
    stress: Any = None
    energies: Any = None
    temperature: Any = None
    history: tuple[str, ...] = ()
    plastic_row: int = -1

    @property
    def general(self) -> bool:
        """Whether it gives the whole stress, pressure included."""
        return self.stress is not None

    @property
    def rated(self) -> bool:
        """Whether it is a rated law of flow."""
        return self.flow is not None

    @property
    def by_points(self) -> bool:
        """Whether elements compute it by `MaterialPoint` alone: it has a time step or a history of its own."""
        return self.general or self.rated

    @property
    def size(self) -> int:
        """Rows of the history of a point."""
        return row_count(self.history)


@cache
def law_functions(name: str, precision: str) -> Law:
    """The law in the module of that name; no law, "", is elastic and has none of the functions.

    Raises:
        RequestError: there is no such module, or it lacks one of the functions of its family.
    """
    if not name:
        return Law()
    try:
        module = import_module(name)
        general, rated = hasattr(module, "stress"), hasattr(module, "flow")
        names = GENERAL if general else RATED if rated else FLOW
        optional = [key for key in OPTIONAL if hasattr(module, key)]
        made = {key: getattr(module, key)(precision) for key in (*names, *optional)}
        history = tuple(module.HISTORY) if general or rated else FLOW_HISTORY
        if rated and not general and history[:2] != FLOW_HISTORY:
            raise ValueError(f"HISTORY = {history} of a rated law begins with {', '.join(FLOW_HISTORY)}")
        row = getattr(module, "PLASTIC_ROW", -1) if general else row_count(FLOW_HISTORY) - 1
        if not -1 <= row < row_count(history):
            raise ValueError(f"PLASTIC_ROW = {row} is none of the {row_count(history)} rows of HISTORY")
    except Exception as error:  # it may be of the user
        remedy = " or ".join(", ".join(names) for names in (FLOW, RATED, GENERAL))
        remedy = f"name a module that makes {remedy}: {type(error).__name__}: {error}"
        raise bad_value("law of a material", name, remedy) from error
    return Law(**made, history=history, plastic_row=row)
