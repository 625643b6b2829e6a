"""Owns what the command `paper` runs: its levels, their meshes, and the points of each figure.

A new figure is a line in `STUDIES` and its points in `LEVELS`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import warp_mca as mca
from warp_mca.scene import catalogue

SCENE = "two_link"
MAIN, MESH, PENALTY = "main", "mesh", "penalty"  # variants of a point: as shown; other mesh; on it, other penalty too
LUG, CELLS, CELLS_LUG = "lug", "cells", "cells, lug"  # hinges of fork and eye; cells of 0.45 mm at the tip; both
SPRINGS = "springs"  # penalty 0.3 on cells of 1.2 mm: springs as soft, by area, as the published first peak asks for
Settings = tuple[tuple[str, object], ...]


@dataclass(frozen=True)
class MeshChoice:
    """A density of all meshes: a preset, how much finer it is made, and parameters that change it."""

    preset: str
    refine: float = 1.0
    cells: Settings = ()

    def __str__(self) -> str:
        words = [self.preset] + ([f"--refine {self.refine:g}"] if self.refine != 1.0 else [])
        return " ".join(words + [f"{key}={value}" for key, value in self.cells])


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        mesh: its meshes.
        settings: parameters that differ from those of the scene.
    """

    mesh: MeshChoice
    settings: Settings = ()

    def scene(self) -> mca.Scene:
        """The scene that is run."""
        values = dict(self.mesh.cells + self.settings)
        scene = mca.make_scene(SCENE, preset=self.mesh.preset, **values)
        return scene if self.mesh.refine == 1.0 else replace(scene, refine=self.mesh.refine)

    def command(self, device: str) -> str:
        """The command line that gives this run again."""
        words = [f"warp-mca run {SCENE} --preset {self.mesh.preset}"]
        words += [f"--refine {self.mesh.refine:g}"] if self.mesh.refine != 1.0 else []
        words += [f"--set {key}={value}" for key, value in self.mesh.cells + self.settings]
        return " ".join(words + ([f"--device {device}"] if device != "cpu" else []))


@dataclass(frozen=True)
class Study:
    """Runs in which one quantity changes.

    Attributes:
        name: by which claims and figures find its runs.
        figures: numbers of the paper's figures that it gives.
        title: of the figures.
        quantity: that changes, with its unit.
        parameters: of the scene that take the value.
        common: parameters of all its runs.
        other: those that the variant PENALTY changes.
        shares: parameters that take a share of the value: tangent moduli.
        scale: unit of the values over that of the parameters.
        spans: duration up to each value [s], for values in ascending order; `common` has it where empty.
    """

    name: str
    figures: tuple[str, ...]
    title: str
    quantity: str = ""
    parameters: tuple[str, ...] = ()
    common: Settings = ()
    other: Settings = (("penalty", 0.3),)
    shares: tuple[tuple[str, float], ...] = ()
    scale: float = 1.0
    spans: tuple[tuple[float, float], ...] = ()

    def settings(self, value: float) -> Settings:
        """Parameters of the run with this value."""
        changed = [(key, value * self.scale) for key in self.parameters]
        changed += [(key, round(value * self.scale * share)) for key, share in self.shares]
        span = next((duration for limit, duration in self.spans if value <= limit), None)
        return as_changed(self.common + tuple(changed) + ((("duration", span),) if span is not None else ()))


def as_changed(settings: Settings) -> Settings:
    """Without values that the scene has by itself, so that equal runs are known as such."""
    return tuple((key, value) for key, value in settings if _defaults().get(key) != value)


@lru_cache(maxsize=1)
def _defaults() -> dict[str, object]:
    return {name: parameter.default for name, parameter in catalogue.load_source(SCENE).parameters.items()}


BASE: Settings = (("duration", 0.8e-3),)  # of Figs. 7 to 15; the plate at 4 m/s touches for 0.7 ms
# of Fig. 8: it ends within the impact, so that no shape at rest has to be found for the return to rigid bodies
SWING: Settings = (("t_end", 0.2568), ("duration", 1e-3))
STIFF: Settings = (("penalty", 1.0),)  # springs of a soft tip are soft in proportion
SOFTER: Settings = (("penalty", 0.5),)  # with 0.3 a tip of 0.7 GPa sinks into the plate by more than half a face
# of Table 2: links swing for long, on hinges that do not yield; rigid links have the mass of the mesh
PURE: Settings = (("joint_nodes", "axis"), ("penalty", 1.0), ("rigid_inertia", "mesh"), ("duration", 5e-3))
TANGENT = 27.0 / 70.0  # tangent modulus over Young's modulus, Table 1
SPANS = ((0.7, 4e-3), (7.0, 2e-3), (70.0, 0.8e-3), (7000.0, 0.5e-3))  # moduli [GPa], duration [s]


