"""Owns the dashpot of a contact law: its force beside that of the spring, and the energy that it dissipates."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.laws import law_functions


@cache
def dashpot_function(law: str) -> Any:
    """The function that adds the dashpot of a law to the force of its spring.

    Both together never pull: F_n = max(F(g) + D(g, g'), 0). `Spring.dashpot` keeps the force D of the last step, no
    less than -F, and the energy dissipated so far. A step dissipates (D_old + D) / 2 times the depth that it adds, as
    central differences count work.
    """
    dashpot_force = law_functions(law).dashpot

    @wp.func
    def damp(
        s: int,
        F: wp.float64,
        depth: wp.float64,
        normal: wp.vec3d,
        du: wp.vec3d,
        k: wp.float64,
        before: wp.vec3d,
        dt: wp.float64,
        spring: Any,
    ) -> tuple[wp.float64, wp.float64]:
        """Add the dashpot to the force F of a spring, which is 0 where the contact opens.

        Args:
            before: normal force on the slave in the last step, spring and dashpot together [N].
            du: motion of the slave relative to the master since then [m].

        Returns:
            The normal force [N]; the energy that the dashpot dissipated in this step [J].
        """
        closing = -wp.dot(du, normal)
        D = wp.float64(0.0)
        if F > wp.float64(0.0):
            D = wp.max(dashpot_force(depth, closing / dt, k, spring.parameters, s), -F)
        kept = spring.dashpot[s]
        pressed = wp.length(before)
        dissipated = wp.float64(0.5) * D * closing
        if pressed > wp.float64(0.0):
            way = before / pressed
            dissipated -= wp.float64(0.5) * kept[0] * wp.dot(way, du)
        elif F > wp.float64(0.0):
            dissipated += wp.float64(0.5) * kept[0] * closing
        elif kept[0] != wp.float64(0.0):  # the contact opens without force: the dashpot takes what the spring held
            dissipated = spring.normal_energy[s]
            spring.normal_energy[s] = wp.float64(0.0)
        spring.dashpot[s] = wp.vec2d(D, kept[1] + dissipated)
        return F + D, dissipated

    return damp
