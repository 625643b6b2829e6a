"""The compliance of a hinge on finer and finer meshes: that of a pin has a limit, those of tied nodes have none."""

import math

from impacts import begun

import warp_mca as mca

METAL = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
SIDE, LENGTH, SPEED = 0.02, 0.06, 0.1


def box(divisions: int) -> mca.Box:
    return mca.Box(
        size=(LENGTH, SIDE, SIDE),
        divisions=(3 * divisions, divisions, divisions),
        origin=(0.0, -0.5 * SIDE, -0.5 * SIDE),
    )


def extra_length(geometry: mca.Box | mca.Rod, **hinge) -> float:
    """What a hinge at the end of a bar that pulls at it adds to the bar's length [SIDE].

    A bar that begins to move away from a rigid hold loses its momentum in L / c.
    """
    bar = mca.Body(name="bar", geometry=geometry, material=METAL, velocity=(SPEED, 0.0, 0.0))
    scene = mca.Scene(
        name="pull",
        bodies=(bar,),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0), **hinge),),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-5),
    )
    impact = begun(scene, precision="float64")
    mass, dt, momenta = impact.solver.model.mass, impact.solver.dt, []
    while not momenta or momenta[-1] > 0.0:
        impact.solver.step(impact.state, 2)
        momenta.append(float(mass @ impact.state.v.numpy()[:, 0]))
    last = momenta[-1] / (momenta[-2] - momenta[-1])
    time = (2.0 * (len(momenta) + last) - 0.5) * dt
    return (time * math.sqrt(METAL.E / METAL.rho) - LENGTH) / SIDE


def test_a_pin_has_a_limit_and_tied_nodes_have_none():
    """From four to eight cells along the side; from eight to twelve the pin's compliance changes by 0.003 sides."""
    pin, axis, ends = (
        extra_length(box(8), **hinge) - extra_length(box(4), **hinge)
        for hinge in ({"nodes": "pin", "pin_radius": 0.5 * SIDE}, {"nodes": "axis"}, {"nodes": "ends"})
    )
    assert abs(pin) < 0.015
    assert axis > 0.3  # a line load: the compliance grows with the logarithm of the cells
    assert ends > 3.0  # a point load: it grows with their number
