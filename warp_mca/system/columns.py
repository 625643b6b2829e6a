"""Owns the columns of a record behind those of contact passes, and the entries of the energy ledger they add to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from warp_mca.kernels.records.columns import PASS, PASS_COLUMNS
from warp_mca.scene.loads import LOADS
from warp_mca.system.body_joints import BodyJoint
from warp_mca.system.body_joints import readings as joint_readings

if TYPE_CHECKING:
    from warp_mca.system.model import Model


JOINTS = "joints"  # name of the actor whose columns are those of joints between whole bodies
FAILURE = "failure"  # entry of the ledger: elastic and hourglass energy that went with elements that failed


class Added(NamedTuple):
    """Columns of one actor: the first, the entries of the ledger to which they add, and what stands behind these.

    `readings` are columns of the history: each one of `Load.readings` of all loads, then the next. The first `means` of
    them are integrals over time, of which the history has the means over the interval before.
    """

    first: int
    energies: tuple[str, ...]
    readings: tuple[str, ...] = ()
    means: int = 0

    @property
    def end(self) -> int:
        """The first column behind its own."""
        return self.first + len(self.energies) + len(self.readings)


def pass_count(model: Model) -> int:
    """Contact passes of each scene."""
    return len(model.passes) // (model.batch.count if model.batch else 1)


def added_columns(model: Model) -> dict[str, Added]:
    """Columns of each actor that adds some, by its name: loads, elements that may fail, absorbing boundaries, joints.

    All scenes of a batch have the same kinds of loads, and elements that may fail or none; those without absorbing
    boundaries read fewer columns.
    """
    kinds = {kind: (LOADS[kind].energies, _readings(model, kind)) for kind in model.loads}
    kinds |= {FAILURE: ((FAILURE,), ())} if model.fails else {}
    kinds |= {"absorbing": (model.absorbing.ENERGIES, ())} if len(model.absorbing.node) else {}
    found, first = {}, PASS + PASS_COLUMNS * pass_count(model)
    for name, (energies, readings) in kinds.items():
        found[name] = Added(first, energies, readings)
        first = found[name].end
    if model.body_joints:
        means, values = joint_readings([item for item in model.body_joints if item.scene == 0])
        found[JOINTS] = Added(first, BodyJoint.ENERGIES, (*means, *values), len(means))
    return found


def _readings(model: Model, kind: str) -> tuple[str, ...]:
    """Columns of the history that loads of a kind have; of a batch those of its first scene, which has as many."""
    names = [item.name for item in model.loads[kind] if item.scene == 0]
    return tuple(column.format(name) for column in LOADS[kind].readings for name in names)


def column_count(model: Model) -> int:
    """Columns of a record."""
    return max([PASS + PASS_COLUMNS * pass_count(model), *(own.end for own in added_columns(model).values())])