def _compliance(name: str, figure: str, title: str, *parts: str) -> Study:
    return Study(
        name,
        (figure,),
        title,
        "E [GPa]",
        tuple(f"E_{part}" for part in parts),
        common=STIFF,
        other=SOFTER,
        shares=tuple((f"E_t_{part}", TANGENT) for part in parts),
        scale=1e9,
        spans=SPANS,
    )


STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        Study("base", ("9", "11"), "The system of Table 1", common=BASE),
        Study("swing", ("8",), "From the release into the impact", common=SWING),
        Study("v_plate", ("12", "13"), "Velocity of the plate", "v_plate [m/s]", ("v_plate",), common=BASE),
        Study("mu", ("14", "15"), "Coefficient of friction", "μ", ("mu",), common=BASE),
        _compliance("tip", "16", "Modulus of the tip", "tip"),
        _compliance("body", "17", "Modulus of the rods' cylinders", "body"),
        _compliance("rod", "18", "Modulus of the whole rods", "tip", "body"),
        Study("limit", ("limit",), "Stiff springs, hinges of fork and eye", common=(("hinge", "lug"), *STIFF)),
    )
}
FIRST = ("base", "limit", "meshes")  # studies whose runs come before all others
ENDS = tuple((name, value) for name in ("tip", "body", "rod") for value in (0.7, 7000.0))  # with published durations
# Points whose published figures are put beside those of choices that the paper leaves open
TOGETHER = (("base", 0.0), ("mu", 0.1), ("mu", 1.5), ("v_plate", 0.4), ("v_plate", 0.8))
MESHES = "meshes"  # name under which the runs of Fig. 7 are found, by number from the coarsest mesh


@dataclass(frozen=True)
class Level:
    """How much is run.

    Attributes:
        name: of the level.
        note: what the page says about it.
        main, other: meshes of all figures, and of the variants MESH and PENALTY.
        meshes: of Fig. 7, from the coarsest on; the last is `main` or finer.
        limit: two meshes on which stiff springs and hinges as built are compared, the finer one last; may be empty.
        points: values of each study; a study that is not listed is not run.
        ends: of these, values that are run in all variants.
        tried: mesh and points of each variant that is a choice which the paper leaves open.
        pure: mesh of the comparison with pure finite elements, where that is asked for.
    """

    name: str
    note: str
    main: MeshChoice
    other: MeshChoice
    meshes: tuple[MeshChoice, ...]
    limit: tuple[MeshChoice, ...]
    points: Mapping[str, tuple[float, ...]]
    ends: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    tried: Mapping[str, tuple[MeshChoice, tuple[tuple[str, float], ...]]] = field(default_factory=dict)
    pure: MeshChoice = MeshChoice("quick", refine=0.5)


Key = tuple[str, float, str]  # study, value, variant


def cases(level: Level) -> dict[Key, Case]:
    """The runs of a level; several keys may share a run."""
    return dict(_cases(level))


def pure_case(level: Level) -> Case:
    """The run that is compared with pure finite elements."""
    return Case(level.pure, as_changed(PURE))


def in_order(level: Level, found: Mapping[Key, Case]) -> list[Case]:
    """Each run once, those first that most claims need: a report that ends early then says as much as it can."""

    def rank(key: Key) -> tuple[bool, int, bool]:
        study, value, variant = key
        first = FIRST.index(study) if study in FIRST else len(FIRST)
        return variant in (MESH, PENALTY), first, value not in level.ends.get(study, (value,))

    return list(dict.fromkeys(found[key] for key in sorted(found, key=rank)))


