"""Owns the kernels of an element of the user's own: the tetrahedron of constant strain, without averaged pressure.

Zienkiewicz, Taylor and Zhu, The Finite Element Method, 7th ed. (2013), section 2.3. See `linear_tet` for the host side.
"""

from functools import partial

from warp_mca.kernels.elements import readings
from warp_mca.kernels.elements.formulation import OWN
from warp_mca.kernels.elements.formulation import force_kernel as force_of
from warp_mca.kernels.elements.tet4 import tetrahedron

formulation = partial(tetrahedron, name="linear_tet", pressure=OWN)
force_kernel = partial(force_of, formulation)
energy_kernel = partial(readings.energy_kernel, formulation)
stress_kernel = partial(readings.stress_kernel, formulation)
