"""Owns the reading of a robot's file by MuJoCo: what a machine may hold, and how it is compiled for a swing."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.robots.switches import take_out

if TYPE_CHECKING:
    from warp_mca.robots.masses import MassProperties
    from warp_mca.robots.robot import Robot

SUFFIXES = (".xml", ".mjcf", ".urdf")
PACKAGE = "package:/"  # begins names of meshes that ROS finds; MuJoCo takes two slashes for one
EXACT = 1e-12  # of MuJoCo's distances of convex geoms [m]


def mujoco(what: str, value: object) -> Any:
    """The module `mujoco`, for a field that needs it.

    Raises:
        RequestError: it is not installed.
    """
    try:
        import mujoco as found
    except ImportError as error:
        raise bad_value(what, value, 'MuJoCo reads it; install it with pip install "warp_mca[robots]"') from error
    return found


def compiled(robot: Robot) -> tuple[Any, Any]:
    """The `MjSpec` and `MjModel` of a robot.

    Fixed links are bodies of their own; contact, limits and dry friction are left to us.

    Raises:
        RequestError: the file cannot be read, or holds what a machine does not carry.
    """
    mj = mujoco("Robot.file", robot.path)
    spec = _parsed(mj, robot)
    spec.compiler.fusestatic = False
    spec.option.jacobian = mj.mjtJacobian.mjJAC_DENSE
    spec.option.ccd_tolerance, spec.option.ccd_iterations = EXACT, 500
    spec.option.enableflags &= ~int(mj.mjtEnableBit.mjENBL_SLEEP)
    _add_servos(mj, spec, robot)
    model = _compiled(robot, spec)
    for sentence in _refused(mj, model):
        raise bad_value("Robot.file", robot.path, sentence)
    return spec, model


def with_masses(mj: Any, robot: Robot, spec: Any, masses: Mapping[str, MassProperties]) -> Any:
    """The model with other masses, centres and inertias of some links, by name.

    Raises:
        RequestError: MuJoCo refuses it.
    """
    for name, own in masses.items():
        moments, axes = np.linalg.eigh(own.inertia)
        axes[:, 2] *= np.linalg.det(axes)
        turned = np.zeros(4)
        mj.mju_mat2Quat(turned, axes.reshape(-1))
        body = spec.body(name)
        body.explicitinertial, body.mass, body.ipos = True, own.mass, own.centre
        body.iquat, body.inertia = turned, moments
    return _compiled(robot, spec)


def _compiled(robot: Robot, spec: Any) -> Any:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            model = spec.compile()
        except (ValueError, RuntimeError) as error:
            raise bad_value("Robot.file", robot.path, f"MuJoCo says: {_words(error)}; correct the file") from error
    mj = mujoco("Robot.file", robot.path)
    take_out(mj, model)
    handle = mj.get_mju_user_warning() or warnings.warn  # that of `warnings_logged`
    for item in said:
        handle(str(item.message))
    return model


def _parsed(mj: Any, robot: Robot) -> Any:
    path = Path(robot.path)
    if path.suffix.lower() not in SUFFIXES and not path.is_dir():
        raise bad_value("Robot.file", robot.path, "give an MJCF file (.xml) or a URDF file (.urdf)")
    if not path.is_file():
        remedy = "this is a folder; name a file in it" if path.is_dir() else "there is no such file"
        raise bad_value("Robot.file", robot.path, remedy)
    try:
        spec = mj.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError) as error:
        raise bad_value("Robot.file", robot.path, f"MuJoCo says: {_words(error)}; correct the file") from error
    for mesh in spec.meshes:
        if mesh.file.startswith(PACKAGE):
            mesh.file = str(_in_package(robot, mesh.file))
    return spec


def _in_package(robot: Robot, name: str) -> Path:
    """The file that package://NAME/REST of a URDF means: REST in the folder NAME beside or above it.

    Raises:
        RequestError: there is none.
    """
    package, _, rest = name.removeprefix(PACKAGE).lstrip("/").partition("/")
    for above in Path(robot.path).resolve().parents:
        for folder in (above / package, *([above] if above.name == package else [])):
            if (folder / rest).is_file():
                return folder / rest
    remedy = f"no folder {package} beside the file or above it has {rest} (package:// of a mesh); copy it there"
    raise bad_value("Robot.file", robot.path, remedy)


def _words(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".;")


def _add_servos(mj: Any, spec: Any, robot: Robot) -> None:
    """Servos that are given beside the file, as position actuators of their joints.

    Raises:
        RequestError: a joint is not in the file or has an actuator there.
    """
    joints = [joint.name for joint in spec.joints]
    taken = {actuator.target for actuator in spec.actuators if actuator.trntype != mj.mjtTrn.mjTRN_TENDON}
    for name, servo in robot.servos.items():
        if name not in joints:
            raise bad_value("Robot.servos", name, f"the file's joints are {', '.join(filter(None, joints))}")
        if name in taken:
            raise bad_value("Robot.servos", name, "the file has an actuator of this joint; leave one of them out")
        added = spec.add_actuator(name=name, target=name, trntype=mj.mjtTrn.mjTRN_JOINT)
        added.gainprm[0], added.biasprm[1], added.biasprm[2] = servo.kp, -servo.kp, -servo.kv
        added.biastype = mj.mjtBias.mjBIAS_AFFINE
        added.ctrllimited = False
        if servo.limits is not None:
            added.forcelimited, added.forcerange = True, list(servo.limits)


def _refused(mj: Any, model: Any) -> Iterator[str]:
    """What a machine does not carry, each with a remedy."""
    counts = {
        "spatial tendons": int((model.wrap_type != int(mj.mjtWrap.mjWRAP_JOINT)).sum()),
        "flexes": model.nflex,
        "mocap bodies": model.nmocap,
        "plugins": model.nplugin,
        "height fields": model.nhfield,
        "activations of actuators": model.na,
    }
    for what, count in counts.items():
        if count:
            yield f"it has {what} ({count}), which a machine does not carry; take them out"
    names = Names(mj, model)
    for k in range(model.ntendon):
        yield from (f"tendon {names.tendon(k)}: {text}" for text in _refused_tendon(model, k))
    for k in range(model.nu):
        yield from (f"actuator {names.actuator(k)}: {text}" for text in _refused_drive(mj, model, k))
    for k in range(model.njnt):
        for what in ("jnt_stiffnesspoly", "jnt_springyield"):
            if getattr(model, what, None) is not None and getattr(model, what)[k].any():
                yield f"joint {names.joint(k)} has a spring that is not linear; give it a stiffness alone"
    if getattr(model, "dof_dampingpoly", None) is not None and model.dof_dampingpoly.any():
        yield "it has damping that is not linear in the rate; give joints a damping alone"
    kinds = (mj.mjtEq.mjEQ_CONNECT, mj.mjtEq.mjEQ_WELD, mj.mjtEq.mjEQ_JOINT)
    for k in range(model.neq):
        if model.eq_active0[k] and model.eq_type[k] not in [int(kind) for kind in kinds]:
            yield f"equality {names.equality(k)} is none of connect, weld and joint; take it out"
    if model.opt.disableactuator:
        yield "it switches groups of actuators off (actuatorgroupdisable of option); take these actuators out"
    if model.opt.density or model.opt.viscosity or model.opt.wind.any():
        yield "it moves in a fluid (density, viscosity or wind of option), which acts on no machine here; take it out"


def _refused_tendon(model: Any, k: int) -> Iterator[str]:
    for what in ("limited", "actfrclimited", "frictionloss", "armature", "stiffnesspoly", "dampingpoly"):
        given = getattr(model, f"tendon_{what}", None)
        if given is not None and np.any(given[k]):
            yield f"it has {what}, which machines do not carry in tendons; give that to joints, or leave it out"


def _refused_drive(mj: Any, model: Any, k: int) -> Iterator[str]:
    joints = (int(mj.mjtTrn.mjTRN_JOINT), int(mj.mjtTrn.mjTRN_JOINTINPARENT))
    scalar = (int(mj.mjtJoint.mjJNT_HINGE), int(mj.mjtJoint.mjJNT_SLIDE))
    on_joint = model.actuator_trntype[k] in joints and model.jnt_type[model.actuator_trnid[k, 0]] in scalar
    if not on_joint and model.actuator_trntype[k] != int(mj.mjtTrn.mjTRN_TENDON):
        yield "it drives no hinge, slide or fixed tendon; drive one"
    elif model.actuator_dyntype[k] != int(mj.mjtDyn.mjDYN_NONE):
        yield "it has dynamics of its own; give a motor, position or velocity actuator without a time constant"
    elif model.actuator_gaintype[k] not in (int(mj.mjtGain.mjGAIN_FIXED), int(mj.mjtGain.mjGAIN_AFFINE)):
        yield "its gain is neither fixed nor affine; give a motor, position or velocity actuator"
    elif model.actuator_biastype[k] not in (int(mj.mjtBias.mjBIAS_NONE), int(mj.mjtBias.mjBIAS_AFFINE)):
        yield "its bias is neither none nor affine; give a motor, position or velocity actuator"
    for what in ("actuator_armature", "actuator_damping", "actuator_delay"):
        if getattr(model, what, None) is not None and getattr(model, what)[k].any():
            yield f"it has {what.removeprefix('actuator_')} of its own; give that to the joint, or leave it out"


def scenery(model: Any) -> Array:
    """Which bodies stand beside the machine: those that do not move and carry none that does, shape (nbody,), bool."""
    fixed, base = model.body_weldid == 0, np.zeros(model.nbody, dtype=bool)
    for link in range(model.nbody - 1, 0, -1):
        if base[link] or not fixed[link]:
            base[model.body_parentid[link]] = True
    base[0] = False
    return fixed & ~base


class Names:
    """Names of what a model holds; where the file gives none, those of the body with a number."""

    def __init__(self, mj: Any, model: Any) -> None:
        self._mj, self._model = mj, model

    def body(self, k: int) -> str:
        """Of body k; "world" is 0."""
        return self._name("BODY", k) or f"body{k}"

    def joint(self, k: int) -> str:
        """Of joint k."""
        return self._name("JOINT", k) or f"{self.body(int(self._model.jnt_bodyid[k]))}_joint{k}"

    def geom(self, k: int) -> str:
        """Of geom k."""
        return self._name("GEOM", k) or f"{self.body(int(self._model.geom_bodyid[k]))}_geom{k}"

    def actuator(self, k: int) -> str:
        """Of actuator k."""
        return self._name("ACTUATOR", k) or f"actuator{k}"

    def tendon(self, k: int) -> str:
        """Of tendon k."""
        return self._name("TENDON", k) or f"tendon{k}"

    def equality(self, k: int) -> str:
        """Of equality constraint k."""
        return self._name("EQUALITY", k) or f"equality{k}"

    @property
    def bodies(self) -> list[str]:
        """Of all bodies but the world."""
        return [self.body(k) for k in range(1, self._model.nbody)]

    @property
    def joints(self) -> list[str]:
        """Of all joints."""
        return [self.joint(k) for k in range(self._model.njnt)]

    @property
    def actuators(self) -> list[str]:
        """Of all actuators."""
        return [self.actuator(k) for k in range(self._model.nu)]

    def _name(self, kind: str, k: int) -> str | None:
        return self._mj.mj_id2name(self._model, int(getattr(self._mj.mjtObj, f"mjOBJ_{kind}")), k)
