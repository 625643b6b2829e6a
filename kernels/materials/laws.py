"""Owns what the kernels ask of a material law: one of five families of functions, with a history of any size.

A law of *flow* has isotropic elasticity, keeps the volume when it flows, and keeps the plastic strain and its
equivalent; `kernels.materials.j2` is one. A *rated* law of flow keeps more behind these, and is given the time step:
rates, heat, back stresses. A *hyperelastic* law has an energy of the isochoric stretch, whose pressure elements
compute as that of elasticity; a *viscous* one the same with a history and the time step. A *general* law gives the
whole stress of the whole strain: anisotropy, foam and damage. The module of a law has the functions that one of the
families below names, and the constants. A name "module:a:b" hands a and b to each of its factories.
"""

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from warp_mca.base.errors import bad_value

# Rows of each kind of quantity that a history may hold: a traceless symmetric tensor xx, yy, xy, yz, xz, a symmetric
# tensor xx, yy, zz, xy, yz, xz, a vector and a number. All but numbers turn with the body.
ROWS = {"deviator": 5, "tensor": 6, "vector": 3, "scalar": 1}
FLOW_HISTORY = ("deviator", "scalar")  # plastic strain and equivalent plastic strain
FLOW = ("parameters", "return_map", "plastic_energy")
RATED = ("parameters", "flow", "plastic_work")
HYPERELASTIC = ("parameters", "mandel", "stored")
VISCOUS = ("parameters", "deviatoric", "energies")
GENERAL = ("parameters", "stress", "energies")
FAMILIES = {"mandel": HYPERELASTIC, "deviatoric": VISCOUS, "stress": GENERAL, "flow": RATED, "return_map": FLOW}
OPTIONAL = ("temperature",)


def row_count(history: tuple[str, ...]) -> int:
    """Rows of a history of these kinds."""
    return sum(ROWS[kind] for kind in history)


@dataclass(frozen=True)
class Law:
    """A law in the scalars of one precision. Each function is made by a factory of its name, (precision) -> function.

    A name with arguments, "module:a:b", has factories (precision, a, b), and a function HISTORY of a and b.

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
        mandel: of a hyperelastic law: (strain, c) -> Mandel stress [Pa], traceless and symmetric, of the Green-Lagrange
            strain of the isochoric deformation, (J^(-2/3) F^T F - I) / 2: the deviator of the Kirchhoff stress before
            the rotation. For finite strain only.
        stored: of a hyperelastic law: (strain, c) -> energy without that of the pressure.
        deviatoric: of a viscous law: (strain, history, dt, c) -> (S, history), of the deviatoric strain.
        stress: of a general law: (strain, history, dt, c) -> (stress, history). The strain is measured in the axes of
            the reference, which have turned with the element where strains are small, and is logarithmic where
            `Body.kinematics` is finite; the stress is the one conjugate to it. The history is a vector of the law's
            rows, 0 at first. dt [s] is the time since the history was kept; 0 asks for the stress of the history as it
            stands.
        temperature: of a law with heat, may be left out: (history, c) -> T*, from 0 where nothing softens to 1 where
            it melts.
        energies: of a general or viscous law: (strain, history, c) -> (stored, dissipated), with the history that
            `stress` or `deviatoric` gave; of a viscous law without the energy of the pressure.
        history: kinds of what each point keeps, out of `ROWS`; HISTORY of the module of a rated, viscous or general
            law. That of a rated law begins with `FLOW_HISTORY`.
        elliptic: whether its elasticity stays so at large strain, which logarithmic elasticity does not. A function
            `elliptic` of the module of a viscous law says so.
        relaxes: whether stress falls at a constant strain; RELAXES of the module.
        plastic_row: of the equivalent plastic strain in the history, which must not shrink; PLASTIC_ROW of a general
            law, -1 where it has none.
    """

    parameters: Any = None
    return_map: Any = None
    plastic_energy: Any = None
    flow: Any = None
    plastic_work: Any = None
    mandel: Any = None
    stored: Any = None
    deviatoric: Any = None
    stress: Any = None
    energies: Any = None
    temperature: Any = None
    history: tuple[str, ...] = ()
    elliptic: bool = False
    relaxes: bool = False
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
    def hyperelastic(self) -> bool:
        """Whether it is a hyperelastic law, which keeps nothing."""
        return self.mandel is not None

    @property
    def viscous(self) -> bool:
        """Whether it is a viscous law."""
        return self.deviatoric is not None

    @property
    def by_points(self) -> bool:
        """Whether elements compute it by `MaterialPoint` alone: it has a time step or a history of its own."""
        return self.general or self.rated or self.viscous

    @property
    def flows(self) -> bool:
        """Whether what it takes may be inelastic for good: laws of flow and general ones."""
        return self.general or self.rated or self.return_map is not None

    @property
    def always(self) -> bool:
        """Whether the history changes in each step, not only where something flows."""
        return self.general or self.viscous

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
        path, *given = name.split(":")
        module = import_module(path)
        key = next((key for key in FAMILIES if hasattr(module, key)), "return_map")
        optional = [each for each in OPTIONAL if hasattr(module, each)]
        made = {each: getattr(module, each)(precision, *given) for each in (*FAMILIES[key], *optional)}
        history = _history(module, key, given)
        elliptic = getattr(module, "elliptic", lambda *_given: key in ("mandel", "stress"))(*given)
        row = row_count(FLOW_HISTORY) - 1 if key in ("flow", "return_map") else getattr(module, "PLASTIC_ROW", -1)
        if not -1 <= row < row_count(history):
            raise ValueError(f"PLASTIC_ROW = {row} is none of the {row_count(history)} rows of HISTORY")
    except Exception as error:  # it may be of the user
        remedy = " or ".join(", ".join(names) for names in FAMILIES.values())
        remedy = f"name a module that makes {remedy}: {type(error).__name__}: {error}"
        raise bad_value("law of a material", name, remedy) from error
    facts = {"history": history, "elliptic": elliptic, "plastic_row": row}
    return Law(**made, **facts, relaxes=getattr(module, "RELAXES", False))


def _history(module: ModuleType, key: str, given: list[str]) -> tuple[str, ...]:
    """Kinds of what a point of the law keeps.

    Raises:
        ValueError: that of a rated law does not begin with `FLOW_HISTORY`.
    """
    if key == "mandel":
        return ()
    if key == "return_map":
        return FLOW_HISTORY
    kinds: Any = module.HISTORY
    history = tuple(kinds(*given) if callable(kinds) else kinds)
    if key == "flow" and history[:2] != FLOW_HISTORY:
        raise ValueError(f"HISTORY = {history} of a rated law begins with {', '.join(FLOW_HISTORY)}")
    return history
