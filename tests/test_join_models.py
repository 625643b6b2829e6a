"""A batch carries every field of its models: one that nobody joined is refused, not lost."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from impacts import prepared
from test_batch import hinged

from warp_mca.base.joining import AS_IS, ITEMS, SCENE, join, joinable, of, offsets_of
from warp_mca.model.batch_model import join_models
from warp_mca.system.model import Model


def widened(item: Any, **more: object) -> Any:
    """The same with a new field that has a default, and a value of its own there."""
    ((name, value),) = more.items()
    field = (name, object, dataclasses.field(default=None))
    kind = dataclasses.make_dataclass(
        f"More{type(item).__name__}", [field], bases=(type(item),), frozen=True, kw_only=True
    )
    return kind(**{f.name: getattr(item, f.name) for f in dataclasses.fields(item)}, **{name: value})


@pytest.mark.parametrize("part", ["", "absorbing"])
def test_a_new_field_with_a_default_is_not_lost(part: str):
    models: list[Any] = [prepared(hinged(E=E)).model for E in (70e9, 50e9)]
    if part:
        models = [dataclasses.replace(m, **{part: widened(getattr(m, part), damper=np.ones(3))}) for m in models]
    else:
        models = [widened(model, damper=np.ones(3)) for model in models]
    with pytest.raises(TypeError, match=r"More\w+.damper: a batch would lose it"):
        join_models(models)


def test_values_in_fields_with_defaults_are_carried():
    """Whatever a field holds in one of the models, the batch holds; what a batch cannot have is refused."""
    models = [prepared(hinged(penalty=p)).model for p in (1.0, 2.0)]
    scaled = [dataclasses.replace(m, scaling=s) for m, s in zip(models, (None, scaling(models[1])), strict=True)]
    joined = join_models(scaled)
    assert joined.scaling is not None and joined.scaling.elements == 3
    assert np.array_equal(joined.scaling.added, np.concatenate([0.0 * models[0].mass, 0.1 * models[1].mass]))
    assert len(joined.penalties) == sum(len(model.penalties) for model in models)
    for name in ("rates", "floating"):
        with pytest.raises(ValueError, match=f"Model.{name}: models of a batch have none"):
            join_models([models[0], dataclasses.replace(models[1], **{name: object()})])


def scaling(model: Model) -> Any:
    from warp_mca.system.time_step import MassScaling

    return MassScaling(added=0.1 * model.mass, elements=3, plain_dt=model.stable.dt)


def test_a_field_without_a_rule_is_refused_where_it_is_written():
    class Part:
        a: int = dataclasses.field(metadata=AS_IS)
        b: int = 0

    with pytest.raises(TypeError, match=r"Part.b: a batch would lose it"):
        joinable(dataclasses.dataclass(frozen=True)(Part))


def test_numbers_are_raised_by_the_first_one_of_their_scene_and_the_ground_is_kept():
    @joinable
    @dataclasses.dataclass(frozen=True)
    class Item:
        node: int = dataclasses.field(metadata=of("nodes"))
        scene: int = dataclasses.field(default=0, metadata=SCENE)

    @joinable
    @dataclasses.dataclass(frozen=True)
    class Part:
        node: Any = dataclasses.field(metadata=of("nodes"))
        start: Any = dataclasses.field(metadata=offsets_of("rows"))
        items: tuple[Item, ...] = dataclasses.field(metadata=ITEMS)

    one = Part(np.array([0, -1, 3]), np.array([0, 2, 5]), (Item(1), Item(-1)))
    found = join([one, one], {"nodes": np.array([0, 4, 8]), "rows": np.array([0, 5, 10])})
    assert found.node.tolist() == [0, -1, 3, 4, -1, 7] and found.start.tolist() == [0, 2, 5, 7, 10]
    assert found.items == (Item(1), Item(-1), Item(5, 1), Item(-1, 1))
