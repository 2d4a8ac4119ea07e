"""What a method that gathers over kept rays knows of light between surfaces, for whoever comes after it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from studio_core.scene.nodes import Light as LightNode
from studio_core.scene.nodes import NodeId
from studio_core.shading.artifacts import Shapes
from studio_core.transport.bounces import KeptRays, Light, Sources, Surface
from studio_core.transport.source_light import SourceLight


@dataclass(frozen=True, eq=False)
class Exchange:
    """What the vertices of the unrefined meshes send, and what it was made from.

    sources: what is sent after `bounces` (None: all), by `surface`; shapes are what its rows are made of.
    tables: kept rays of all vertices, of which many may have several rows. straight: light from lamps and
    environment, whose gains are those of `lights`. separation: tolerance and most functions with which BRDFs
    were separated. Tables and straight light change in place: they are those
    of the newest frame, and belong to the compute thread.
    """

    sources: Sources
    surface: Surface
    shapes: Shapes
    tables: tuple[KeptRays, ...]
    bounces: int | None
    straight: SourceLight
    lights: Mapping[NodeId, LightNode]
    separation: tuple[float, int]

    @property
    def light(self) -> Light:
        """What is sent."""
        return self.sources.light


__all__ = ["Exchange"]
