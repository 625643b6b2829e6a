"""Owns springs between points on the host: their nodes, and what they ask of the time step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, joinable
from warp_mca.geometry.point_location import around_point, weighted_set
from warp_mca.physics.loads.springs_stage import SpringsStage as Stage
from warp_mca.scene.springs import Spring
from warp_mca.system.bodies import Bodies
from warp_mca.system.loads import LoadedNodes

__all__ = ["SpringNodes", "Stage", "build"]

# Of rigid bodies, whose whole motion goes through springs: how many times these count in the step, for a frequency that
# is right to some 1e-4.
WHOLE = 100.0
# The same of dashpots: their first half step is explicit, so that a body comes (c l dt / 2)^2 short, 0.2 % here.
BRAKED = 20.0
# The same of those at nodes of flexible bodies, where what other forces do to the speed lags by a step: see the kernel.
LAGGED = 2.0


@joinable
@dataclass(frozen=True, kw_only=True)
class SpringNodes(LoadedNodes):
    """A spring; `node` are those of its first point, then those of the second one.

    Attributes:
        weight: of each node in its point, negative in the first one [-], shape (count,), float64.
        added: eigenvalue at each node [1/s^2], shape (count,), float64.
        decay: rate at which the dashpot decays, at each node [1/s], shape (count,), float64.
        lightness: of both points along the spring [1/kg].
        between: way from the first to the second point at the start [m], shape (3,), float64.
        direction: along which it acts [-], shape (3,), float64; zero for the line between the points.
        length: without tension [m].
        preload: tension at that length [N].
        rest: elongation without tension, at which no energy is stored [m]; 0 where there is none.
        lowest: integral of the table from its first entry to it [J].
        table, damper: of tension over elongation [m], [N], and over its speed [m/s], [N], shape (2, count), float64.
    """

    weight: Array = field(metadata=AS_IS)
    added: Array = field(metadata=AS_IS)
    decay: Array = field(metadata=AS_IS)
    lightness: float = field(metadata=AS_IS)
    between: Array = field(metadata=AS_IS)
    direction: Array = field(metadata=AS_IS)
    length: float = field(metadata=AS_IS)
    preload: float = field(metadata=AS_IS)
    rest: float = field(metadata=AS_IS)
    lowest: float = field(metadata=AS_IS)
    table: Array = field(metadata=AS_IS)
    damper: Array = field(metadata=AS_IS)

    @property
    def bars(self) -> tuple[SpringNodes, ...]:
        """The springs that it is made of: itself."""
        return (self,)

    def eigenvalues(self, mass: Array) -> Array:
        """k l at nodes of flexible bodies; of rigid ones WHOLE times the stiffness that each node has of the spring."""
        return self.added

    def decays(self, mass: Array) -> Array:
        """LAGGED times c l, BRAKED times at nodes of rigid bodies."""
        return self.decay


def build(load: Spring, assembly: Bodies) -> SpringNodes:
    """The arrays of a spring.

    Raises:
        RequestError: its points lie outside their bodies or in one place, or another spring has its name.
    """
    if sum(isinstance(other, Spring) and other.name == load.name for other in assembly.scene.loads) > 1:
        raise bad_value("Spring.name", load.name, "another spring has it, too; give each a name of its own")
    ends = [_point(assembly, load, "body", load.body, load.at, load.nodes)]
    if load.other is not None:
        ends.append(_point(assembly, load, "other", load.other, load.other_at, load.other_nodes))
    places = [weight @ assembly.X[node] for node, weight in ends]
    if load.other is None:
        places.append(places[0] if load.other_at is None else np.array(load.other_at, dtype=np.float64))
    between = places[1] - places[0]
    direction, n, length = np.zeros(3), np.zeros(3), float(np.linalg.norm(between))
    if load.direction is not None:
        n = np.array(load.direction) / np.linalg.norm(load.direction)
        n = direction = -n if n @ between < -1e-9 * length else n  # it pulls its points together, however it is given
        length = float(direction @ between)
    elif length > 1e-9 * float(np.abs(assembly.X).max()):
        n = between / length
    else:
        raise bad_value(f"{load.title}.direction", None, "its points lie in one place; give the direction of its force")
    k, c = (_steepest(np.array(table)) for table in (load.table, load.damper))
    bodies = [load.body, *([] if load.other is None else [load.other])]
    own = [lightness(assembly, body, *end, n) for body, end in zip(bodies, ends, strict=True)]
    node, weight = signed(ends)
    table = np.array(load.table, dtype=np.float64)
    rest = _rest(table, load.preload)
    added, decay = [], []
    for body, (nodes, share), light in zip(bodies, ends, own, strict=True):
        rigid = assembly.scene.body(body).rigid
        whole = WHOLE * k * (share / assembly.mass[nodes] if share.min() >= 0.0 else np.full(len(nodes), light))
        added.append(whole if rigid else np.full(len(nodes), k * sum(own)))
        decay.append(np.full(len(nodes), (BRAKED if rigid else LAGGED) * c * sum(own)))
    return SpringNodes(
        node=node,
        name=load.name,
        weight=weight,
        added=np.concatenate(added),
        decay=np.concatenate(decay),
        lightness=sum(own),
        between=between,
        direction=direction,
        length=length if load.length is None else load.length,
        preload=load.preload,
        rest=rest,
        lowest=_integral(table, rest),
        table=table,
        damper=np.array(load.damper, dtype=np.float64),
    )


def _point(
    assembly: Bodies, load: Spring, key: str, body: str, at: tuple[float, ...] | None, nodes: str | None
) -> tuple[Index, Array]:
    """Nodes of a point, each once, and their weights, which add up to 1."""
    mesh, first = assembly.meshes[body], assembly.node_start[body]
    if nodes is None:
        field = f"{load.title}.{'at' if key == 'body' else 'other_at'}"
        place = np.array(at, dtype=np.float64)
        node, weight = around_point(field, body, place, mesh, assembly.scene.body(body).is_inertia)
    else:
        node, weight = weighted_set(mesh.nodes(nodes), assembly.mass[assembly.all_nodes(body)])
    own, which = np.unique(node, return_inverse=True)  # corners of wedges coincide
    return own + first, np.bincount(which, weight).astype(np.float64)


def signed(ends: Sequence[tuple[Index, Array]]) -> tuple[Index, Array]:
    """Nodes of both points, or of the first one, and their weights, negative in the first one."""
    node = np.concatenate([nodes for nodes, _ in ends]).astype(np.int32)
    return node, np.concatenate([-ends[0][1], *(weight for _, weight in ends[1:])])


def lightness(assembly: Bodies, body: str, node: Index, weight: Array, n: Array) -> float:
    """Acceleration of a point along n per force on it [1/kg]: of nodes by themselves, or of a rigid body."""
    if not assembly.scene.body(body).rigid:
        return float((weight**2 / assembly.mass[node]).sum())
    part = assembly.all_nodes(body)
    mass, X = assembly.mass[part], assembly.X[part]
    arms = X - mass @ X / mass.sum()
    squares = np.einsum("n,ni,nj->ij", mass, arms, arms)
    turn = np.cross(weight @ assembly.X[node] - mass @ X / mass.sum(), n)
    inertia = np.trace(squares) * np.eye(3) - squares
    return float(1.0 / mass.sum() + turn @ np.linalg.solve(inertia, turn))


def _rest(table: Array, preload: float) -> float:
    """Elongation nearest to 0 at which a table and a preload give no tension [m]; 0 without one."""
    if not table.size:
        return 0.0
    x, y = table[0], table[1] + preload
    slope = np.diff(y) / np.diff(x)
    way = np.divide(-y[:-1], slope, out=np.full(len(slope), np.nan), where=slope != 0.0)
    low, high = np.zeros(len(slope)), np.diff(x)
    low[0], high[-1] = -np.inf, np.inf  # they go on beyond the ends
    roots = (x[:-1] + way)[(way >= low) & (way <= high)]
    return float(roots[np.abs(roots).argmin()]) if len(roots) else 0.0


def _integral(table: Array, end: float) -> float:
    """Of a table from its first entry on [J], which goes on beyond its ends with the slope there; 0 without."""
    if not table.size:
        return 0.0
    x, y = table
    k = int(np.clip(np.searchsorted(x, end) - 1, 0, len(x) - 2))
    slope, way = (y[k + 1] - y[k]) / (x[k + 1] - x[k]), end - x[k]
    return float(np.trapezoid(y[: k + 1], x[: k + 1]) + way * (y[k] + 0.5 * slope * way))


def _steepest(table: Array) -> float:
    """Greatest slope of a table, as stiffness or damping; 0 without."""
    return float(np.abs(np.diff(table[1]) / np.diff(table[0])).max(initial=0.0)) if table.size else 0.0
