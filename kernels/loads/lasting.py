"""Owns how loads end with the elements that they act on."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel(enable_backward=False)
def find_lasting(
    first: wp.array(dtype=wp.int32),
    element: wp.array(dtype=wp.int32),
    age: wp.array(dtype=wp.int32),
    begins: bool,
    lasts_out: wp.array(dtype=wp.int32),
):
    """Whether an element of a block that holds an entry is left; `begins`: this is the first of the blocks.

    `element` lists those of each entry from `first` on, `age` is that of `physics.elements.failing.FailureState`.
    """
    k = wp.tid()
    found = int(0)
    if not begins:
        found = lasts_out[k]
    for j in range(first[k], first[k + 1]):
        if age[element[j]] >= 0:
            found = int(1)
    lasts_out[k] = found


@wp.kernel(enable_backward=False)
def close_faces(
    entry: wp.array(dtype=wp.int32),
    lasts: wp.array(dtype=wp.int32),
    whole: wp.array(dtype=wp.vec4i),
    face_out: wp.array(dtype=wp.vec4i),
):
    """Faces that have ended have no area: all their corners are the first one. `entry` lists those that may end."""
    k = wp.tid()
    q = whole[entry[k]]
    if lasts[k] == 0:
        q = wp.vec4i(q[0], q[0], q[0], q[0])
    face_out[entry[k]] = q


@wp.kernel(enable_backward=False)
def close_shares(
    entry: wp.array(dtype=wp.int32),
    lasts: wp.array(dtype=wp.int32),
    whole: wp.array(dtype=wp.float64),
    share_out: wp.array(dtype=wp.float64),
):
    """Nodes that have lost all elements take no share of a force."""
    k = wp.tid()
    share_out[entry[k]] = wp.where(lasts[k] == 0, wp.float64(0.0), whole[entry[k]])
