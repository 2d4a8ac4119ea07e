"""Swatches that never were, captured: a woven cloth as a BTF, a stone under forty lamps.

Both come from the synthetic lab and go through the same fit as anybody's measurements. Their patterns fit
into the picture a whole number of times, so that they repeat without a seam.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from studio.bench.lab import Rig, scattered, shoot
from studio.bench.lab_btf import ClothBtf, Weave
from studio.bench.lab_surfaces import Gloss, Surface, Waves, rough_matte
from studio_core.scene.nodes import Material
from studio_plugins.residual.btf import hemisphere_81
from studio_plugins.residual.btf_fit import fit_btf
from studio_plugins.residual.fit import fit
from studio_plugins.residual.flat import flat_samples
from studio_plugins.residual.material import SHOWN, scene_material
from studio_plugins.residual.pictures import Pictures
from studio_plugins.residual.result import Settings

CLOTH_TEXELS, CLOTH_DIRECTIONS = 128, 40
STONE_TEXELS, LAMPS = 192, 40
SETTINGS = Settings(among=SHOWN, refine=0, basis="albedo-half", cautious=False, table=False)
TERRACOTTA, RUST = (0.5, 0.17, 0.09), (0.36, 0.11, 0.06)
LIMESTONE, VEIN = (0.62, 0.56, 0.47), (0.5, 0.42, 0.33)


def cloth() -> Material:
    """Terracotta wool, sixteen yarns to the picture's width."""
    weave = Weave(CLOTH_TEXELS, 16, 0.012, TERRACOTTA, RUST, (0.03, 25.0), seed=4)
    towards = hemisphere_81()[:: 81 // CLOTH_DIRECTIONS]
    found, _ = fit_btf(ClothBtf(weave, towards, parallax=False), SETTINGS)
    return scene_material(found, "Captured wool").material


def stone() -> Material:
    """Honed limestone: clouds and veins, a fine grain that throws shadows, a dull shine."""
    rng = np.random.default_rng(5)
    turn, length = rng.uniform(0, np.pi, 20), rng.uniform(22, 48, 20)
    pairs = np.rint(np.stack([length * np.cos(turn), length * np.sin(turn)], axis=1)).astype(int)
    grain = repeating([(int(across), int(up)) for across, up in pairs], 8)
    shine = Gloss("blinn", 45.0, (0.05, 0.05, 0.05))
    clouds = [(1, 2), (2, 1), (3, -2), (-1, 3), (4, 1), (2, 5), (-5, 3), (6, 4), (9, -7), (5, 11)]
    veins = repeating(clouds, 7)
    surface = Surface(LIMESTONE, VEIN, veins, 0.8, grain, 0.0003, rough_matte(0.35), (shine,))
    rig = Rig((STONE_TEXELS, STONE_TEXELS), flat=True, samples=1)
    shots = shoot(surface, scattered(LAMPS, 3), rig)
    samples = flat_samples(Pictures(shots.pictures, shots.clipped, shots.told), STONE_TEXELS)
    settings = dataclasses.replace(SETTINGS, basis="albedo-light")
    return scene_material(fit(samples, settings), "Captured limestone").material


def repeating(periods: list[tuple[int, int]], seed: int) -> Waves:
    """Waves with so many periods across and up a picture of width 1."""
    rng = np.random.default_rng(seed)
    vectors = 2 * np.pi * np.array([(*pair, 0) for pair in periods], np.float32)
    return Waves(vectors.astype(np.float32), rng.uniform(0, 2 * np.pi, len(periods)).astype(np.float32))
