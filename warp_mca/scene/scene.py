"""Owns `Scene`: everything that a run needs to know, checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from types import NoneType

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.absorbing import Absorbing
from warp_mca.scene.articulations import check_whole
from warp_mca.scene.bodies import Body, Vec3
from warp_mca.scene.bolts import check_bolts
from warp_mca.scene.contacts import Contact, ContactAll, RigidPlane, Surface
from warp_mca.scene.criteria import check_criteria
from warp_mca.scene.drives import Fixed, Prescribed
from warp_mca.scene.failure import check_contacts
from warp_mca.scene.joints import JOINTS, Joint
from warp_mca.scene.loads import LOADS, Load
from warp_mca.scene.masses import PointMass
from warp_mca.scene.phases import PHASES, ImpactPhase, RigidPhase, check_t_end
from warp_mca.scene.probes import Path, Point
from warp_mca.scene.sensors import Probe, Section, check_class
from warp_mca.scene.tied_surfaces import Tie
from warp_mca.scene.wrists import without_shared_nodes

_PARTS = {
    "bodies": Body,
    "contacts": (Contact, ContactAll),
    "ties": Tie,
    "fixed": Fixed,
    "prescribed": Prescribed,
    "absorbing": Absorbing,
    "masses": PointMass,
    "paths": Path,
    "probes": Probe,
    "sections": Section,
}

FINEST = 1000.0  # factor by which `Scene.refine` may make cells smaller, or larger [-]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything that a run needs to know.

    Attributes:
        name: of the scene.
        bodies: at least one.
        impact: the finite-element phase.
        rigid: the rigid phase before it, or None: then the bodies' own initial motion applies.
        t_end: the run goes through as many swings and impacts as occur until then, counted from the release [s]; None
            for one impact.
        phases: of finite elements that come before the impact, in their order, as `(Settle(),)`.
        joints, contacts, fixed, prescribed, ties: what binds the bodies; contacts="all" stands for (ContactAll(),).
        absorbing: sides of bodies through which waves leave.
        masses: point masses on bodies.
        loads: forces on nodes in the impact phase, of the kinds in `scene.loads.LOADS`.
        gravity: [m/s^2].
        up: direction that points up in pictures [-], of any length; None takes the one opposite to gravity, else the
            normal of the first rigid plane, else y.
        paths: lines along which stress is recorded.
        probes: points and node sets whose motion is recorded.
        sections: cuts through bodies whose resultants are recorded.
        tip: point whose velocity the history lists as tip_vx, tip_vy, tip_vz.
        target: point whose velocity the history lists as plate_vx, plate_vy, plate_vz.
        criteria: what must hold, see `scene.criteria`, as ("max_von_mises(shell) < 60e6",).
        refine: how many times smaller the cells of all bodies are to be than their recipes say [-], with their
            grading; above 1 is finer, below coarser.
        parameters: the values that a built-in scene was made from, for the record.
    """

    name: str
    bodies: tuple[Body, ...]
    impact: ImpactPhase
    rigid: RigidPhase | None = None
    t_end: float | None = None
    phases: tuple[object, ...] = ()
    joints: tuple[Joint, ...] = ()
    contacts: tuple[Contact | ContactAll, ...] = ()
    fixed: tuple[Fixed, ...] = ()
    prescribed: tuple[Prescribed, ...] = ()
    absorbing: tuple[Absorbing, ...] = ()
    ties: tuple[Tie, ...] = ()
    masses: tuple[PointMass, ...] = ()
    loads: tuple[Load, ...] = ()
    paths: tuple[Path, ...] = ()
    probes: tuple[Probe, ...] = ()
    sections: tuple[Section, ...] = ()
    gravity: Vec3 = (0.0, 0.0, 0.0)
    up: Vec3 | None = None
    tip: Point | None = None
    target: Point | None = None
    criteria: tuple[str, ...] = ()
    refine: float = 1.0
    parameters: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.contacts, str):
            if self.contacts != "all":
                raise bad_value("Scene.contacts", self.contacts, 'give contacts, or "all" for general contact')
            object.__setattr__(self, "contacts", (ContactAll(),))
        validate.plain(self)
        validate.texts("Scene", name=self.name)
        for name, kind in _PARTS.items():
            validate.members("Scene", kind, **{name: getattr(self, name)})
        self._check_kinds("joints", JOINTS)
        self._check_kinds("loads", LOADS)
        validate.kinds("Scene", ImpactPhase, "give an ImpactPhase", impact=self.impact)
        validate.kinds("Scene", (RigidPhase, NoneType), "give a RigidPhase or None", rigid=self.rigid)
        check_t_end(self)
        self._check_phases()
        if self.masses and self.rigid:
            raise bad_value("Scene.masses", "PointMass", "links of a RigidPhase take none; leave one of them out")
        validate.within("Scene", 1.0 / FINEST, FINEST, refine=self.refine)
        validate.kinds("Scene", (Point, NoneType), "give a Point or None", tip=self.tip, target=self.target)
        validate.kinds("Scene", Mapping, "give a dict of values by name", parameters=self.parameters)
        for key in self.parameters:
            validate.kind_of("Scene.parameters", key, str, "give each value under its name, a text")
        names = [body.name for body in self.bodies]
        if not names:
            raise bad_value("Scene.bodies", (), "give at least one body")
        validate.unique("Scene.bodies", names, "body")
        validate.unique("Scene.paths", [path.name for path in self.paths], "path")
        sensors = [item.name for item in (*self.probes, *self.sections)]
        validate.unique("Scene.probes", sensors, "probe and each section")
        validate.unique("Scene.contacts", contacts := [c.name for c in self.contacts if c.name is not None], "contact")
        if shared := sorted(set(sensors) & set(contacts)):
            raise bad_value("Scene.probes", shared, "contacts have these names too, and columns of tables; rename them")
        validate.unique("Scene.joints", [joint.name for joint in self.joints], "joint")
        if len(self.contacts) > len(self.listed) + 1:
            raise bad_value("Scene.contacts", "ContactAll", "give one, and list pairs that differ from it as Contacts")
        pairs = [(item.slave, item.master) for item in self.listed]
        for slave, master in pairs:
            if pairs.count((slave, master)) > 1:
                what = f"{slave.nodes} of {slave.body}"
                raise bad_value("Scene.contacts", what, "it meets the same master twice; list each pair once")
        validate.vectors("Scene", gravity=self.gravity)
        if self.up is not None:
            validate.directions("Scene", up=self.up)
        check_contacts(self.failing, self.contacts)
        for field_name, body in self._named_bodies():
            if body not in names:
                raise bad_value(field_name, body, f"the scene's bodies are {', '.join(names)}")
        check_whole(self)
        check_bolts(self)
        if self.general and not self.general_pairs():
            remedy = "no pair is left to it: bodies are listed, bound to each other, excluded or rigid; leave it out"
            raise bad_value("Scene.contacts", "ContactAll", remedy)
        for probe in self.probes:
            if probe.cfc is not None:
                check_class(f"{probe.title}.cfc", probe.cfc, self.impact.output_interval)
        check_criteria(self)
        for section in self.sections:
            if section.body in self.rigid_names:
                raise bad_value(f"{section.title}.body", section.body, "it is rigid, without stress; cut another body")

    def _check_kinds(self, name: str, table: Mapping[str, type]) -> None:
        """Refuse what is not of a class in a table.

        Raises:
            RequestError: there is such an object.
        """
        validate.kind_of(f"Scene.{name}", getattr(self, name), (tuple, list), f"give a tuple of {name}")
        for k, item in enumerate(getattr(self, name)):
            if type(item) not in table.values():
                remedy = f"give a {' or a '.join(table) or 'Load'}; register other classes by warp_mca.register"
                raise bad_value(f"Scene.{name}[{k}]", validate.brief(item), remedy)

    def _check_phases(self) -> None:
        """Refuse phases that are not known, or that cannot come before this impact.

        Raises:
            RequestError: as described.
        """
        validate.kind_of("Scene.phases", self.phases, (tuple, list), "give a tuple of phases, as (mca.Settle(),)")
        for k, phase in enumerate(self.phases):
            if type(phase) not in PHASES.values():
                remedy = f"give {' or '.join(PHASES)}; register other classes by warp_mca.register"
                raise bad_value(f"Scene.phases[{k}]", validate.brief(phase), remedy)
        if self.phases and self.failing:
            raise bad_value("Scene.phases", self.phases, f"elements of {self.failing[0]} may fail in an impact alone")
        timed = {"rigid": self.rigid, "prescribed": self.prescribed}
        timed |= {"loads": [load.title for load in self.loads if not load.is_constant]}
        for name, given in timed.items() if self.phases else ():
            if given:
                raise bad_value(f"Scene.{name}", given, "its times count from the impact; leave it or phases out")

    @property
    def _held(self) -> tuple[Fixed | Prescribed | Absorbing, ...]:
        return (*self.fixed, *self.prescribed, *self.absorbing)

    def _surfaces(self) -> list[tuple[str, Surface]]:
        """Surfaces that the scene names, each with the field."""
        named: list[tuple[str, object]] = [("Contact.slave", item.slave) for item in self.listed]
        named += [("Contact.master", item.master) for item in self.listed]
        named += [(f"{tie.title}.{name}", getattr(tie, name)) for tie in self.ties for name in ("slave", "master")]
        named += [("RigidPhase.target", self.rigid.target)] if self.rigid else []
        return [(field, surface) for field, surface in named if isinstance(surface, Surface)]

    def _named_bodies(self) -> list[tuple[str, str]]:
        named = [(f"{type(item).__name__}.body", item.body) for item in (*self._held, *self.masses)]
        named += [(f"{load.label}.{key}", body) for load in self.loads for key, body in load.bodies().items()]
        named += [(f"{item.title}.body", item.body) for item in self.joints]
        named += [(f"{item.title}.other", item.other) for item in self.joints if item.other is not None]
        named += [(f"{field}.body", surface.body) for field, surface in self._surfaces()]
        excluded = self.general.exclude if self.general else ()
        named += [("ContactAll.exclude", name) for pair in excluded for name in pair]
        named += [(f"Path {path.name}.body", line.body) for path in self.paths for line in path.lines]
        named += [(f"{item.title}.body", item.body) for item in (*self.probes, *self.sections)]
        named += [(f"Scene.{key}.body", p.body) for key, p in (("tip", self.tip), ("target", self.target)) if p]
        if self.rigid:
            named.append(("RigidPhase.tip.body", self.rigid.tip.body))
        return named

    def named_sets(self) -> list[tuple[str, str, str, bool]]:
        """Node sets that the scene names: the field, the body, the set, and whether it must cover faces."""
        named = [
            (f"{type(item).__name__}.nodes", item.body, item.nodes, isinstance(item, Absorbing)) for item in self._held
        ]
        named += [(f"{load.label}.{key}", *own) for load in self.loads for key, own in load.sets().items()]
        for joint in self.acting_joints:
            named += [(f"{joint.title}.{key}", *own, False) for key, own in joint.sets().items()]
        named += [(f"{field}.nodes", surface.body, surface.nodes, True) for field, surface in self._surfaces()]
        points = (*self.probes, *self.masses)
        return named + [(f"{p.title}.nodes", p.body, p.nodes, False) for p in points if p.nodes is not None]

    @property
    def acting_joints(self) -> tuple[Joint, ...]:
        """The joints as a run takes them: pins and balls of rigid bodies whose nodes would be the same take none."""
        return without_shared_nodes(self)

    @property
    def listed(self) -> tuple[Contact, ...]:
        """The contacts of two listed surfaces."""
        return tuple(item for item in self.contacts if isinstance(item, Contact))

    @property
    def general(self) -> ContactAll | None:
        """The general contact."""
        return next((item for item in self.contacts if isinstance(item, ContactAll)), None)

    def general_pairs(self) -> list[tuple[str, str]]:
        """Pairs of bodies that the general contact keeps apart, bodies with themselves too, each pair once.

        Not those that are excluded, listed, bound by a joint or a tie, both rigid, or one without geometry.
        """
        if self.general is None:
            return []
        out = {frozenset(pair) for pair in self.general.exclude} | {
            frozenset(item.sides) for item in self.listed if isinstance(item.master, Surface)
        }
        out |= {frozenset((joint.body, joint.other)) for joint in self.joints if joint.other is not None}
        out |= {frozenset((tie.slave.body, tie.master.body)) for tie in self.ties}
        out |= {frozenset(pair) for pair in combinations_with_replacement(self.rigid_names, 2)}
        out |= {frozenset((a.name, b.name)) for a in self.bodies if a.is_inertia for b in self.bodies}
        if not self.general.self_contact:
            out |= {frozenset((body.name,)) for body in self.bodies}
        pairs = combinations_with_replacement([body.name for body in self.bodies], 2)
        return [pair for pair in pairs if frozenset(pair) not in out]

    def surface_pairs(self) -> list[tuple[Surface, Surface | RigidPlane]]:
        """Surfaces of different bodies, or planes, that the contacts keep apart; those of the general one are skins."""
        skins = {body.name: Surface(body=body.name, nodes="boundary") for body in self.bodies}
        found: list[tuple[Surface, Surface | RigidPlane]] = [(item.slave, item.master) for item in self.listed]
        return found + [(skins[one], skins[other]) for one, other in self.general_pairs() if one != other]

    @property
    def failing(self) -> list[str]:
        """Deformable bodies whose elements may fail."""
        return [body.name for body in self.bodies if body.fails and not body.rigid]

    @property
    def rigid_names(self) -> list[str]:
        """Bodies that move as rigid ones in the impact phase."""
        return [body.name for body in self.bodies if body.rigid]

    @property
    def stress_paths(self) -> tuple[Path, ...]:
        """The paths without their lines in rigid bodies, which have no stress; those that have no line left are out."""
        if not self.rigid_names:
            return self.paths
        kept = [[line for line in path.lines if not self.body(line.body).rigid] for path in self.paths]
        return tuple(replace(path, lines=tuple(lines)) for path, lines in zip(self.paths, kept, strict=True) if lines)

    def body(self, name: str) -> Body:
        """The body of that name."""
        return next(body for body in self.bodies if body.name == name)
