"""Stages that count their runs, keep what they can, and can be stopped anywhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from studio_core.errors import Cancelled
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Camera, Light, Scene
from studio_core.session import View
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs, Pipeline


class Places(dict):  # type: ignore[type-arg]
    """World matrix of every node that light meets; cameras are none."""


class Looks(dict):  # type: ignore[type-arg]
    """Material by id."""


class Gains(dict):  # type: ignore[type-arg]
    """Gain of every shown light."""


class Count(int):
    """How many nodes there are without cameras, roughly: often the same again."""


class Summary(tuple):
    """Made of the count alone."""


class Picture(tuple):
    """Everything, seen from somewhere."""


class Stage:
    """Counts runs; `interrupt(stage)` is called in the middle of each."""

    needs: tuple[type, ...] = ()
    gives: type
    dirtied_by = Aspect.NONE

    def __init__(self) -> None:
        self.runs = 0
        self.interrupt: Callable[[Stage], None] = lambda stage: None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Any:
        self.runs += 1
        job.checkpoint(0, 2)
        self.interrupt(self)
        made = self.make(frame, inputs)
        job.checkpoint(1, 2)
        return made

    def make(self, frame: Frame, inputs: Inputs) -> Any:
        raise NotImplementedError


class PlacesStage(Stage):
    """Recomputes only the nodes that are named, so it is wrong whenever one was forgotten."""

    gives = Places
    dirtied_by = Aspect.STRUCTURE | Aspect.TRANSFORM

    def make(self, frame: Frame, inputs: Inputs) -> Places:
        made = Places(inputs.previous or {})
        scene = frame.scene
        for node in [*inputs.changes.nodes, *(() if inputs.previous else scene.nodes)]:
            made.pop(node, None)
            if node in scene.nodes and not isinstance(scene[node], Camera):
                made[node] = scene.world(node)
        return made


class LooksStage(Stage):
    """Like the places, by material."""

    gives = Looks
    dirtied_by = Aspect.MATERIAL

    def make(self, frame: Frame, inputs: Inputs) -> Looks:
        made = Looks(inputs.previous or {})
        materials = frame.scene.materials
        for material in [*inputs.changes.materials, *(() if inputs.previous else materials)]:
            made.pop(material, None)
            if material in materials:
                made[material] = materials[material]
        return made


class GainsStage(Stage):
    """Made anew each time; the same object again when nothing differs."""

    gives = Gains
    dirtied_by = Aspect.STRUCTURE | Aspect.LIGHT | Aspect.GAIN

    def make(self, frame: Frame, inputs: Inputs) -> Gains:
        scene = frame.scene
        made = Gains({light.id: light.gain() for light in scene.of(Light) if scene.shown(light.id)})
        return inputs.previous if made == inputs.previous else made


class CountStage(Stage):
    """Cut off early most of the time."""

    gives = Count
    dirtied_by = Aspect.STRUCTURE

    def make(self, frame: Frame, inputs: Inputs) -> Count:
        cameras = sum(1 for _ in frame.scene.of(Camera))
        made = Count((len(frame.scene.nodes) - cameras + 1) // 4)
        return inputs.previous if made == inputs.previous else made


class SummaryStage(Stage):
    """Dirtied by nothing: runs when the count is another one."""

    needs = (Count,)
    gives = Summary

    def make(self, frame: Frame, inputs: Inputs) -> Summary:
        assert Count in inputs.rebuilt
        return Summary([inputs[Count]])


class PictureStage(Stage):
    """The last: needs everything."""

    needs = (Places, Looks, Gains, Summary)
    gives = Picture
    dirtied_by = Aspect.VIEW

    def make(self, frame: Frame, inputs: Inputs) -> Picture:
        parts = [tuple(sorted(inputs[kind].items(), key=str)) for kind in (Places, Looks, Gains)]
        return Picture([*parts, inputs[Summary], frame.view])


class Detail(int):
    """How finely the places are looked at."""


class DetailStage(Stage):
    """Wants a finer round until it is at `most`."""

    needs = (Places,)
    gives = Detail
    most = 3

    def __init__(self) -> None:
        super().__init__()
        self.proven = 0
        self.proposed: int | None = None
        self.asked = 0

    def make(self, frame: Frame, inputs: Inputs) -> Detail:
        made = Detail(self.proven if self.proposed is None else self.proposed)
        return inputs.previous if made == inputs.previous else made

    def again(self, frame: Frame, made: Mapping[type, Any], rounds: int, job: Job) -> bool:
        self.asked += 1
        if self.proposed is not None:
            self.proven, self.proposed = self.proposed, None
        job.checkpoint(0, 2)
        assert made[Detail] == self.proven
        if self.proven == self.most:
            return False
        self.proposed = self.proven + 1
        job.checkpoint(1, 2)
        return True

    def abandon(self) -> None:
        self.proposed = None


class DetailedPicture(PictureStage):
    """Tells the detail, too."""

    needs = (*PictureStage.needs, Detail)

    def make(self, frame: Frame, inputs: Inputs) -> Picture:
        return Picture([*super().make(frame, inputs), inputs[Detail]])


KINDS: list[type[Stage]] = [
    PlacesStage,
    LooksStage,
    GainsStage,
    CountStage,
    SummaryStage,
    PictureStage,
]


def counting_stages() -> list[Stage]:
    """Fresh stages."""
    return [kind() for kind in KINDS]


def refining_stages() -> list[Stage]:
    """Fresh stages, of which one refines."""
    return [*(kind() for kind in KINDS[:-1]), DetailStage(), DetailedPicture()]


def from_scratch(scene: Scene, view: View) -> Picture:
    """What a pipeline without a past gives."""
    made: Picture = Pipeline(counting_stages()).update(Frame(scene, view, None), Changes(), Job("all"))
    return made


class StoppingJob(Job):
    """Cancelled, or hit by a bug, at its n-th checkpoint (0: never)."""

    def __init__(self, at: int, error: type[BaseException] = Cancelled) -> None:
        super().__init__("stopping")
        self.at, self.error = at, error

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        super().checkpoint(done, total)
        if self.checkpoints == self.at:
            raise self.error("stopped")
