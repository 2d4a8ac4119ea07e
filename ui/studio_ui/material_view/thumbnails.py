"""Small balls of materials for lists: made when they are seen, kept while they stay the same."""

from __future__ import annotations

import weakref
from collections import OrderedDict
from collections.abc import Callable, Container, Hashable

from PySide6.QtCore import QSize
from PySide6.QtGui import QIcon, QPixmap

from studio_core.scene.nodes import Material, MaterialId
from studio_core.shading.lamps import shown_environment
from studio_ui.context import Context
from studio_ui.material_view.ball_view import as_image
from studio_ui.material_view.work import Linear, PreviewWork, light_of

_KEPT = 512
_WHITES = -0.8  # EV at which white surfaces differ in the neutral room
Ball = tuple[Linear, bool]


class MaterialThumbnails:
    """`icon` is there at once or later: then `came(material)` tells. Equal materials share one picture.

    `neutral`: in a grey room with a window rather than in the scene's light.
    """

    def __init__(self, context: Context, work: PreviewWork, size: int, *, neutral: bool = False) -> None:
        self.came: Callable[[MaterialId], object] = lambda material: None
        self._context, self._work, self._size, self._neutral = context, work, size, neutral
        self._balls: OrderedDict[Hashable, Ball | None] = OrderedDict()
        self._icons: dict[MaterialId, tuple[Hashable, QIcon]] = {}
        self._asked: dict[MaterialId, Hashable] = {}

    def icon(
        self,
        material: Material,
        ratio: float,
        whole: Callable[[], Material] | None = None,
        mark: Hashable = None,
    ) -> QIcon | None:
        """The newest there is, while the right one is made; None where there never was one.

        `whole` reads what `material` leaves out, beside the window; `mark` changes with it.
        """
        scene, session = self._context.document.scene, self._context.session
        environment = None if self._neutral else shown_environment(scene)
        pixels = max(round(self._size * ratio), 8)
        key = (_look(material), mark, light_of(environment), pixels)
        old = self._icons.get(material.id)
        if old is not None and self._context.editing.busy:
            return old[1]  # the ball beside the form is followed; lists are drawn at rest
        if key not in self._balls:
            if self._context.warm and self._asked.get(material.id) != key:
                self._asked[material.id] = key
                self._work.thumbnail(
                    material, environment, pixels, lambda made: self._keep(material.id, key, made), whole
                )
            return old[1] if old is not None else None
        self._balls.move_to_end(key)
        ball = self._balls[key]
        if ball is None:
            return None
        linear, neutral = ball
        exposure = _WHITES if self._neutral else 0.0 if neutral else session.exposure
        gain = (1.0, 1.0, 1.0) if neutral or environment is None else environment.gain()
        shown = (key, exposure, gain, session.tonemap)
        if old is None or old[0] != shown:
            pixmap = QPixmap.fromImage(as_image(linear, gain, exposure, session.tonemap))
            pixmap.setDevicePixelRatio(ratio)
            made = QIcon(pixmap)
            made.addPixmap(pixmap, QIcon.Mode.Selected)  # not tinted
            old = self._icons[material.id] = (shown, made)
        return old[1]

    def only(self, materials: Container[MaterialId]) -> None:
        """Of what still waits to be made, leave out all others: they are not seen any more."""
        for material in [m for m in self._asked if m not in materials]:
            if self._work.forget(material):
                del self._asked[material]

    def _keep(self, material: MaterialId, key: Hashable, made: Ball | None) -> None:
        self._balls[key] = made
        if len(self._balls) > _KEPT:
            self._balls.popitem(last=False)
        if self._asked.get(material) == key:
            del self._asked[material]
        self.came(material)

    @property
    def room(self) -> QSize:
        """Of an icon."""
        return QSize(self._size, self._size)


def _look(material: Material) -> Hashable:
    """All that its ball depends on; pictures by identity, for hashing their pixels would take long."""
    values = tuple(sorted(material.values.items(), key=lambda item: item[0]))
    textures = tuple(
        (name, weakref.ref(one.image), one.affine)
        for name, one in sorted(material.textures.items(), key=lambda item: item[0])
    )
    tables = tuple((name, weakref.ref(table)) for name, table in sorted(material.tables.items()))
    return material.model, values, textures, tables, material.opacity


__all__ = ["MaterialThumbnails"]
