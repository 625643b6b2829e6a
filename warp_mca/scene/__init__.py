"""Owns the public vocabulary of a scene: bodies, joints, contacts, drives, boundaries, phases.

A scene is plain, immutable data. Every class checks its own values and raises `RequestError` with the field, the value
and the remedy. Nothing here meshes, allocates or imports Warp.
"""

from warp_mca.scene.absorbing import Absorbing
from warp_mca.scene.amplitude import Amplitude
from warp_mca.scene.articulations import Articulation, Cylindrical, Universal
from warp_mca.scene.bodies import Body, Vec3
from warp_mca.scene.bolts import Bolt
from warp_mca.scene.bonds import Bond
from warp_mca.scene.contact_laws import DampedPenalty, Penalty
from warp_mca.scene.contacts import OVERLAP_CHOICES, Contact, ContactAll, RigidPlane, Surface
from warp_mca.scene.damping import Damping
from warp_mca.scene.drives import Fixed, Prescribed
from warp_mca.scene.freedoms import Controller, Coupler, Freedom, PositionServo
from warp_mca.scene.friction_laws import DecayingFriction, ShearCap
from warp_mca.scene.joints import Prismatic, Revolute, Spherical, Weld
from warp_mca.scene.loads import BodyForce, Force, Pressure, ThermalStrain, Traction
from warp_mca.scene.masses import PointMass
from warp_mca.scene.phases import BaseMotion, ImpactPhase, JointTorque, RigidPhase, Settle, Slide, Tip
from warp_mca.scene.probes import Line, Path, Point
from warp_mca.scene.scene import Scene
from warp_mca.scene.sensors import Probe, Section
from warp_mca.scene.springs import Spring
from warp_mca.scene.tied_surfaces import Tie

__all__ = [
    "OVERLAP_CHOICES",
    "Absorbing",
    "Amplitude",
    "Articulation",
    "BaseMotion",
    "Body",
    "BodyForce",
    "Bolt",
    "Bond",
    "Contact",
    "ContactAll",
    "Controller",
    "Coupler",
    "Cylindrical",
    "DampedPenalty",
    "Damping",
    "DecayingFriction",
    "Fixed",
    "Force",
    "Freedom",
    "ImpactPhase",
    "JointTorque",
    "Line",
    "Path",
    "Penalty",
    "Point",
    "PointMass",
    "PositionServo",
    "Prescribed",
    "Pressure",
    "Prismatic",
    "Probe",
    "Revolute",
    "RigidPhase",
    "RigidPlane",
    "Scene",
    "Section",
    "ShearCap",
    "Spherical",
    "Settle",
    "Slide",
    "Spring",
    "Surface",
    "ThermalStrain",
    "Tie",
    "Tip",
    "Traction",
    "Universal",
    "Vec3",
    "Weld",
]
