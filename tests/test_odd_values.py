"""Tests that odd values in any field of the public classes are refused in a sentence, or run as what they stand for."""

from __future__ import annotations

import dataclasses
import inspect
import math
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca import geometry, scene
from warp_mca.base.errors import GuardError, RequestError
from warp_mca.scene import materials
from warp_mca.scene.joints import Joint
from warp_mca.scene.loads import Load
from warp_mca.verify.metals import METALS
from warp_mca.verify.rubber import FOAM, RUBBERS, VISCOUS

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
METAL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=4e8, E_t=1e9, beta=0.5)
LINE = mca.Line(body="low", start=(0.0, 0.005, 0.005), end=(0.01, 0.005, 0.005))
TOP = mca.Surface(body="low", nodes="ymax")
WALL = mca.RigidPlane(point=(0.0, -1.0, 0.0))
TIP = mca.Tip(body="up", centre=(0.005, 0.0, 0.005), radius=0.001)
SOUND: dict[type, Any] = {
    mca.Elastic: STEEL,
    mca.J2Bilinear: METAL,
    **{type(metal): metal for metal in METALS.values()},
    **{type(item): item for item in (*RUBBERS.values(), VISCOUS["elastic"], FOAM)},
    mca.Box: mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1)),
    mca.Rod: mca.Rod(radius=0.01, length=0.05, section=2, ring=1, axial=2, tip_layers=1, focus_layers=1),
    mca.LugRod: mca.LugRod(radius=0.01, length=0.06, section=4, ring=1, axial=2, tip_layers=1, focus_layers=1),
    mca.Sphere: mca.Sphere(radius=0.01, section=2, ring=1, pole_layers=1),
    mca.Plate: mca.Plate(
        length=0.1, width=0.1, height=0.05, core=(2, 2), core_depth=1, core_size=0.005, layers=2, extension=1
    ),
    mca.NestedPlate: mca.NestedPlate(length=0.1, width=0.1, height=0.05, core_size=0.002),
    mca.MeshFile: mca.MeshFile("none.vtu"),
    mca.Cad: mca.Cad("none.step", size=0.002),
    mca.Finer: mca.Finer((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1e-3),
    mca.Select: mca.Select("foot", low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 0.0)),
    mca.Point: mca.Point(body="low", at=(0.0, 0.0, 0.0)),
    mca.Line: LINE,
    mca.Path: mca.Path(name="p", lines=(LINE,), spacing=0.005),
    mca.Probe: mca.Probe(name="a", body="low", at=(0.0, 0.0, 0.0), cfc=1000.0),
    mca.Section: mca.Section(name="c", body="low", at=(0.0, 0.005, 0.0), normal=(0.0, 1.0, 0.0)),
    mca.Surface: TOP,
    mca.RigidPlane: WALL,
    mca.ContactAll: mca.ContactAll(mu=0.3, exclude=(("low", "low"),)),
    mca.Contact: mca.Contact(slave=mca.Surface(body="up", nodes="ymin"), master=TOP, mu=0.3, penalty=1.0),
    mca.Penalty: mca.Penalty(),
    mca.DampedPenalty: mca.DampedPenalty(time=1e-6, speed=0.1),
    mca.Bond: mca.Bond(normal=1e6, shear=1e6, gap=0.5),
    mca.Damping: mca.Damping(body="low", mass=1.0, loss_factor=0.1, band=(10.0, 20.0)),
    mca.DecayingFriction: mca.DecayingFriction(kinetic=0.2, decay=2.0),
    mca.ShearCap: mca.ShearCap(tau_max=1e8),
    mca.Revolute: mca.Revolute(name="O", body="up", at=(0.0, 0.0, 0.0)),
    mca.Weld: mca.Weld(name="W", body="up", nodes="ymax"),
    mca.Spherical: mca.Spherical(name="S", body="up", at=(0.0, 0.0, 0.0)),
    mca.Prismatic: mca.Prismatic(name="P", body="up", nodes="ymax", axis=(1.0, 0.0, 0.0)),
    geometry.InertiaBrick: geometry.InertiaBrick(mass=1.0, centre=(0.0, 0.0, 0.0), inertia=(1.0, 1.0, 1.0)),
    mca.Freedom: mca.Freedom(at=(0.0, 0.0, 0.0), stiffness=1.0, limits=(0.0, 1.0)),
    mca.Coupler: mca.Coupler(joint="A", freedom=1, ratio=2.0),
    mca.PositionServo: mca.PositionServo(kp=1.0, kv=0.1, target=0.5, limits=(-1.0, 1.0)),
    mca.Controller: mca.Controller(function=lambda t, q, rate: -q, period=1e-7),
    mca.Articulation: mca.Articulation(name="A", body="low", freedoms=(mca.Freedom(),)),
    mca.Universal: mca.Universal(name="U", body="low", axis=(1.0, 0.0, 0.0), second_axis=(0.0, 1.0, 0.0)),
    mca.Cylindrical: mca.Cylindrical(name="C", body="low", axis=(1.0, 0.0, 0.0)),
    mca.Fixed: mca.Fixed(body="low", nodes="ymin"),
    mca.PointMass: mca.PointMass(body="low", mass=1e-3, at=(0.0, 0.0, 0.0)),
    mca.Prescribed: mca.Prescribed(body="low", nodes="ymin", axis="x", times=(0.0, 1.0), velocities=(0.0, 1.0)),
    mca.Amplitude: mca.Amplitude(times=(0.0, 1.0), values=(0.0, 1.0)),
    mca.Pressure: mca.Pressure(body="low", nodes="ymin", pressure=1e5),
    mca.Traction: mca.Traction(body="low", nodes="ymin", traction=(1e5, 0.0, 0.0)),
    mca.Force: mca.Force(body="low", nodes="ymin", force=(1.0, 0.0, 0.0)),
    mca.BodyForce: mca.BodyForce(body="low", acceleration=(1.0, 0.0, 0.0)),
    mca.ThermalStrain: mca.ThermalStrain(body="low", expansion=1e-5, temperature=1.0),
    mca.Absorbing: mca.Absorbing(body="low", nodes="ymin", centre=(0.0, 0.0, 0.0)),
    mca.Tip: TIP,
    mca.RigidPhase: mca.RigidPhase(theta=(1.0,), theta_dot=(0.0,), tip=TIP, target=WALL, t_max=0.01),
    mca.Settle: mca.Settle(duration=1e-3),
    mca.ImpactPhase: mca.ImpactPhase(duration=1e-7, output_interval=1e-7),
    mca.BaseMotion: mca.BaseMotion(times=(0.0, 1.0), vx=(0.0, 1.0), vy=(0.5, 0.0)),
    mca.Spring: mca.Spring(
        name="s",
        body="low",
        at=(0.0, 0.0, 0.0),
        other_at=(0.0, -0.1, 0.0),
        stiffness=1.0,
        speeds=(0.0, 1.0),
        damping_forces=(0.0, 1.0),
        length=0.1,
        preload=1.0,
    ),
    mca.Bolt: mca.Bolt(
        name="b",
        body="low",
        at=(0.0, 0.0, 0.0),
        other="up",
        other_at=(0.0, 0.01, 0.0),
        diameter=0.01,
        reach=0.03,
    ),
    mca.Slide: mca.Slide(direction=(1.0, 0.0, 0.0), carriage_mass=0.1, velocity=0.1),
    mca.JointTorque: mca.JointTorque(joint="O", times=(0.0, 1.0), torques=(0.0, 1.0)),
}
SOUND[mca.Part] = mca.Part(name="a", geometry=SOUND[mca.Box])
SOUND[mca.Parts] = mca.Parts(parts=(SOUND[mca.Part],))
SOUND[mca.Tie] = mca.Tie(slave=mca.Surface(body="up", nodes="ymin"), master=TOP, gap=0.5)
SOUND[mca.Body] = mca.Body(name="low", geometry=SOUND[mca.Box], material=STEEL)
SOUND[mca.Scene] = mca.Scene(
    name="s",
    bodies=(SOUND[mca.Body], dataclasses.replace(SOUND[mca.Body], name="up", position=(0.0, 0.0101, 0.0))),
    impact=SOUND[mca.ImpactPhase],
)
HALF = Fraction(1, 2)  # one number in many types: where they are taken, one run tries them all
ODD = [
    None,
    True,
    np.True_,
    math.nan,
    math.inf,
    2**70,
    -(2**70),
    10**400,
    10**5000,
    HALF,
    Fraction(10**400),
    Decimal("0.5"),
    1e300,
    1e-300,
    5e-324,
    0,
    1j,
    b"x",
    bytearray(b"abc"),
    "",
    "x\0y",
    "\ud800",
    "x" * 5000,
    {},
    {1: 2},
    {"*": 5},
    [],
    [[]],
    (None, None, None),
    [HALF, 0, 0],
    (2**70, 0, 0),
    [2**70],
    [1e300],
    (10**400, 0, 0),
    (Decimal(1), 0, 0),
    ("0", "0", "0"),
    [math.nan] * 3,
    range(3),
    np.float32(0.5),
    np.int64(2),
    np.longdouble("0.5"),
    np.array(0.5),
    np.array(2),
    np.array([0.5, 0.0, 0.0]),
    np.array([2, 2, 2]),
    np.array([0.0, 1.0]),
    np.array(["x", "y"]),
    np.array([None, 1, "x"], dtype=object),
    np.zeros((3, 3)),
    np.zeros(1000),
    np.array("x"),
    object(),
    int,
    lambda: None,
]


