"""Owns the equations of motion of a chain as a system of first order, and the time scale of its motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.loads import Loads, joint_rates, link_torques
from warp_mca.rigid.plain_chain import acceleration_of, free_slopes

MAX_TURN = 1e4  # angle through which a chain may turn in a swing [rad]; it takes minutes to compute
MAX_DECAYS = 1e6  # decay times of joint friction at rest in a swing; it takes minutes to compute


def flow(chain: Chain, middle: float) -> Callable[[float, Array], Array | list[float]]:
    """y' = f(t, y) between two corners of the tables, around the time `middle` [s].

    y holds coordinates and rates, and where there are loads the work of torques, the heat of friction and the work of
    the base [J]. In the frame of a base that accelerates at a, gravity is g - a.
    """
    count, loads = chain.coordinate_count, chain.loads
    if loads is None:
        return free_slopes(chain)
    base, local = loads.base_velocity, replace(chain, origin_velocity=(0.0, 0.0))
    if base is not None:
        a = base.slope(middle)
        local = replace(local, gravity=(float(chain.gravity[0] - a[0]), float(chain.gravity[1] - a[1])))
    accelerated = acceleration_of(local)

    def rates_of(t: float, y: Array) -> Array:
        q, v = y[:count], y[count : 2 * count]
        rates = joint_rates(chain.angles(v))
        drive, friction = loads.drive_torques(t), loads.friction_torques(rates)
        force = np.zeros(count)
        chain.angles(force)[:] = link_torques(drive + friction)
        a = accelerated(q, v, force)
        base_power = 0.0 if base is None else local.base_force(q, v, a) @ base.at(t)
        return np.concatenate([v, a, [drive @ rates, -friction @ rates, base_power]])

    return rates_of


def round_off(chain: Chain) -> float:
    """Gaps up to this are closed, or overlap by no more than rounding [m]."""
    return 1e-13 * reach(chain)


def reach(chain: Chain) -> float:
    """Length of the chain, and its radii of inertia [m]."""
    return sum(math.hypot(*link.hinge_out, *link.centre, math.sqrt(link.inertia / link.mass)) for link in chain.links)


def own_pace(chain: Chain, y: Array, span: float, field: str) -> float:
    """Angular velocity [rad/s] that the chain reaches by itself, for the longest step.

    Raises:
        RequestError: the links would turn too often in `span` [s].
    """
    with np.errstate(over="ignore"):
        speeds = y[chain.coordinate_count :]
        rates = speeds if chain.slide is None else np.append(speeds[0] / reach(chain), speeds[1:])
        square = math.hypot(*chain.gravity) / reach(chain) + (rates**2).max()
        if chain.loads is not None:
            lightest = min(k.inertia + k.mass * math.hypot(*k.centre) ** 2 for k in chain.links)
            square += chain.loads.greatest_torque / lightest
            _check_stiffness(chain.loads, lightest, span)
            if chain.loads.base_velocity is not None:
                slopes = [chain.loads.base_velocity.slope(t) for t in chain.loads.corners]
                square += float(np.linalg.norm(slopes, axis=1).max()) / reach(chain)
        pace = math.sqrt(square)
    if not pace * span < MAX_TURN:
        remedy = f"links that turn at {pace:.3g} rad/s would turn by more than {MAX_TURN:g} rad; give a shorter time"
        raise bad_value(field, span, remedy)
    return pace


def _check_stiffness(loads: Loads, inertia: float, span: float) -> None:
    """Refuse friction that needs too many steps in `span` [s] on links of that inertia [kg m^2].

    Raises:
        RequestError: so it does.
    """
    rate = float((loads.friction / loads.friction_rate + loads.damping).max()) / inertia
    if not rate * span < MAX_DECAYS:
        remedy = (
            f"friction at rest would decay {rate * span:.3g} times in {span:g} s; give a larger rate or less friction"
        )
        raise bad_value("RigidPhase.friction_rate", loads.friction_rate, remedy)
