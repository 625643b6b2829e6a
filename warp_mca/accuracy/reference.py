"""Owns the reference of a trade-off: figures in the limit of mesh and contact springs, in float64, and what is left.

Three meshes with stiff contact springs give each figure's order and limit (`convergence.py`). Springs soften relative
to the mesh as h / penalty, so that the limit of the mesh is also that of the springs; they are chosen stiff enough that
they do not hide the order of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from warp_mca.accuracy.convergence import NO_RUN, Limit, limits
from warp_mca.accuracy.figures import BOUND, NAMES
from warp_mca.accuracy.knobs import BASE, Trial, penalty_of
from warp_mca.accuracy.measure import Bench, Measured
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import bad_value
from warp_mca.scene import Scene

LADDER = (1.0, 3.0, 10.0)  # penalties of which the softest is taken whose springs hold no more than STIFF
UNCHECKED = 3.0  # penalty that is taken, at least, where there is no time for others
STIFF = 0.005  # largest relative difference of a penalty's figures from those of stiff springs
FINEST = (2.0, 1.7, 1.4, 1.2, 1.0)  # finest mesh of the reference over the scene's own; the first that can be afforded
STEP = 1.4  # between the cells of its meshes


@dataclass(frozen=True, kw_only=True)
class Reference:
    """What variants are compared with.

    Attributes:
        limits: of each figure.
        levels: runs of its meshes, from the coarsest.
        penalty: of all contacts in them; None without contacts.
        springs: share that springs of this penalty take from each figure, on the mesh of the scene as written [-].
    """

    limits: Mapping[str, Limit]
    levels: Sequence[Measured]
    penalty: float | str | None
    springs: Mapping[str, float]

    @property
    def figures(self) -> dict[str, float | None]:
        """The limit of each figure; None where there is none."""
        return {name: limit.value for name, limit in self.limits.items()}


def choose_penalty(
    bench: Bench, afford: Callable[[Variant], bool], note: Callable[[Trial], Measured]
) -> tuple[float | str | None, dict[str, float]]:
    """The penalty of the reference, and the share that its springs take from each figure, as far as that was measured.

    The limit of stiff springs is that of a series of penalties as 1/penalty goes to zero, on the scene's own mesh.

    Args:
        bench: that ran the scene as written.
        afford: whether a variant can be run within the budget.
        note: runs a variant and keeps what was measured.
    """
    own = penalty_of(bench.scene)
    if not bench.scene.contacts:
        return None, {}
    runs: dict[float, Measured] = {}
    for penalty in LADDER:
        trial = BASE if penalty == own else Trial("springs", Variant(penalty=penalty))
        if trial is BASE or afford(trial.variant):
            found = note(trial)
            if not found.stopped:
                runs[penalty] = found
    if len(runs) < 2:
        return max(own, UNCHECKED) if isinstance(own, float | int) else UNCHECKED, {}
    stiff = limits([1.0 / penalty for penalty in runs], [found.figures for found in runs.values()])
    taken = {penalty: _taken(found, stiff) for penalty, found in runs.items()}
    chosen = next((penalty for penalty in runs if _stiff(runs[penalty], taken[penalty])), max(runs))
    return chosen, taken[chosen]


def _stiff(found: Measured, taken: Mapping[str, float]) -> bool:
    """Whether the loss in springs is negligible for all figures that an asked accuracy binds."""
    return all(found.figures.get(name) is None or abs(taken.get(name, 1.0)) <= STIFF for name in BOUND)


def _taken(found: Measured, stiff: Mapping[str, Limit]) -> dict[str, float]:
    """Share by which each figure differs from its limit of stiff springs."""
    shares = {}
    for name, limit in stiff.items():
        value = found.figures.get(name)
        if limit.value and value is not None:
            shares[name] = value / limit.value - 1.0
    return shares


def find_reference(
    bench: Bench,
    penalty: float | str | None,
    springs: Mapping[str, float],
    allowed: float,
    note: Callable[[Trial], Measured],
) -> Reference:
    """Run the meshes of the reference, and take the limits of their figures.

    Args:
        bench: that ran the scene as written.
        penalty, springs: as `choose_penalty` found them.
        allowed: time that the runs may take [s]; the coarsest choice is taken in any case.
        note: as in `choose_penalty`.

    Raises:
        RequestError: fewer than two meshes gave a result, or the runs have none of the figures.
    """
    name, trials = bench.scene.name, _meshes_of(bench, penalty, allowed)
    if len(trials) < 2:
        remedy = "it has no reference, for its cells are so few that other values of refine mesh it alike; make more"
        raise bad_value("scene", name, remedy)
    runs = [note(trial) for trial in trials]
    levels = [found for found in runs if not found.stopped]
    if len(levels) < 2:
        why = next(found.stopped for found in runs if found.stopped)
        raise bad_value("scene", name, f"it has no reference, for other meshes of it do not run: {why}")
    sizes = [level.elements ** (-1.0 / 3.0) for level in levels]  # as meshed: counts of cells are rounded
    different = [k for k, size in enumerate(sizes) if k == 0 or size < sizes[k - 1]]
    levels, sizes = [levels[k] for k in different], [sizes[k] for k in different]
    found = limits(sizes, [level.figures for level in levels], _resolution(bench.scene))
    if all(limit.why == NO_RUN for limit in found.values()):
        remedy = f"a run of it has none of the figures {', '.join(NAMES)}; give a scene with a contact, paths or yield"
        raise bad_value("scene", name, remedy)
    return Reference(limits=found, levels=levels, penalty=penalty, springs=springs)


def least_cost(bench: Bench, penalty: float | str | None) -> float:
    """Time of the steps of the coarsest reference [s], as far as it can be foreseen."""
    return sum(bench.foreseen_steps(trial.variant) for trial in _meshes_of(bench, penalty, 0.0))


def _meshes_of(bench: Bench, penalty: float | str | None, allowed: float) -> list[Trial]:
    """The finest meshes of the reference that take no longer than that [s]; the coarsest in any case."""
    trials: list[Trial] = []
    for finest in FINEST:
        found = list(_levels(bench, finest, penalty))
        trials = found if len(found) > 1 or not trials else trials
        if len(trials) > 1 and sum(bench.foreseen(trial.variant) for trial in trials) <= allowed:
            break
    return trials


def _levels(bench: Bench, finest: float, penalty: float | str | None) -> Iterator[Trial]:
    """Meshes of the reference, from the coarsest; each once."""
    own, seen = None if penalty == penalty_of(bench.scene) else penalty, set[Hashable]()
    for factor in (finest / STEP**2, finest / STEP, finest):
        refine = bench.scene.refine * round(factor, 3)
        variant = Variant(refine=refine, penalty=own, precision="float64", multi_rate="auto")
        if bench.key(variant) not in seen:
            seen.add(bench.key(variant))
            yield Trial("reference", variant)


def _resolution(scene: Scene) -> dict[str, float]:
    """Resolution of each figure: the start and end of a contact are rows of the history."""
    return {"contact_duration": scene.impact.output_interval}