def scene_with(item: Any) -> mca.Scene:
    """A scene of two boxes, one above the other, in which the item takes part."""
    whole: mca.Scene = SOUND[mca.Scene]
    low, up = whole.bodies
    change: dict[str, Any] = {}
    match item:
        case mca.Scene():
            return item
        case mca.ImpactPhase():
            change = {"impact": item}
        case mca.RigidPhase() | mca.Tip():
            phase = item if isinstance(item, mca.RigidPhase) else dataclasses.replace(SOUND[mca.RigidPhase], tip=item)
            change = {"rigid": phase, "joints": (SOUND[mca.Revolute],), "gravity": (0.0, -9.81, 0.0)}
        case mca.BaseMotion() | mca.Slide() | mca.JointTorque():
            name = {mca.BaseMotion: "base_motion", mca.Slide: "slide", mca.JointTorque: "torques"}[type(item)]
            loads = {name: (item,) if name == "torques" else item}
            return scene_with(dataclasses.replace(SOUND[mca.RigidPhase], **loads))
        case mca.Elastic():
            own: dict[str, Any] = {"kinematics": "finite"} if item.finite_only else {}
            if type(item) in (mca.NeoHookean, mca.MooneyRivlin, mca.Ogden, mca.Prony, mca.CrushableFoam):
                own["element"] = "hex8r" if isinstance(item, mca.CrushableFoam) else "tet4"  # which compile sooner
            change = {"bodies": (dataclasses.replace(low, material=item, **own), up)}
        case mca.Part():
            change = {"bodies": (dataclasses.replace(low, geometry=mca.Parts(parts=(item,))), up)}
        case (
            geometry.InertiaBrick()
            | mca.Box()
            | mca.Rod()
            | mca.Sphere()
            | mca.Plate()
            | mca.NestedPlate()
            | mca.Parts()
        ):
            change = {"bodies": (dataclasses.replace(low, geometry=item), up)}
        case mca.Select():
            return scene_with(dataclasses.replace(SOUND[mca.MeshFile], select=(item,)))
        case mca.Finer():
            return scene_with(dataclasses.replace(SOUND[mca.Cad], finer=(item,)))
        case mca.MeshFile() | mca.Cad() | mca.Mesh():
            change = {"bodies": (dataclasses.replace(low, geometry=item), up)}
        case mca.Body():
            change = {"bodies": (item, up)}
        case mca.Amplitude():
            change = {"loads": (dataclasses.replace(SOUND[mca.Pressure], amplitude=item),)}
        case Load():
            change = {"loads": (item,)}
        case mca.Freedom():
            return scene_with(mca.Articulation(name="A", body="low", freedoms=(item,)))
        case mca.Coupler():
            freedoms = (mca.Freedom(), mca.Freedom(axis=(1.0, 0.0, 0.0), follows=item))
            return scene_with(mca.Articulation(name="A", body="low", freedoms=freedoms))
        case mca.PositionServo() | mca.Controller():
            return scene_with(mca.Freedom(motor=item))
        case Joint() if item.whole() is not None:
            change = {"joints": (item,), "bodies": (dataclasses.replace(low, rigid=True), up)}
        case Joint():
            change = {"joints": (item,)}
        case mca.Penalty() | mca.DampedPenalty():
            change = {"contacts": (dataclasses.replace(SOUND[mca.Contact], law=item),)}
        case mca.Bond():
            change = {"contacts": (dataclasses.replace(SOUND[mca.Contact], bond=item),)}
        case mca.DecayingFriction() | mca.ShearCap():
            change = {"contacts": (dataclasses.replace(SOUND[mca.Contact], friction=item),)}
        case mca.Surface() | mca.RigidPlane():
            change = {"contacts": (dataclasses.replace(SOUND[mca.Contact], master=item),)}
        case mca.Line():
            change = {"paths": (dataclasses.replace(SOUND[mca.Path], lines=(item,)),)}
        case mca.Section():
            halves = mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 2, 1))
            change = {"sections": (item,), "bodies": (dataclasses.replace(low, geometry=halves), up)}
        case _:
            name = {
                mca.Point: "tip",
                mca.Path: "paths",
                mca.Probe: "probes",
                mca.Contact: "contacts",
                mca.ContactAll: "contacts",
                mca.Fixed: "fixed",
                mca.Prescribed: "prescribed",
                mca.Absorbing: "absorbing",
                mca.Damping: "loads",
                mca.Spring: "loads",
                mca.Bolt: "loads",
                mca.PointMass: "masses",
                mca.Tie: "ties",
                mca.Settle: "phases",
            }[type(item)]
            change = {name: item if name == "tip" else (item,)}
    return dataclasses.replace(whole, **change)


