"""Owns the tables of keywords by format: what is read, what is refused, and what is left out with a warning."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import lru_cache

ELEMENTS = "elements"  # what is left out under this name is counted by the name of each type
OTHER = "other keywords"


@dataclass(frozen=True)
class Rules:
    """What a reader makes of each keyword; names may be patterns of `fnmatch`, and the first table that has
    one decides.

    Attributes:
        refused: keywords that would move, add or change nodes, cells or sets, and why.
        read: keywords that are read.
        silent: keywords that change nothing, or belong to others that are told.
        left_out: keywords that are counted in a warning, by kind; so are all that no table has.
    """

    refused: Mapping[str, str]
    read: tuple[str, ...]
    silent: tuple[str, ...]
    left_out: Mapping[str, tuple[str, ...]]

    def kind(self, keyword: str) -> str:
        """ "read", "" for silent, or the kind under which the keyword is left out.

        Raises:
            ValueError: it is refused.
        """
        return _kind(self, keyword)

    def __hash__(self) -> int:
        return id(self)


@lru_cache(maxsize=1000)
def _kind(rules: Rules, keyword: str) -> str:
    def is_in(patterns: Iterable[str]) -> str | None:
        return next((pattern for pattern in patterns if fnmatchcase(keyword, pattern)), None)

    if (pattern := is_in(rules.refused)) is not None:
        raise ValueError(f"{keyword} is not read: {rules.refused[pattern]}")
    if is_in(rules.read) is not None:
        return "read"
    if is_in(rules.silent) is not None:
        return ""
    return next((kind for kind, patterns in rules.left_out.items() if is_in(patterns) is not None), OTHER)


_PUTS_IN, _MOVES, _ADDS_NODES = "it puts another file in", "it moves nodes", "it adds nodes"
_ADDS_ELEMENTS, _REMOVES = "it adds elements", "it removes elements"
# Names without blanks, as CalculiX compares them.
ABAQUS_RULES = Rules(
    refused={
        "INCLUDE": _PUTS_IN,
        "MANIFEST": "it puts other files in",
        "PARAMETER": "it puts other numbers in",
        "IMPORT": "it puts the mesh of another analysis in",
        "NGEN": _ADDS_NODES,
        "NFILL": _ADDS_NODES,
        "NCOPY": _ADDS_NODES,
        "NMAP": _MOVES,
        "ELGEN": _ADDS_ELEMENTS,
        "ELCOPY": _ADDS_ELEMENTS,
        "SYMMETRICMODELGENERATION": _ADDS_ELEMENTS,
        "IMPERFECTION": _MOVES,
        "ADJUST": _MOVES,
    },
    read=(
        *("NODE", "ELEMENT", "NSET", "ELSET", "PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY"),
        *("INSTANCE", "ENDINSTANCE", "SYSTEM", "STEP", "ENDSTEP"),
    ),
    silent=(
        *("", "HEADING", "PREPRINT", "RESTART", "*OUTPUT", "*PRINT", "*FILE", "FILEFORMAT", "MONITOR", "TIMEPOINTS"),
        *("SOLIDSECTION", "SHELLSECTION", "BEAMSECTION", "MEMBRANESECTION", "FLUIDSECTION*", "USERSECTION"),
        *("BEAMGENERALSECTION", "SHELLGENERALSECTION", "SURFACESECTION", "CONNECTORSECTION"),
        *("TRANSFORM", "ORIENTATION", "NORMAL", "AMPLITUDE", "PHYSICALCONSTANTS"),
        *("SURFACEINTERACTION", "SURFACEBEHAVIOR", "SURFACEPROPERTY", "FRICTION", "CONTACTDAMPING", "GAP*"),
        *("NODALTHICKNESS", "DESIGNVARIABLES", "VALUESATINFINITY", "DISTRIBUTION", "DISTRIBUTIONTABLE"),
        *("MASS", "ROTARYINERTIA", "SPRING", "DASHPOT", "USERELEMENT", "MATRIX", "UELPROPERTY"),  # of their elements
        *("ELASTIC", "DENSITY", "PLASTIC", "EXPANSION", "CONDUCTIVITY", "SPECIFICHEAT", "DAMPING", "RATEDEPENDENT"),
        *("CYCLICHARDENING", "CREEP", "HYPERELASTIC", "HYPERFOAM", "VISCOELASTIC", "USERMATERIAL", "DEPVAR", "DAMAGE*"),
        *("DEFORMATIONPLASTICITY", "MOHRCOULOMB*", "DRUCKERPRAGER*", "FLUIDCONSTANTS", "SPECIFICGASCONSTANT"),
        *("MAGNETICPERMEABILITY", "ELECTRICALCONDUCTIVITY", "LATENTHEAT", "POROSITY", "PERMEABILITY", "TENSILEFAILURE"),
        *("KINEMATIC", "DISTRIBUTING"),  # of *COUPLING
    ),
    left_out={
        "materials": ("MATERIAL",),
        "rigid bodies": ("RIGIDBODY",),
        "added masses": ("NONSTRUCTURALMASS", "POINTMASS"),
        "constraints": (
            *("EQUATION", "MPC", "TIE", "COUPLING", "DISTRIBUTINGCOUPLING", "KINEMATICCOUPLING", "EMBEDDEDELEMENT"),
            *("SHELLTOSOLIDCOUPLING", "CYCLICSYMMETRYMODEL", "PRE-TENSIONSECTION", "PRETENSIONSECTION", "NETWORKMPC"),
            *("FASTENER", "CONNECTOR*", "RELEASE"),
        ),
        "boundary conditions and loads": (
            *("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "CFLUX", "DFLUX", "FILM", "RADIATE", "TEMPERATURE", "BASEMOTION"),
            *("INITIALCONDITIONS", "INITIALSTRAININCREASE", "SUBMODEL", "MASSFLOW", "PREDEFINEDFIELD"),
        ),
        "surfaces": ("SURFACE",),
        "contacts": ("CONTACT", "CONTACTPAIR", "CONTACTINCLUSIONS", "CONTACTPROPERTYASSIGNMENT", "CLEARANCE"),
        "reinforcements": ("REBAR", "REBARLAYER"),
        "removals of elements": ("MODELCHANGE",),
        "refinements": ("REFINEMESH", "USEREFINEDMESH"),
    },
)
NASTRAN_RULES = Rules(
    refused={
        "INCLUDE": _PUTS_IN,
        "=*": "it makes cards from those before",
        "/*": "it removes cards",
        "GRIDG": _ADDS_NODES,
        "EGRID": _ADDS_NODES,
        "CGEN": _ADDS_ELEMENTS,
    },
    read=("GRID", "GRDSET", "CHEXA", "CPENTA", "CPYRA", "CPYRAM", "CTETRA", "CORD*", "ENDDATA", "BEGIN*"),
    silent=(
        *("", "PARAM", "PSOLID", "PLSOLID", "PSHELL", "PCOMP*", "PBAR*", "PBEAM*", "PROD", "PTUBE", "PSHEAR", "PVISC"),
        *("PBUSH*", "PELAS*", "PDAMP*", "PGAP", "PMASS", "PWELD", "PFAST", "PCONV*", "PBEND", "PLPLANE", "PLOTEL*"),
        *("EIG*", "SET*", "TABLE*", "TABD*", "TSTEP*", "FREQ*", "DES*", "DRESP*", "DVPREL*", "DCONSTR", "DLINK"),
        *("NLPARM*", "NLPCI", "ASET*", "QSET*", "BSET*", "CSET*", "USET*", "ECHOON", "ECHOOFF", "AEFACT", "DTI"),
    ),
    left_out={
        "masses": ("CONM*", "CMASS*", "NSM*"),
        "rigid elements": ("RBE*", "RBAR*", "RROD", "RTRPLT*", "RJOINT", "RSPLINE", "RSSCON", "RBODY"),
        "constraints": ("SPC*", "MPC*", "SUPORT*", "SUPAX", "BNDFIX*", "BNDFREE*", "SPOINT", "EPOINT"),
        "contacts": ("BC*", "BS*", "BGSET", "BGADD", "BLSEG", "BFRIC", "CONTACT", "TIE"),
        "loads": (
            *("FORCE*", "MOMENT*", "PLOAD*", "GRAV", "RFORCE", "ACCEL*", "TEMP*", "LOAD*", "DLOAD", "LSEQ", "DAREA"),
            *("TLOAD*", "RLOAD*", "DELAY", "DPHASE", "TIC", "QBDY*", "QHBDY", "QVECT", "QVOL", "RADBC", "DEFORM"),
        ),
        "materials": ("MAT*",),
        ELEMENTS: ("C*", "GENEL"),
    },
)
KEYWORD_RULES = Rules(
    refused={
        "INCLUDE_*": _PUTS_IN,
        "PARAMETER_TYPE": "it puts other numbers in",
        "CASE*": "it chooses keywords",
        "DEFINE_TRANSFORMATION*": _MOVES,
        "NODE_TRANSFORM*": _MOVES,
        "NODE_REFERENCE*": _MOVES,
        "NODE_MERGE*": "it joins nodes",
        "NODE_TO_TARGET*": _MOVES,
        "PART_MOVE*": _MOVES,
        "PART_DUPLICATE*": _ADDS_ELEMENTS,
        "PART_STACKED_ELEMENTS*": _ADDS_ELEMENTS,
        "ELEMENT_GENERATE*": _ADDS_ELEMENTS,
        "ELEMENT_SOLID_*": "its cards are of another kind",
        "DELETE_*": _REMOVES,
        "PERTURBATION_NODE*": _MOVES,
        "SET_*_COLLECT*": "it adds to other sets",
    },
    read=(
        *("NODE", "ELEMENT_SOLID", "PART", "PART_CONTACT", "PART_PRINT", "KEYWORD*", "END"),
        *("SET_NODE", "SET_NODE_LIST", "SET_NODE_LIST_GENERATE", "SET_NODE_COLUMN", "SET_SEGMENT"),
        *("SET_SOLID", "SET_SOLID_GENERATE"),
    ),
    silent=("", "TITLE", "COMMENT*"),
    left_out={
        ELEMENTS: ("ELEMENT_*",),
        "inertias of parts": ("PART_INERTIA",),
        "materials": ("MAT_*", "EOS_*"),
        "constraints": ("CONSTRAINED_*", "RIGIDWALL_*"),
        "contacts": ("CONTACT_*",),
        "boundary conditions and loads": ("BOUNDARY_*", "LOAD_*", "INITIAL_*", "AIRBAG_*"),
        "sets": ("SET_*",),
        "nodes of other kinds": ("NODE_*",),
        "sections": ("SECTION_*",),
        "definitions": ("DEFINE_*",),
        "settings": ("CONTROL_*", "HOURGLASS*", "TERMINATION*", "USER_*"),
        "requests of output": ("DATABASE_*",),
    },
)
