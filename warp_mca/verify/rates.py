"""Owns the case of elements that take steps of their own: an impact whose waves pass from one group to the next."""

from __future__ import annotations

from warp_mca.verify.case import Row, Setup, case

GROUPS = 4


@case(
    group="impact",
    title="Two graded bars collide end on, their cells in up to four groups with steps of their own",
    reference="Method: Lew, Marsden, Ortiz, West, Int. J. Numer. Meth. Engng 60 (2004) 153. Problem: Wolff and Bucher, "
    "Int. J. Numer. Meth. Engng 95 (2013) 562. Answer: one-dimensional wave theory.",
)
def graded_bars(setup: Setup) -> list[Row]:
    """Bars 10 x 1 x 1, E = rho = 1, nu = 0, speeds +-0.1; cells grow eightfold from the contact to the free ends.

    All tetrahedra have one step, since their pressure is averaged over neighbours. Their mesh is not symmetric, so that
    the bars would buckle: they take a hundredth of the speed, and softer contact springs.
    """
    counts, v = setup.choose((40, 80), (40, 80, 160)), setup.by_element(0.1, tet4=0.001)
    mean, ripple, end = [], [], []
    for count in counts:
        more = setup.by_element({"section": 1}, tet4={"section": 2, "penalty": 0.3})
        scene = setup.scene("graded_bars", v=v, axial=count, **more)
        grouped, plain = setup.run(scene, multi_rate=GROUPS), setup.run(scene)
        force, usual = (found.F_n[(found.time > 1.0) & (found.time < 19.0)] for found in (grouped, plain))
        mean.append(float(force.mean()) / v)
        ripple.append(float(force.std() / usual.std()))
        end.append(grouped.summary["contacts"][-1][1])
    coarsest = "a vibration of the coarsest cells, whose period does not divide the time"
    beyond = "measured beyond 1: groups may not add to it"
    front = "the front is as wide as a few cells; rows are 0.1 s apart"
    rippled = "ripple of the force, standard deviation over that with one step for all"
    return [
        Row("mean force over the speed, rho c A, over 1 < t < 19", 1.0, mean, "N s/m", 0.01, coarsest),
        Row(rippled, 0.0, [max(share - 1.0, 0.0) for share in ripple], "-", 0.0, beyond, scale=1.0),
        Row("end of contact 2 l / c", 20.0, end, "s", 0.03, front),
    ]