def _cases(level: Level) -> Iterator[tuple[Key, Case]]:
    for name, values in level.points.items():
        study = STUDIES[name]
        for value in values:
            settings = study.settings(value)
            yield (name, value, MAIN), Case(level.main, settings)
            if value in level.ends.get(name, values):
                yield (name, value, MESH), Case(level.other, settings)
                yield (name, value, PENALTY), Case(level.other, _replaced(settings, study.other))
    for k, mesh in enumerate(level.meshes):
        yield (MESHES, float(k), MAIN), Case(mesh, BASE)
    for variant, (mesh, points) in level.tried.items():
        changes: Settings = (("hinge", "lug"),) if variant in (LUG, CELLS_LUG) else ()
        changes += (("penalty", 0.3),) if variant == SPRINGS else ()
        for name, value in points:
            yield (name, value, variant), Case(mesh, _replaced(STUDIES[name].settings(value), changes))
    for k, mesh in enumerate(level.limit):
        yield ("limit", float(k), MAIN), Case(mesh, STUDIES["limit"].common)


def _replaced(settings: Settings, changes: Settings) -> Settings:
    return tuple((dict(settings) | dict(changes)).items())


# cells of 0.45 mm at the tip: the penalty 0.1 gives the published first peak, see docs/measurements/hinges.md
CHOICES = MeshChoice(
    "quick", cells=(("section", 8), ("axial_OA", 20), ("axial_AB", 20), ("focus_size", 0.45e-3), ("focus_layers", 5))
)
QUICK, STANDARD, PAPER = (MeshChoice(preset) for preset in ("quick", "standard", "paper"))
FINER = MeshChoice(
    "paper",
    cells=(
        ("section", 28),
        ("ring", 9),
        ("axial_OA", 85),
        ("axial_AB", 80),
        ("focus_size", 0.14e-3),
        ("focus_layers", 14),
        ("plate_core_x", 40),
        ("plate_core_z", 28),
        ("plate_core_depth", 11),
        ("plate_layers", 21),
        ("plate_extension", 40),
    ),
)
LEVELS = {
    level.name: level
    for level in (
        Level(
            "quick",
            "Two coarse meshes, three points a figure, moduli from 7 to 700 GPa: a check that everything runs and that "
            "trends are right. Numbers are those of coarse meshes.",
            main=replace(QUICK, refine=0.7),
            other=replace(QUICK, refine=0.5),
            meshes=(replace(QUICK, refine=0.5), replace(QUICK, refine=0.7), QUICK),
            limit=(replace(QUICK, refine=0.7), QUICK),
            points={
                "base": (0.0,),
                "swing": (0.0,),
                "v_plate": (0.4, 0.8, 4.0),
                "mu": (0.1, 0.47, 1.5),
                "tip": (7.0, 70.0, 700.0),
                "body": (7.0, 70.0, 700.0),
                "rod": (7.0, 70.0, 700.0),
            },
            ends={"swing": (), "mu": (0.1, 1.5)} | dict.fromkeys(("tip", "body", "rod"), (7.0, 700.0)),
            tried={LUG: (replace(QUICK, refine=0.7), TOGETHER), CELLS: (CHOICES, TOGETHER[:1])},
        ),
        Level(
            "full",
            "All points of the figures, on a mesh of about the paper's 159,151 elements.",
            main=PAPER,
            other=STANDARD,
            meshes=(replace(PAPER, refine=0.5), replace(PAPER, refine=0.7), replace(PAPER, refine=0.86), PAPER),
            limit=(PAPER, FINER),
            points={
                "base": (0.0,),
                "swing": (0.0,),
                "v_plate": (0.4, 0.6, 0.8, 1.0, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2, 3.6, 4.0),
                "mu": (0.1, 0.2, 0.3, 0.47, 0.7, 1.0, 1.5),
                "tip": (0.7, 7.0, 70.0, 700.0, 7000.0),
                "body": (0.7, 7.0, 70.0, 700.0, 7000.0),
                "rod": (0.7, 7.0, 70.0, 700.0, 7000.0),
            },
            ends={"swing": (), "v_plate": (0.4, 0.8, 4.0), "mu": (0.1, 1.5)}
            | dict.fromkeys(("tip", "body", "rod"), (0.7, 7000.0)),
            tried=dict.fromkeys((CELLS, CELLS_LUG), (CHOICES, TOGETHER))
            | {LUG: (PAPER, TOGETHER), SPRINGS: (replace(QUICK, refine=0.5), ENDS)},
            pure=PAPER,
        ),
    )
}