def test_every_public_class_is_tried():
    found = [item for module in (scene, materials, geometry) for item in vars(module).values()]
    public = [item for item in found if inspect.isclass(item) and dataclasses.is_dataclass(item)]
    assert {*public} - {mca.Mesh} == {*SOUND}


def fields() -> list[Any]:
    return [
        pytest.param(kind, field.name, id=f"{kind.__name__}.{field.name}")
        for kind in SOUND
        for field in dataclasses.fields(kind)
        if field.init
    ]


@pytest.mark.parametrize(("kind", "name"), fields())
@pytest.mark.filterwarnings("error")
def test_odd_values_are_refused_in_a_sentence_or_run(kind: type, name: str, monkeypatch: pytest.MonkeyPatch):
    """No traceback and no warning of NumPy, until a few steps are done."""
    monkeypatch.setattr("warp_mca.phases.division.MAX_STEPS", 1000)
    sound, tried = SOUND[kind], []
    for value in ODD:
        try:
            item = dataclasses.replace(sound, **{name: value})
            if repr(item) in tried:
                continue
            tried.append(repr(item))
            if repr(item) == repr(sound):
                continue
            mca.run(scene_with(item))
        except (RequestError, GuardError) as error:
            assert "\n" not in str(error)
            assert len(str(error)) < 1000
            assert isinstance(error, RequestError) or any(
                words in str(error) for words in ("sank deeper", "exceed the range of numbers")
            )  # of planes inside a body; of cells too small for the squares of their gradients


