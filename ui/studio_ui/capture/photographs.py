"""The photographs of a capture: those that are known already, the others recalled from the project."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from studio_core.errors import InputError
from studio_core.imaging.photograph import Photograph
from studio_core.scene.capture import KeptPhotograph
from studio_core.shading.job import Job

_READING = 20  # of a whole run's length, one part is reading


@dataclass(frozen=True, eq=False)
class Read:
    """Photographs, and a sentence on each that is missing."""

    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...] = ()


def gathered(
    kept: Sequence[KeptPhotograph], known: Mapping[str, Photograph], folder: Path | None, job: Job
) -> Read:
    """The photographs of a capture, those that are `known` without reading them again.

    `folder` is the project's. One that cannot be read is left out; when that is all of them, the first one's
    InputError is raised.
    """
    found: list[Photograph] = []
    problems: list[InputError] = []
    with ExitStack() as held:
        decoder = None
        for number, one in enumerate(kept):
            job.checkpoint(number, _READING * len(kept))
            if one.digest in known:
                found.append(known[one.digest])
                continue
            from studio_core.capturing.keeping import recall
            from studio_core.imaging.io import ImageDecoder

            decoder = decoder or held.enter_context(ImageDecoder())
            try:
                found.append(recall(one, folder, decoder))
            except InputError as error:
                problems.append(error)
    if problems and not found:
        raise problems[0]
    return Read(tuple(found), tuple(str(error) for error in problems))
