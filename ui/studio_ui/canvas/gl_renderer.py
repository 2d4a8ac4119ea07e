"""Draws pictures with OpenGL, through `vispy.gloo` alone: no window, no Qt.

Surfaces are drawn into floating-point samples (n × n a pixel, at the places where the raster canvas has
them), then what is looked through, layer by layer from the front (Everitt, Interactive order-independent
transparency, 2001), then marks; one last pass averages samples and maps tones. A context must be current, and
its gloo canvas the current one, whenever anything here is called.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Container
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from vispy import gloo

from studio_core.kernels.compose import AFFINE, CAUGHT, CONSTANT, GENERAL
from studio_core.scene.nodes import NodeId
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.shading.coefficients import LEVELS
from studio_core.shading.primary import LAYERS
from studio_ui.canvas import gl_shaders as shaders
from studio_ui.canvas.gl_buffers import Tally
from studio_ui.canvas.gl_camera import Camera
from studio_ui.canvas.gl_maps import Atlas
from studio_ui.canvas.gl_scene import Batch, Body, GlScene, Places
from studio_ui.canvas.gl_sky import Sky
from studio_ui.canvas.gl_sky_shaders import BACKDROP_FRAGMENT
from studio_ui.canvas.gl_still import Still
from studio_ui.canvas.gl_target import Target, Targets
from studio_ui.canvas.projection import axes_of, extent

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Rgb = tuple[float, float, float]
KINDS = {"srgb": 0.0, "filmic": 1.0, "raw": 2.0}
NEAREST = 2e-3  # metres
NOTHING_BEHIND = 1e30  # metres
CORNERS = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], np.float32)


@dataclass(frozen=True)
class Look:
    """How a picture is to be drawn: `view` in device pixels, `samples` along each side of a pixel."""

    view: View
    samples: int = 2
    exposure: float = 0.0
    tonemap: str = "srgb"
    chosen: frozenset[NodeId] = frozenset()
    rim: int = 2
    accent: Rgb = (1.0, 0.6, 0.1)
    grid: Rgb | None = None
    ground: Rgb = (0.0, 0.0, 0.0)
    """What is shown without a picture."""
    places: Places = field(default_factory=dict)
    """Where objects are by now; see `GlScene.place`."""


class Picked(NamedTuple):
    """An object by its number, metres along the ray, and its radiance where it is not looked through."""

    object: int
    distance: float
    radiance: Rgb


class Renderer:
    """One context's pictures. `largest_texture` is what the driver allows, texels along a side."""

    def __init__(self, largest_texture: int = 8192) -> None:
        self.tally = Tally()
        self.scene = GlScene(self.tally, largest_texture)
        self._targets = Targets()
        self._programs: dict[object, Any] = {}
        self._corners = gloo.VertexBuffer(CORNERS)
        self._sky = Sky(self.tally, largest_texture)
        self._still = Still(self.tally)
        self._picture: Picture | None = None
        self._nearest = 1.0

    def show(self, picture: Picture | None) -> None:
        """Another picture: what it has and the last one had not is uploaded."""
        if picture is self._picture:
            return
        self._picture = picture
        if picture is None:
            self.scene.clear()
            self._still.clear()
        elif picture.colours is None:
            self.scene.clear()
        else:
            self._still.clear()
            self.scene.show(picture)
            self._sky.follow(picture)
        if picture is not None and picture.distance.size:
            self._nearest = float(picture.distance.min())

    def draw(self, look: Look) -> None:
        """The picture into what was bound when the context was made current, `look.view` pixels large."""
        n = look.samples
        if self._picture is None:
            queue = gloo.get_current_canvas().context.glir
            gloo.set_viewport(0, 0, look.view.width, look.view.height)
            queue.command("FUNC", "glClearColor", *look.ground, 1.0)
            gloo.clear(color=True, depth=False)
            return
        self.scene.place(look.places)
        size = (look.view.width * n, look.view.height * n)
        self._targets.resize(size, self.scene.layered)
        camera = Camera.of(look.view, self._near_far(look.view))
        gain = float(2.0**look.exposure)
        light = self._targets.light
        light.begin((0.0, 0.0, 0.0, NOTHING_BEHIND))
        if self._picture.colours is None:
            self._still.draw(self, self._picture, gain)
        else:
            self._surfaces(look, camera, gain)
            self._backdrop(look, gain)
        light.end()
        if self.scene.layered:
            self._layers(look, camera, gain)
        marked = self._marks(look, camera)
        self._display(look, size, marked)

    def pick(self, view: View, x: float, y: float) -> Picked | None:
        """What lies under a point (0…1 from the top left); what is looked through counts as well."""
        camera = Camera.of(view, self._near_far(view), (x, y))
        target = Target((1, 1), "rgba32f", "own")
        canvas = gloo.get_current_canvas()

        def read() -> tuple[float, ...]:
            canvas.context.flush_commands()
            found = gloo.read_pixels((0, 0, 1, 1), alpha=True, out_type="float")[0, 0]
            return tuple(float(value) for value in found)

        try:
            target.begin((0.0, 0.0, 0.0, 0.0))
            self._surfaces(Look(view, 1), camera, 1.0)
            red, green, blue, _ = read()
            target.begin((-1.0, 0.0, 0.0, 0.0))
            gloo.set_state(depth_test=True, blend=False, depth_func="less")
            self._plain(camera, lambda index: (float(index), 0.0, 0.0, -1.0), range(len(self.scene.bodies)))
            index, _, _, distance = read()
        finally:
            gloo.set_state(cull_face=False)
            target.end()
            target.delete()
        return Picked(round(index), distance, (red, green, blue)) if index >= 0 else None

    def compile(self) -> None:
        """Try out all programs without drawing anything."""
        for kind, peeled in itertools.product((CONSTANT, AFFINE, GENERAL), (False, True)):
            terms = {AFFINE: 1, GENERAL: 3}.get(kind, 0)
            self._mesh_program(kind, peeled, terms, relief=False)
        self._mesh_program(CAUGHT, False, 0, relief=False)
        self._program("plain", *shaders.plain_program(shaders.PLAIN_FRAGMENT))
        self._program("layer", *shaders.plain_program(shaders.LAYER_FRAGMENT))
        self._program("backdrop", shaders.SCREEN_VERTEX, BACKDROP_FRAGMENT)
        self._program("still", shaders.SCREEN_VERTEX, shaders.STILL_FRAGMENT)
        self._program("display", *shaders.display_program())
        canvas = gloo.get_current_canvas()
        for program in self._programs.values():
            canvas.context.glir.associate(program.glir)
        canvas.context.flush_commands()

    def close(self) -> None:
        """Give everything back to the context, which must be current for the last time."""
        self.scene.clear()
        self._still.clear()
        self._targets.delete()
        self._sky.clear()
        self._corners.delete()
        for program in self._programs.values():
            program.delete()
        self._programs = {}
        gloo.get_current_canvas().context.flush_commands()

    # passes

    def _surfaces(self, look: Look, camera: Camera, gain: float) -> None:
        gloo.set_state(depth_test=True, blend=False, depth_func="lequal")
        self._mesh(look, camera, gain, clear=False, layer=None)
        gloo.set_state(cull_face=False)

    def _mesh(self, look: Look, camera: Camera, gain: float, clear: bool, layer: Target | None) -> None:
        """All batches of one sort, by kind of coefficients."""
        own = list(self.scene.draws(clear))
        for kind, relief in itertools.product((CONSTANT, AFFINE, CAUGHT, GENERAL), (False, True)):
            batches = [
                (b, batch) for _, b, batch in own if (batch.kind, batch.relief is not None) == (kind, relief)
            ]
            if not batches:
                continue
            if kind == CAUGHT and self._sky.backdrop is None:
                kind = CONSTANT  # there is no photograph: it is as black as it is by itself
            terms = max(len(batch.atlas.textures) if batch.atlas else 0 for _, batch in batches)
            program = self._mesh_program(kind, layer is not None, terms, relief)
            program["u_projection"] = camera.projection.T
            program["u_gain"] = gain
            if layer is not None:
                program["u_layer"], program["u_size"] = layer.texture, layer.size
            if kind == CAUGHT:
                self._sky.under(program, look.view)
            elif kind != CONSTANT or relief:
                rows = look.view.height * look.samples
                program["u_pixel_angle"] = float(2 * np.tan(np.radians(look.view.fov) / 2) / rows)
            for body, batch in batches:
                self._dress(program, body, batch)
                if layer is not None:
                    program["u_opacity"] = batch.opacity
                self._place(program, camera, body, batch)
                self._go(program, batch.indices)

    def _dress(self, program: Any, body: Body, batch: Batch) -> None:
        """A batch's light and maps."""
        program["a_plain"] = body.plain.buffer
        if batch.kind == CAUGHT and self._sky.backdrop is not None:
            program["a_slope"] = body.slope.buffer
        atlas, fine = batch.atlas, batch.relief
        if atlas is not None or fine is not None:
            program["a_uv"] = body.shape.uvs.buffer
        if fine is not None:
            _lay(program, "u_relief_", fine, batch.relief_map)
            program["u_relief_turn"] = batch.relief_map[6:10]
            program["u_relief_strength"] = batch.relief_map[10]
            program["u_relief"] = fine.textures[0]
            for number in range({CONSTANT: 3, AFFINE: 6}.get(batch.kind, 4)):
                program[f"a_bend{number}"] = body.bends[number].buffer
        if atlas is None:
            return
        _lay(program, "u_", atlas, batch.uv_map)
        for number, texture in enumerate(atlas.textures):
            program[f"u_map{number}"] = texture
        if batch.kind == AFFINE:
            program["a_slope"] = body.slope.buffer
        else:
            for number, attribute in enumerate(body.sums[: len(atlas.textures)]):
                program[f"a_sum{number}"] = attribute.buffer

    def _place(self, program: Any, camera: Camera, body: Body, batch: Batch) -> None:
        """Where a batch stands, and which sides of it are drawn."""
        program["a_position"] = body.shape.positions.buffer
        program["u_eye_from_model"] = (camera.from_world @ body.transform.matrix()).T.astype(np.float32)
        gloo.set_state(cull_face=batch.culled)

    def _backdrop(self, look: Look, gain: float) -> None:
        if self._sky.backdrop is None:
            return
        program = self._program("backdrop", shaders.SCREEN_VERTEX, BACKDROP_FRAGMENT)
        self._sky.behind(program, look.view, gain)
        gloo.set_state(depth_test=True, depth_func="lequal", cull_face=False)
        self._fill(program)

    def _layers(self, look: Look, camera: Camera, gain: float) -> None:
        """What is looked through, from the front: its light is added to what layers before let through."""
        clear = self._targets.clear
        clear.begin((0.0, 0.0, 0.0, 1.0))
        clear.end()
        before = self._targets.layer(1)
        before.begin((0.0, 0.0, 0.0, 0.0))
        before.end()
        program = self._program("layer", *shaders.plain_program(shaders.LAYER_FRAGMENT))
        for number in range(LAYERS):
            layer = self._targets.layer(number)
            layer.begin((0.0, 0.0, 0.0, NOTHING_BEHIND))
            gloo.set_state(depth_test=True, blend=False, depth_func="less")
            program["u_projection"] = camera.projection.T
            program["u_opaque"], program["u_before"] = self._targets.light.texture, before.texture
            program["u_size"] = layer.size
            for _, body, batch in self.scene.draws(clear=True):
                self._place(program, camera, body, batch)
                self._go(program, batch.indices)
            layer.end()
            clear.begin(None)
            gloo.set_state(depth_test=False, blend=True)
            gloo.set_blend_func("dst_alpha", "one", "zero", "one_minus_src_alpha")
            self._mesh(look, camera, gain, clear=True, layer=layer)
            gloo.set_state(blend=False)
            clear.end()
            before = layer
        gloo.set_state(cull_face=False)

    def _marks(self, look: Look, camera: Camera) -> bool:
        """The parts of chosen objects that are seen; whether there may be any."""
        nodes = self.scene.nodes
        chosen = {index for index, node in enumerate(nodes) if node in look.chosen}
        still = self._picture is not None and self._picture.colours is None
        if not (chosen or (still and look.chosen)):
            return False
        marks = self._targets.marks
        marks.begin((0.0, 0.0, 0.0, 0.0), clear_depth=False)
        gloo.set_depth_mask(False)
        if still and self._picture is not None:
            self._still.mark(self, self._picture, look.chosen)
        else:
            gloo.set_state(depth_test=True, depth_func="lequal", blend=False)
            self._plain(camera, lambda _: (1.0, 0.0, 0.0, 0.0), chosen)
        gloo.set_depth_mask(True)
        gloo.set_state(cull_face=False, blend=False)
        marks.end()
        return True

    def _plain(
        self, camera: Camera, colour: Callable[[int], tuple[float, ...]], objects: Container[int]
    ) -> None:
        """Objects in one colour each."""
        program = self._program("plain", *shaders.plain_program(shaders.PLAIN_FRAGMENT))
        program["u_projection"] = camera.projection.T
        for clear in (False, True):
            for index, body, batch in self.scene.draws(clear):
                if index in objects:
                    program["u_colour"] = colour(index)
                    self._place(program, camera, body, batch)
                    self._go(program, batch.indices)

    def _display(self, look: Look, size: tuple[int, int], marked: bool) -> None:
        program = self._program("display", *shaders.display_program())
        light, layered = self._targets.light, self.scene.layered
        program["u_opaque"] = light.texture
        program["u_clear"] = self._targets.clear.texture if layered else light.texture
        program["u_marks"] = self._targets.marks.texture if marked else light.texture
        program["u_size"] = size
        program["u_samples"] = float(look.samples)
        program["u_layered"], program["u_marked"] = float(layered), float(marked)
        program["u_rim"] = float(look.rim)
        program["u_accent"], program["u_grid"] = look.accent, look.grid or look.accent
        program["u_gridded"] = float(look.grid is not None)
        program["u_axes"] = axes_of(look.view).astype(np.float32)
        program["u_eye"] = look.view.transform.translation
        program["u_extent"] = extent(look.view)
        program["u_kind"] = KINDS[look.tonemap]
        gloo.set_viewport(0, 0, look.view.width, look.view.height)
        gloo.set_state(depth_test=False, blend=False, cull_face=False)
        self._fill(program)

    # parts

    def fill(self, program: Any) -> None:
        """Draw a program over all of the target."""
        self._fill(program)

    def program(self, name: object, vertex: str, fragment: str) -> Any:
        """A program, compiled when it is first asked for."""
        return self._program(name, vertex, fragment)

    def _fill(self, program: Any) -> None:
        program["a_corner"] = self._corners
        self.tally.draws += 1
        program.draw("triangle_strip")

    def _go(self, program: Any, indices: Any) -> None:
        self.tally.draws += 1
        program.draw("triangles", indices)

    def _mesh_program(self, kind: int, peeled: bool, terms: int, relief: bool) -> Any:
        key = (kind, peeled, terms, relief)
        if key in self._programs:
            return self._programs[key]
        return self._program(key, *shaders.mesh_program(kind, peeled, LEVELS, terms, relief))

    def _program(self, name: object, vertex: str, fragment: str) -> Any:
        if name not in self._programs:
            self._programs[name] = gloo.Program(vertex.strip(), fragment.strip())
        return self._programs[name]

    def _near_far(self, view: View) -> tuple[float, float]:
        """Depths between which everything lies; the nearest of the last picture, and some room."""
        eye = np.asarray(view.transform.translation, np.float64)
        far = 1.0
        for body in self.scene.bodies:
            matrix = body.transform.matrix()
            centre = matrix[:3, :3] @ body.shape.centre + matrix[:3, 3]
            far = max(far, float(np.linalg.norm(centre - eye)) + body.shape.radius * body.transform.scale)
        shown = self._picture
        hits = shown.radiance.hits if shown is not None and shown.colours is not None else None
        same = hits is not None and hits.view.transform == view.transform
        nearest = self._nearest if np.isfinite(self._nearest) else 1.0
        near = nearest * (0.8 if same else 0.1) / float(np.hypot(np.hypot(*extent(view)), 1))
        return max(min(near, far / 4), NEAREST), far * 1.01


def _lay(program: Any, prefix: str, atlas: Atlas, uv_map: tuple[float, ...]) -> None:
    """Where a map lies, and how large it is."""
    program[f"{prefix}uv_u"], program[f"{prefix}uv_v"] = uv_map[:3], uv_map[3:6]
    program[f"{prefix}sizes"] = (*atlas.finest, *atlas.size)
    program[f"{prefix}levels"] = float(atlas.levels)
