"""Owns skins of bodies as closed triangle meshes on the host, and how deep edges of one lie in another."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.kept import Kept
from warp_mca.base.rotation import best_rotation
from warp_mca.geometry.cell_types import triangulated
from warp_mca.kernels.contact import crossing
from warp_mca.kernels.contact.inside import depths_inside
from warp_mca.watch.skin_shape import shape_of

Found = tuple[float, Array]  # depth [m] and place [m], shape (3,)

INWARD = 0.02  # of its shortest edge, by which a node is moved into its body: skins that only touch do not cross
FLAT = 0.1  # of the body's thickness, which that does not exceed
SAMPLES = 2048  # points of a skin that are looked for in another body, evenly spread, where edges lie in it
SHAPE_NODES = 1024  # of a body that tell how far it is out of shape, evenly spread
_KEPT: Kept[tuple[Index, Index, Index]] = Kept(500_000)  # triangles of skins of this process, 25 MB of memory
NOWHERE: Found = (0.0, np.full(3, np.nan))


class _Settling:
    """How a mesh follows its body: launches that are recorded once, because a look at a small body is all launches."""

    def __init__(self, mesh: wp.Mesh, triangle: wp.array, inward: wp.array) -> None:
        self._of = mesh, triangle, inward  # which a recorded launch does not keep
        normal, self.inner = (wp.zeros(len(inward), dtype=wp.vec3f, device="cpu") for _ in range(2))
        self._points, self._normal = mesh.points.numpy(), normal.numpy()  # they keep their arrays
        stages = (
            (crossing.add_normals, len(triangle), [mesh.points, triangle], normal),
            (crossing.move_inside, len(inward), [mesh.points, normal, inward], self.inner),
        )
        self._launches: list[Any] = [
            wp.launch(kernel, count, inputs=inputs, outputs=[output], device="cpu", record_cmd=True)
            for kernel, count, inputs, output in stages
        ]

    def settle(self, x: Array) -> None:
        """Take the places of the nodes [m], shape (node_count, 3), and move them into the body, as `inner`."""
        self._points[:] = x
        self._of[0].refit()
        self._normal[:] = 0.0
        for launch in self._launches:
            launch.launch()


class _EdgeSearch:
    """Edges of one skin in the faces of another, up to `room` of them, recorded likewise."""

    def __init__(self, mesh: wp.Mesh, inner: wp.array, own: wp.array, room: int) -> None:
        edge = wp.zeros((room, 2), dtype=wp.int32, device="cpu")
        depth, at = (wp.zeros(room, dtype=kind, device="cpu") for kind in (wp.float32, wp.vec3f))
        self.room, self._of, self._count = room, (mesh, inner, own), room  # as above
        self._edge, self._depth, self._at = edge.numpy(), depth.numpy(), at.numpy()
        inputs = [mesh.id, inner, edge, own]
        self._launch: Any = wp.launch(
            crossing.edges_inside, room, inputs=inputs, outputs=[depth, at], device="cpu", record_cmd=True
        )

    def found(self, edge: Index) -> tuple[NDArray, NDArray]:
        """Depth and place of each edge [m], as `Skin.edges_in`, from the origin of the mesh; valid until the next."""
        self._edge[: len(edge)] = edge
        if len(edge) != self._count:
            self._count = len(edge)
            self._launch.set_dim(self._count)
        self._launch.launch()
        return self._depth[: len(edge)], self._at[: len(edge)]


def _parts(faces: Index) -> tuple[Index, Index, Index]:
    """Nodes of faces, and triangles and edges of these by position in them, as `Skin` has them; found once."""
    if (kept := _KEPT.get(key := faces.tobytes())) is None:
        own = np.unique(faces)
        triangle = np.searchsorted(own, triangulated(faces)).astype(np.int32)
        ends = np.sort(triangle[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
        code = np.unique(ends[:, 0] * len(own) + ends[:, 1])
        kept = own, triangle, np.stack([code // len(own), code % len(own)], axis=1).astype(np.int32)
        _KEPT.put(key, kept, len(triangle))
    return kept


class Skin:
    """The closed surface of a body, which moves; computed on the host's CPU.

    Attributes:
        name: of the body.
        nodes: of its surface, in the numbering of the scene's model, shape (node_count,), int32.
        triangle: of faces and halves of faces, shape (triangle_count, 3), int32, by position in `nodes`.
        edge: of the triangles, each once, shape (edge_count, 2), int32, by position in `nodes`.
        width, longest, thickness, gap, extents: at the start, as `SkinShape` has them.
        x: where the nodes are [m], shape (node_count, 3), float64.
    """

    def __init__(self, name: str, faces: Index, X: Array, start: int) -> None:
        """Take the faces of a mesh whose nodes begin at `start` in positions X [m], shape (node_count, 3), float64."""
        self.name, (own, self.triangle, self.edge) = name, _parts(faces)
        self.nodes = (own + start).astype(np.int32)
        self.X = X[self.nodes]
        shape = shape_of(self.X, self.triangle, self.edge)
        self.width, self.longest, self._shortest = shape.width, shape.longest, shape.shortest
        self.thickness, self.gap, self.extents = shape.thickness, shape.gap, shape.extents
        self._origin = self.X.mean(axis=0)
        self.x, self._stale = self.X, False
        self._searches: dict[Skin, _EdgeSearch] = {}

    def __getstate__(self) -> dict[str, Any]:
        """For another process, without what Warp has of it, which is made anew where it is looked at."""
        own = {
            name: value for name, value in vars(self).items() if not isinstance(value, wp.Mesh | wp.array | _Settling)
        }
        return own | {"_stale": True, "_searches": {}}

    @cached_property
    def _ends(self) -> Index:
        return np.ascontiguousarray(self.edge.T)  # of which numpy takes each in half the time

    @cached_property
    def _mesh(self) -> wp.Mesh:
        """The triangles at the start, whatever the body has become by then, so that stored runs go on alike."""
        points = wp.array((self.X - self._origin).astype(np.float32), dtype=wp.vec3f, device="cpu")
        return wp.Mesh(points, wp.array(self.triangle.ravel(), dtype=wp.int32, device="cpu"))

    @cached_property
    def _triangle(self) -> wp.array:
        return wp.array(self.triangle, dtype=wp.int32, ndim=2, device="cpu")

    @cached_property
    def _settling(self) -> _Settling:
        # how far each node is moved into the body [m], shape (node_count,), float32
        inward = np.minimum(INWARD * self._shortest, FLAT * self.thickness).astype(np.float32)
        return _Settling(self._mesh, self._triangle, wp.array(inward, dtype=wp.float32, device="cpu"))

    def move(self, x: Array) -> None:
        """Take the place of its nodes [m], shape (node_count, 3), float64."""
        self.x, self._stale = x, True

    @property
    def box(self) -> Array:
        """Least and greatest coordinates [m], shape (2, 3), float64."""
        columns = self.x.T  # as in `near`
        return np.array([[reduce(column) for column in columns] for reduce in (np.minimum.reduce, np.maximum.reduce)])

    def bent(self) -> float:
        """Greatest distance of a node from its place in the undeformed body, moved rigidly as fits best [m]."""
        some = slice(None, None, -(-len(self.X) // SHAPE_NODES))
        X, x = (points[some] - points[some].mean(axis=0) for points in (self.X, self.x))
        R = best_rotation(X, x, np.ones(len(X)))
        return float(np.sqrt(((x - X @ R.T) ** 2).sum(axis=1).max()))

    def settle(self, origin: Array) -> None:
        """Make the mesh ready for `edges_in`, with coordinates from an origin near the body [m], shape (3,)."""
        if not self._stale:
            return
        self._settling.settle(self.x - origin)
        self._origin, self._stale = origin, False

    def edges_in(self, other: Skin, chosen: Index) -> tuple[Array, Array]:
        """How deep chosen edges lie in another skin, or in others parts of this one, and where.

        Both are settled with the same origin.

        Returns:
            Depths below planes of crossed faces [m], shape (chosen_count,), and places [m], shape (chosen_count, 3).
        """
        search = self._searches.get(other)
        if search is None or search.room < len(chosen):
            own = self._triangle if other is self else wp.zeros((0, 3), dtype=wp.int32, device="cpu")
            search = _EdgeSearch(other._mesh, self._settling.inner, own, 2 * len(chosen))
            self._searches[other] = search
        depth, at = search.found(self.edge[chosen])
        return depth.astype(float), at + self._origin

    def near(self, box: Array) -> Index:
        """Edges that may reach into a box, int32."""
        lower, upper = box[0] - self.longest, box[1] + self.longest
        near = np.ones(len(self.x), dtype=bool)
        for axis, column in enumerate(self.x.T):  # numpy takes many times as long along the other axis
            near &= (column > lower[axis]) & (column < upper[axis])
        if not near.any():
            return np.zeros(0, dtype=np.int32)
        return (near[self._ends[0]] | near[self._ends[1]]).nonzero()[0].astype(np.int32)

    def samples(self, chosen: Index) -> Array:
        """Ends and middles of chosen edges, moved into the body [m], shape (sample_count, 3), float64."""
        inner = self._settling.inner.numpy() + self._origin
        ends = inner[self.edge[chosen]]
        return np.concatenate([inner[np.unique(self.edge[chosen])], ends.mean(axis=1)])

    def deepest(self, points: Array) -> Found:
        """The deepest of some points that lie in the body; depth 0 where none does."""
        (lower, upper) = self.box
        points = points[((points > lower) & (points < upper)).all(axis=1)]
        if not len(points):
            return NOWHERE
        points = points[:: -(-len(points) // SAMPLES)]
        depth = depths_below(points, self.x, self.triangle)
        best = int(depth.argmax())
        return (float(depth[best]), points[best]) if depth[best] > 0.0 else NOWHERE

    def crossed_by_itself(self, box: Array, origin: Array, least: float) -> Found:
        """How deep parts of it lie in others, where edges lie deeper than `least` [m] behind faces; as `crossed`."""
        self.settle(origin)
        depth, at = self.edges_in(self, self.near(box))
        best = int(depth.argmax())
        return (min(float(depth[best]), 0.5 * self.thickness), at[best]) if depth[best] > least else NOWHERE


def crossed(
    one: Skin,
    other: Skin,
    boxes: tuple[Array, Array],
    origin: Array,
    least: float,
    edges: tuple[NDArray[np.bool_], NDArray[np.bool_]] | None = None,
) -> Found:
    """How deep one skin lies in another, where edges of one lie deeper than `least` [m] behind faces of the other.

    Args:
        one, other: the skins.
        boxes: around the two, each shape (2, 3) [m].
        origin: a point near them, for coordinates in float32 [m], shape (3,).
        least: as above.
        edges: of each that count, as those near what binds the bodies do not; None for all.
    """
    crossing, points = False, []
    for skin, body, k in ((one, other, 0), (other, one, 1)):
        chosen = skin.near(boxes[1 - k])
        chosen = chosen[edges[k][chosen]] if edges else chosen
        if not len(chosen):
            continue
        skin.settle(origin)
        body.settle(origin)
        depth, at = skin.edges_in(body, chosen)
        crossing |= bool((depth > least).any())
        points.append((body, skin, chosen, at[depth > least]))
    if not crossing:
        return NOWHERE
    found = [body.deepest(np.concatenate([at, skin.samples(chosen)])) for body, skin, chosen, at in points]
    return max(found, key=lambda item: item[0])


def depths_below(points: Array, x: Array, triangle: Index) -> Array:
    """Depth of points below a closed surface, negative outside [m], shape (point_count,), to float32's digits.

    Args:
        points: [m], shape (point_count, 3), float64.
        x: nodes of the surface [m], shape (node_count, 3), float64.
        triangle: their numbers, shape (triangle_count, 3), int32.
    """
    origin = x.mean(axis=0)
    reach = float(np.linalg.norm(np.ptp(x, axis=0)))
    with wp.ScopedDevice("cpu"):
        surface = wp.Mesh(
            wp.array((x - origin).astype(np.float32), dtype=wp.vec3f),
            wp.array(triangle.ravel(), dtype=wp.int32),
            support_winding_number=True,
        )
        distance = wp.zeros(len(points), dtype=wp.float32)
        inputs = [surface.id, wp.array((points - origin).astype(np.float32), dtype=wp.vec3f), reach]
        wp.launch(depths_inside, len(points), inputs=inputs, outputs=[distance])
        return distance.numpy().astype(np.float64)