@pytest.mark.parametrize(
    "name", ["refine", "penalty", "mass_scaling", "multi_rate", "precision", "time_step_scale", "element"]
)
@pytest.mark.filterwarnings("error")
def test_odd_values_of_an_accuracy_are_refused(name: str):
    """Values that must stay, and shares; None stands for no added mass, the default springs and one rate."""
    with pytest.raises(RequestError, match=rf"{name}.* = 'y': "):
        mca.Accuracy(share=0.02, typed={name: "y"})
    for value in ODD:
        for asked in ({"share": value}, {"share": 0.02, "typed": {name: value}}, {"share": 0.02, "typed": value}):
            try:
                mca.Accuracy(**asked)
            except RequestError as error:
                assert "\n" not in str(error)
                assert len(str(error)) < 1000


def test_an_accuracy_keeps_options_and_parameters_of_its_scene():
    """Other names are refused; with those of options and parameters the request goes on to the next check."""
    scene = mca.make_scene("hertz_sphere")
    typed = {"penalty": 3.0, "refine": 1.0, "mass_scaling": "2e-8s", "multi_rate": "auto", "element": "hex8r", "v": 2.0}
    with pytest.raises(RequestError, match="store nothing on the way"):
        mca.run(scene, accuracy=mca.Accuracy(share=0.02, typed=typed), method="pure-fem")
    with pytest.raises(
        RequestError, match=r"^Accuracy\.typed\['nonsense'\] = 1\.0: .* choose among refine, .*, radius"
    ):
        mca.run(scene, accuracy=mca.Accuracy(share=0.02, typed={"nonsense": 1.0}))
