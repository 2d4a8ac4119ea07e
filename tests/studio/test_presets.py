"""The materials to begin with: every one is a model that is there, in its ranges, and believably bright."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.brdfs.albedo import mean_albedo
from studio_core.library.lucmat import Kept
from studio_core.library.presets import PRESETS
from studio_core.params import check, param_infos
from studio_core.registry import PluginHost
from studio_core.shading.materials import resolve

KINDS = {"paint", "wood", "metal", "plastic", "fabric", "leather", "stone", "ceramic", "glass"}
named = pytest.mark.parametrize("kept", PRESETS, ids=lambda kept: kept.name)


@named
def test_it_is_shown_as_what_it_says(kept: Kept, host: PluginHost) -> None:
    found = resolve(kept.material, host)
    assert not found.problem
    infos = param_infos(found.brdf.Params)
    for name, value in kept.material.values.items():
        assert check(name, infos[name], value) == value
    assert kept.tags[0] in KINDS


@named
def test_it_returns_as_much_light_as_such_things_do(kept: Kept, host: PluginHost) -> None:
    found = resolve(kept.material, host)
    made = mean_albedo(found.brdf, found.values)
    least, most = {"glass": (0.02, 0.2), "metal": (0.35, 0.99)}.get(kept.tags[0], (0.01, 0.9))
    assert least <= float(np.mean(made)) <= most


def test_there_is_something_of_each_kind_once() -> None:
    assert len({kept.name for kept in PRESETS}) == len({kept.material.id for kept in PRESETS}) == len(PRESETS)
    assert {kept.tags[0] for kept in PRESETS} == KINDS
