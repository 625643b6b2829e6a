"""Owns the public names of warp_mca: `import warp_mca as mca`, then `mca.Scene`, `mca.run`, `mca.load`, …

What needs Warp, scipy, gmsh or meshio is loaded at first use, so that the import itself is quick and light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from warp_mca.base.errors import GuardError, McaError, RequestError
from warp_mca.base.version import __version__
from warp_mca.physics import elements as _elements  # noqa: F401, fills the table of elements
from warp_mca.scene import (
    Absorbing,
    Amplitude,
    Articulation,
    BaseMotion,
    Body,
    BodyForce,
    Bolt,
    Bond,
    Contact,
    ContactAll,
    Controller,
    Coupler,
    Cylindrical,
    DampedPenalty,
    Damping,
    DecayingFriction,
    Fixed,
    Force,
    Freedom,
    ImpactPhase,
    JointTorque,
    Line,
    Path,
    Penalty,
    Point,
    PointMass,
    PositionServo,
    Prescribed,
    Pressure,
    Prismatic,
    Probe,
    Revolute,
    RigidPhase,
    RigidPlane,
    Scene,
    Section,
    Settle,
    ShearCap,
    Slide,
    Spherical,
    Spring,
    Surface,
    ThermalStrain,
    Tie,
    Tip,
    Traction,
    Universal,
    Weld,
    library,
)
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.failure import (
    JohnsonCookFailure,
    PlasticStrainFailure,
    PrincipalStrainFailure,
    PrincipalStressFailure,
)
from warp_mca.scene.foams import CrushableFoam
from warp_mca.scene.metals import Chaboche, CowperSymonds, J2Bilinear, J2Table, J2Voce, JohnsonCook
from warp_mca.scene.rubbers import MooneyRivlin, NeoHookean, Ogden
from warp_mca.scene.viscoelastic import Prony

if TYPE_CHECKING:
    from warp_mca.accuracy.request import Accuracy
    from warp_mca.accuracy.simulation import mesh, run
    from warp_mca.accuracy.tradeoff import tradeoff
    from warp_mca.decks.deck import read_deck
    from warp_mca.geometry import (
        Box,
        Cad,
        Finer,
        LugRod,
        Mesh,
        MeshFile,
        NestedPlate,
        Part,
        Parts,
        Plate,
        Rod,
        Select,
        Sphere,
    )
    from warp_mca.phases.quality import quality_table
    from warp_mca.registration import register
    from warp_mca.results.cfc import cfc_filter
    from warp_mca.results.result import Result
    from warp_mca.results.storage import load
    from warp_mca.robots.robot import Robot
    from warp_mca.scene.cad_assembly import Assembly
    from warp_mca.scene.catalogue import make_scene
    from warp_mca.scene.drops import POSES, drop_test
    from warp_mca.scene.parameters import Param
    from warp_mca.studies.batch import run_batch
    from warp_mca.studies.sweep import sweep
    from warp_mca.studies.worst import worst

_LAZY = {
    "Box": "warp_mca.geometry",
    "Cad": "warp_mca.geometry",
    "Finer": "warp_mca.geometry",
    "LugRod": "warp_mca.geometry",
    "Mesh": "warp_mca.geometry",
    "MeshFile": "warp_mca.geometry",
    "NestedPlate": "warp_mca.geometry",
    "Part": "warp_mca.geometry",
    "Parts": "warp_mca.geometry",
    "Plate": "warp_mca.geometry",
    "Rod": "warp_mca.geometry",
    "Select": "warp_mca.geometry",
    "Sphere": "warp_mca.geometry",
    "Robot": "warp_mca.robots.robot",
    "Assembly": "warp_mca.scene.cad_assembly",
    "POSES": "warp_mca.scene.drops",
    "drop_test": "warp_mca.scene.drops",
    "Param": "warp_mca.scene.parameters",
    "Accuracy": "warp_mca.accuracy.request",
    "make_scene": "warp_mca.scene.catalogue",
    "register": "warp_mca.registration",
    "Result": "warp_mca.results.result",
    "cfc_filter": "warp_mca.results.cfc",
    "load": "warp_mca.results.storage",
    "tradeoff": "warp_mca.accuracy.tradeoff",
    "read_deck": "warp_mca.decks.deck",
    "quality_table": "warp_mca.phases.quality",
    "mesh": "warp_mca.accuracy.simulation",
    "run": "warp_mca.accuracy.simulation",
    "run_batch": "warp_mca.studies.batch",
    "sweep": "warp_mca.studies.sweep",
    "worst": "warp_mca.studies.worst",
}

__all__ = [
    "Scene",
    "Body",
    "Bolt",
    "Bond",
    "Elastic",
    "J2Bilinear",
    "J2Voce",
    "J2Table",
    "CowperSymonds",
    "JohnsonCook",
    "Chaboche",
    "NeoHookean",
    "MooneyRivlin",
    "Ogden",
    "Prony",
    "CrushableFoam",
    "PlasticStrainFailure",
    "JohnsonCookFailure",
    "PrincipalStressFailure",
    "PrincipalStrainFailure",
    "library",
    "Contact",
    "ContactAll",
    "Penalty",
    "DampedPenalty",
    "Damping",
    "Spring",
    "PointMass",
    "DecayingFriction",
    "ShearCap",
    "Surface",
    "RigidPlane",
    "Revolute",
    "Weld",
    "Spherical",
    "Prismatic",
    "Articulation",
    "Universal",
    "Cylindrical",
    "Freedom",
    "PositionServo",
    "Controller",
    "Coupler",
    "Tie",
    "Fixed",
    "Prescribed",
    "Pressure",
    "Traction",
    "Force",
    "BodyForce",
    "ThermalStrain",
    "Amplitude",
    "Absorbing",
    "Point",
    "Path",
    "Line",
    "Probe",
    "Section",
    "Tip",
    "RigidPhase",
    "Settle",
    "BaseMotion",
    "Slide",
    "JointTorque",
    "ImpactPhase",
    "Box",
    "Rod",
    "LugRod",
    "Sphere",
    "Plate",
    "MeshFile",
    "Cad",
    "Finer",
    "Assembly",
    "drop_test",
    "POSES",
    "Select",
    "NestedPlate",
    "Part",
    "Parts",
    "Mesh",
    "Param",
    "Accuracy",
    "cfc_filter",
    "make_scene",
    "mesh",
    "quality_table",
    "read_deck",
    "register",
    "run",
    "run_batch",
    "sweep",
    "worst",
    "tradeoff",
    "load",
    "Result",
    "Robot",
    "McaError",
    "RequestError",
    "GuardError",
    "__version__",
]


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module 'warp_mca' has no attribute {name!r}")
    value = getattr(import_module(_LAZY[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
