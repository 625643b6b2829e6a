"""Owns what a search says about the next: whether slave nodes are so far from all faces that none can be touched."""

import warp as wp

from warp_mca.kernels.contact.search import STALE
from warp_mca.kernels.contact.spring import Spring

wp.set_module_options({"enable_backward": False})

HINTS = 4  # of the latest searches, in turn; not 0 where something is near or fast
# Shares of the margin of a search that nodes may move until the next one: to be called slow, and where contact was left
# out, two intervals of which are half the margin.
_SLOW, _MOST = 0.125, 0.25


@wp.kernel(enable_backward=False)
def watch_nodes(
    search: int,
    u: wp.array(dtype=wp.vec3d),
    u_search: wp.array(dtype=wp.vec3d),
    node: wp.array(dtype=wp.int32),
    margin: wp.float64,
    hint_out: wp.array(dtype=wp.int32),
    flag_out: wp.array2d(dtype=wp.int32),
):
    """Before a search: see whether slaves or masters have moved little since the last, far less than its margin.

    A hint of the last search or the one before let contact be left out; nodes that were too fast for it stop the run.
    """
    i = node[wp.tid()]
    moved = wp.length(u[i] - u_search[i])
    if moved > wp.float64(_SLOW) * margin:
        hint_out[search % wp.static(HINTS)] = 1
    if moved > wp.float64(_MOST) * margin:
        last = hint_out[(search + wp.static(HINTS - 1)) % wp.static(HINTS)]
        before = hint_out[(search + wp.static(HINTS - 2)) % wp.static(HINTS)]
        if last == 0 or before == 0:
            flag_out[0, STALE] = 1


@wp.kernel(enable_backward=False)
def watch_springs(search: int, count: wp.array(dtype=wp.int32), spring: Spring, hint_out: wp.array(dtype=wp.int32)):
    """After a search: see whether any slave has faces near, is pressed, or lies behind one."""
    s = wp.tid()
    if count[s] > 0 or spring.face[s] >= 0 or spring.held[s] != wp.float64(0.0):
        hint_out[search % wp.static(HINTS)] = 1
    if s == 0:
        hint_out[(search + 1) % wp.static(HINTS)] = 0
