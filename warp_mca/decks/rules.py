"""Owns the tables of keywords: what a scene takes of a deck, what changes nothing, and what is left to this program."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase

# By the part of a scene that reads them; `_ID` behind contacts, walls and conditions names them.
READ: dict[str, tuple[str, ...]] = {
    "mesh": ("NODE", "ELEMENT_SOLID"),
    "part": ("PART",),
    "section": ("SECTION_SOLID",),
    "elastic": ("MAT_ELASTIC", "MAT_001", "MAT_1"),
    "kinematic": ("MAT_PLASTIC_KINEMATIC", "MAT_003", "MAT_3"),
    "johnson_cook": ("MAT_JOHNSON_COOK", "MAT_015", "MAT_15"),
    "rigid": ("MAT_RIGID", "MAT_020", "MAT_20"),
    "piecewise": ("MAT_PIECEWISE_LINEAR_PLASTICITY", "MAT_024", "MAT_24"),
    "eos": ("EOS_LINEAR_POLYNOMIAL", "EOS_001", "EOS_1"),
    "curve": ("DEFINE_CURVE",),
    "box": ("DEFINE_BOX",),
    "system": ("DEFINE_COORDINATE_SYSTEM", "DEFINE_COORDINATE_NODES", "DEFINE_COORDINATE_VECTOR"),
    "node_set": ("SET_NODE", "SET_NODE_LIST", "SET_NODE_LIST_GENERATE", "SET_NODE_COLUMN", "SET_NODE_GENERAL"),
    "part_set": ("SET_PART", "SET_PART_LIST", "SET_PART_LIST_GENERATE", "SET_PART_COLUMN"),
    "segment_set": ("SET_SEGMENT",),
    "velocity": (
        *("INITIAL_VELOCITY", "INITIAL_VELOCITY_NODE", "INITIAL_VELOCITY_GENERATION"),
        *("INITIAL_VELOCITY_RIGID_BODY",),
    ),
    "held": ("BOUNDARY_SPC_NODE", "BOUNDARY_SPC_NODE_ID", "BOUNDARY_SPC_SET", "BOUNDARY_SPC_SET_ID"),
    "wall": ("RIGIDWALL_PLANAR", "RIGIDWALL_PLANAR_ID", "RIGIDWALL_PLANAR_FORCES", "RIGIDWALL_PLANAR_FORCES_ID"),
    "gravity": ("LOAD_BODY_X", "LOAD_BODY_Y", "LOAD_BODY_Z"),
    "termination": ("CONTROL_TERMINATION",),
    "time_step": ("CONTROL_TIMESTEP",),
    "viscosity": ("CONTROL_BULK_VISCOSITY",),
    "contact_control": ("CONTROL_CONTACT",),
    "contact": tuple(
        f"CONTACT_{kind}{name}"
        for name in ("", "_ID")
        for kind in (
            *("AUTOMATIC_SINGLE_SURFACE", "AUTOMATIC_SURFACE_TO_SURFACE", "AUTOMATIC_NODES_TO_SURFACE"),
            *("AUTOMATIC_ONE_WAY_SURFACE_TO_SURFACE", "SURFACE_TO_SURFACE", "NODES_TO_SURFACE"),
            *("ONE_WAY_SURFACE_TO_SURFACE", "TIED_SURFACE_TO_SURFACE", "TIED_NODES_TO_SURFACE"),
            *("TIED_SURFACE_TO_SURFACE_OFFSET", "TIED_NODES_TO_SURFACE_OFFSET"),
        )
    ),
}
WORDS = ("", "KEYWORD*", "TITLE", "COMMENT*")  # that no reader of a deck misses
# Requests of output, checks, what belongs to elements that are refused, sets that nothing read names.
HARMLESS = (
    *("DATABASE_*", "CONTROL_OUTPUT", "CONTROL_ENERGY", "CONTROL_SHELL"),
    *("CONTROL_CPU", "CONTROL_PARALLEL", "CONTROL_MPP_*", "CONTROL_CHECK*", "CONTROL_STRUCTURED*", "CONTROL_UNITS"),
    *("CONTACT_FORCE_TRANSDUCER*", "SET_SHELL*", "SET_BEAM*", "SET_SOLID*", "SET_DISCRETE*", "DEFINE_BOX_ADAPTIVE"),
    *("SECTION_SHELL*", "SECTION_BEAM*", "SECTION_DISCRETE*"),
    *("SENSOR_DEFINE*", "SENSOR_SWITCH*"),  # *SENSOR_CONTROL alone acts on them: it switches contacts and supports
)
# Settings of numerics, for which the elements, contacts and time steps of this program have their own.
NUMERICS = ("CONTROL_HOURGLASS", "HOURGLASS", "CONTROL_ACCURACY", "CONTROL_SOLID", "CONTROL_RIGID", "CONTROL_BULK_*")
# Keywords that mean something without cards, as what stands between them holds in one case alone.
BARE = ("CASE_*", "CASE")


def kind(name: str) -> str | None:
    """Key in READ, "" for words, "harmless" for what changes no result, "numerics", or None if it is not understood."""
    if found := next((key for key, names in READ.items() if name in names), None):
        return found
    kinds = {"": WORDS, "harmless": HARMLESS, "numerics": NUMERICS}
    return next((key for key, patterns in kinds.items() if is_in(name, patterns)), None)


def is_in(name: str, patterns: Iterable[str]) -> bool:
    """Whether a keyword is one of the patterns of `fnmatch`."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)
