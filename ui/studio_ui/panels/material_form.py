"""What the chosen materials are like: name, opacity, model of reflectance with its parameters, pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PySide6.QtWidgets import QFileDialog, QToolButton, QVBoxLayout, QWidget

from studio_core.contract import Brdf
from studio_core.edits import Compound, Edit, LayTextures, SetMaterial, SetTexture
from studio_core.errors import PluginError
from studio_core.metals import Metal
from studio_core.params import ParamInfo, Value, defaults, param_infos
from studio_core.scene.geometry import Image, Table, Texture
from studio_core.scene.nodes import Material, MaterialId
from studio_core.scene.pattern import PatternRuler
from studio_core.shading.grown_textures import grown, lying_alike
from studio_core.shading.job import Job
from studio_core.shading.materials import shape_textures
from studio_core.shading.normal_maps import NORMAL
from studio_core.texture_coordinates import bare_objects
from studio_ui.context import Context
from studio_ui.forms.fields import ColourField, Combo
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.sinks import EditSink
from studio_ui.forms.spin import MIXED
from studio_ui.look.theme import GAP
from studio_ui.objects.coordinates import TextureCoordinates
from studio_ui.panels.bare_row import BareRow
from studio_ui.panels.maps_row import MapsRow
from studio_ui.panels.measurement_row import MeasurementRow, measurement_of
from studio_ui.panels.panel import clear, note
from studio_ui.panels.texture_row import TextureRow

if TYPE_CHECKING:
    from studio_core.brdfs.fitting import Fit

_COMMON: Mapping[str, ParamInfo] = param_infos(Material)
_BUMPS: Mapping[str, ParamInfo] = {
    NORMAL: ParamInfo(
        "number", "Strength", "How steep the normal map's bumps are; below 0 they are dents",
        low=-3.0, high=3.0,
    )
}  # fmt: skip
PICTURES = "Pictures (*.png *.jpg *.jpeg *.exr *.hdr *.tif *.tiff)"


class MaterialForm(QWidget):
    """Built anew when other materials or another model are to be shown. An edit is one step for all."""

    def __init__(self, context: Context, tool: Callable[[str, str], QToolButton]) -> None:
        super().__init__()
        self.materials: tuple[MaterialId, ...] = ()
        self.form: ParamForm | None = None
        self.bumps: ParamForm | None = None
        self.common: ParamForm | None = None
        self.kind = Combo()
        self.kinds: list[str] = []
        self.textures: dict[str, TextureRow] = {}
        self.maps: MapsRow | None = None
        self.measurement: MeasurementRow | None = None
        self._fitted: Mapping[str, Value] | None = None
        self._context, self._tool = context, tool
        self._sink = EditSink(context.editing, self._make, self._label)
        self._built: object = self
        self._ruler = PatternRuler()
        self.bare: BareRow | None = None
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(GAP)

    def show_materials(self, chosen: tuple[MaterialId, ...]) -> None:
        """Those materials as they are now."""
        self.materials = chosen
        scene = self._context.document.scene
        materials = [scene.material(m) for m in chosen]
        models = {material.model for material in materials}
        model = self._brdf(materials[0].model) if len(models) == 1 else None
        tables = [measurement_of(material) for material in materials]
        key = (chosen, models, model is not None, self._context.warm, tables)
        if key != self._built:
            self._built = key
            self._build(materials, model)
            self._column.addStretch(1)
        if not materials:
            return
        last = materials[-1]
        if self.common is not None:
            values: dict[str, Any] = {name: getattr(last, name) for name in _COMMON}
            mixed = {n for n in values if any(getattr(m, n) != values[n] for m in materials)}
            self.common.show_values(values, mixed)
        if self.form is not None and model is not None:
            usual = defaults(model.Params)
            every = [{**usual, **material.values} for material in materials]
            mixed = {n for n in usual if any(one[n] != every[-1][n] for one in every)}
            self.form.show_values(every[-1], mixed)
        if self.bumps is not None:
            self.bumps.show_values({NORMAL: last.values.get(NORMAL, 1.0)}, set())
            self.bumps.setVisible(NORMAL in last.textures)
        laid = last.textures and (self.textures or self.maps is not None)
        lengths = self._ruler.lengths(scene, last.id) if laid else None
        if self.maps is not None:
            self.maps.show_maps(last.textures, lengths)
        for name, shown in self.textures.items():
            shown.show_texture(last.textures.get(name), lengths)
        if self.bare is not None:
            lacking = bare_objects(scene, material=last.id) if last.textures else ()
            self.bare.show_bare([node.name for node in lacking])
        if self.measurement is not None and last.values != self._fitted:
            self.measurement.tell("")  # it was of other values

    def load_picture(self, name: str, path: Path) -> None:
        """Read a picture away from the window's thread, then lay it on the surface."""
        materials, plain = self.materials, name == NORMAL

        def read(job: Job) -> Image:
            from studio_core.imaging.io import read_image

            return read_image(path, plain=plain)

        def done(image: Image) -> None:
            there = [m for m in materials if m in self._context.document.scene.materials]
            if there:
                self._put_texture(there[-1], name, Texture(self._meant(there[-1], name, image)))

        self._context.tasks.run(f"Reading {path.name}", read, done)

    def _meant(self, material: MaterialId, name: str, image: Image) -> Image:
        """The picture as plain numbers where it multiplies a number: maps of roughness are not encoded."""
        model = self._brdf(self._context.document.scene.material(material).model)
        infos = param_infos(model.Params) if model is not None else {}
        colour = name not in infos or infos[name].kind == "colour"
        return image if colour or image.pixels.dtype != np.uint8 else Image(image.pixels, "data")

    def _brdf(self, name: str) -> Brdf | None:
        if not self._context.warm:
            return None
        try:
            return self._context.host.brdf(name)
        except PluginError:
            return None

    def _build(self, materials: list[Material], model: Brdf | None) -> None:
        self._sink.commit()  # a slider that is held goes with its form
        clear(self._column)
        self.form = self.common = self.bumps = None
        self.textures = {}
        self.maps = self.measurement = self.bare = None
        if not materials:
            self._column.addWidget(note("The scene has no materials yet."))
            return
        if len(materials) > 1:
            told = f"What is set counts for all {len(materials)} materials; {MIXED} where they differ."
            self._column.addWidget(note(told))
        usual = {"opacity": 1.0, "catches": False}
        self.common = ParamForm(_COMMON, self._sink, defaults=usual)
        self._column.addWidget(self.common)
        self._column.addWidget(self._kinds(materials))
        table = measurement_of(materials[0]) if len(materials) == 1 else None
        if table is not None:
            self._column.addWidget(self._measurement(table, model))
        if model is not None:
            infos = param_infos(model.Params)
            self.form = ParamForm(infos, self._sink, defaults=defaults(model.Params))
            self._column.addWidget(self.form)
            for name, field in self.form.fields.items():
                if isinstance(field, ColourField) and field.menu is not None:
                    field.menu.metal = partial(self._put_metal, name)
            names = (*model.textures, *shape_textures(model)) if len(materials) == 1 else ()
            bare = self.bare = BareRow(self._make_coordinates) if names else None
            if any(name not in infos for name in names):  # made together, of no number that can be typed
                self._column.addWidget(self._pattern(materials[0].id, names, model.label))
                names = ()
            for name in names:
                self._column.addWidget(self._texture(materials[0].id, name, infos[name].label))
            if len(materials) == 1 and self.maps is None:
                told = "A picture of which way the surface is turned at each spot, green up as glTF has it"
                self._column.addWidget(self._texture(materials[0].id, NORMAL, "Normal", told))
                self.bumps = ParamForm(_BUMPS, self._sink, defaults={NORMAL: 1.0})
                self._column.addWidget(self.bumps)
            if bare is not None:
                self._column.addWidget(bare)
        elif not self._context.warm:
            self._column.addWidget(note("Loading…"))
        elif len({material.model for material in materials}) == 1:
            name = materials[0].model
            self._column.addWidget(note(f"The kind {name!r} is not installed: see Help ▸ Plugins."))

    def _kinds(self, materials: list[Material]) -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        self.kind = Combo()
        self.kind.setAccessibleName("Kind")
        self.kind.setPlaceholderText(MIXED)
        models = dict.fromkeys(material.model for material in materials)
        self.kinds = [*self._context.host.names("brdf")]
        self.kinds += [name for name in models if name not in self.kinds]
        for name in self.kinds:
            brdf = self._brdf(name)
            self.kind.addItem(brdf.label if brdf is not None else name, name)
        self.kind.setCurrentIndex(self.kinds.index(materials[0].model) if len(models) == 1 else -1)
        self.kind.setEnabled(self._context.warm)
        self.kind.activated.connect(lambda i: self._change_model(self.kinds[i]))
        layout.addRow(form_label("Kind", "How the surface reflects light"), self.kind)
        return box

    def _texture(self, material: MaterialId, name: str, label: str, told: str = "") -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        made = TextureRow(
            label,
            self._tool,
            lambda: self._ask_picture(name),
            lambda texture: self._put_texture(material, name, texture),
            lambda texture: self._lay(material, name, texture),
            lambda times: self.grow_pictures(material, name, times),
            told,
        )
        self.textures[name] = made
        layout.addRow(form_label(f"{label} map", told or "A picture that the value is multiplied with"), made)
        layout.addRow(made.pattern)
        return box

    def _pattern(self, material: MaterialId, names: tuple[str, ...], kind: str) -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        self.maps = MapsRow(
            names,
            self._tool,
            lambda name, texture: self._lay(material, name, texture),
            lambda name, times: self.grow_pictures(material, name, times),
        )
        told = "What each spot has of its own, as it was photographed"
        layout.addRow(form_label(f"{kind} pattern", told), self.maps)
        layout.addRow(self.maps.pattern)
        return box

    def _measurement(self, table: Table, model: Brdf | None) -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        self.measurement = MeasurementRow(table, model, self.fit_to_measurement)
        told = "What was measured; the kind Measured shows it as it is"
        layout.addRow(form_label("Measurement", told), self.measurement)
        return box

    def fit_to_measurement(self) -> None:
        """The values with which the chosen kind comes nearest to the measurement, found in the background."""
        material = self._context.document.scene.material(self.materials[0])
        model, table = self._brdf(material.model), measurement_of(material)
        if model is None or table is None:
            return
        reflects: Brdf = model

        def work(job: Job) -> Fit:
            from studio_core.brdfs.fitting import fit
            from studio_core.brdfs.samples import of_table

            return fit(reflects, of_table(table), job=job)

        def done(found: Fit) -> None:
            there = self._context.document.scene.materials.get(material.id)
            if there is None or there.model != found.model:
                return  # something else was chosen meanwhile
            told = f"Off by {found.difference.rmse:.1%} (relative RMSE), metric {found.difference.metric:.2g}"
            self._fitted = {**there.values, **found.values}
            label = f"Fit {material.name} to its measurement"
            if self._context.editing.apply(SetMaterial(material.id, found.values, label=label)):
                self._context.journal.write(f"{material.name} fitted by {reflects.label}: {told}.")
            if self.measurement is not None and self.materials == (material.id,):
                self.measurement.tell(told)

        self._context.tasks.run(f"Fitting {reflects.label} to {material.name}", work, done)

    def _ask_picture(self, name: str) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Picture for the material", "", PICTURES)
        if path:
            self.load_picture(name, Path(path))

    # edits

    def _label(self, name: str) -> str:
        scene = self._context.document.scene
        there = [scene.material(m) for m in self.materials if m in scene.materials]
        model = self._brdf(there[-1].model)
        infos = {**(param_infos(model.Params) if model is not None else {}), **_COMMON, **_BUMPS}
        what = there[0].name if len(there) == 1 else f"{len(there)} materials"
        return f"{infos[name].label if name in infos else name} of {what}"

    def _make(self, name: str, value: Value) -> Edit:
        there = [m for m in self.materials if m in self._context.document.scene.materials]
        label = self._label(name)
        edits: list[Edit] = []
        for number, material in enumerate(there, 1):
            given: Any = f"{value} {number}" if name == "name" and len(there) > 1 else value
            if name in _COMMON:
                edits.append(SetMaterial(material, **{name: given}, label=label))
            else:
                edits.append(SetMaterial(material, {name: given}, label=label))
        return edits[0] if len(edits) == 1 else Compound(label, tuple(edits))

    def _put_metal(self, name: str, metal: Metal) -> None:
        """Its colour; where the model tells metals apart, the surface becomes one."""
        scene = self._context.document.scene
        edits: list[Edit] = []
        for chosen in self.materials:
            model = self._brdf(scene.material(chosen).model)
            values: dict[str, Value] = {name: metal.colour}
            if model is not None and "metallic" in param_infos(model.Params):
                values["metallic"] = 1.0
            edits.append(SetMaterial(chosen, values))
        what = scene.material(self.materials[0]).name
        what = what if len(self.materials) == 1 else f"{len(self.materials)} materials"
        self._context.editing.apply(Compound(f"{metal.name} for {what}", tuple(edits)))

    def _change_model(self, name: str) -> None:
        model = self._brdf(name)
        if model is None:
            return
        scene = self._context.document.scene
        edits: list[Edit] = []
        for chosen in self.materials:
            material = scene.material(chosen)
            if material.model != name:
                names = (*param_infos(model.Params), NORMAL)
                kept = {n: material.values[n] for n in names if n in material.values}
                edits.append(SetMaterial(chosen, kept, model=name))
        if edits:
            what = scene.material(self.materials[0]).name
            what = what if len(self.materials) == 1 else f"{len(self.materials)} materials"
            self._context.editing.apply(Compound(f"Kind of {what}", tuple(edits)))

    def _put_texture(self, material: MaterialId, name: str, texture: Texture | None) -> None:
        if material in self._context.document.scene.materials:
            label = f"Picture of {self._context.document.scene.material(material).name}"
            self._context.editing.apply(SetTexture(material, name, texture, label))

    def _lay(self, material: MaterialId, name: str, texture: Texture) -> None:
        """Another place for this picture and all of the material that lie as it does."""
        there = self._context.document.scene.materials.get(material)
        if there is None or name not in there.textures:
            return
        alike = tuple(key for key, one in there.textures.items() if one.affine == there.textures[name].affine)
        laid = (texture.scale, texture.offset, texture.rotation, texture.aspect)
        self._context.editing.apply(LayTextures(material, *laid, alike, f"Pattern of {there.name}"))

    def grow_pictures(self, material: MaterialId, name: str, times: int) -> None:
        """Larger pictures that do not repeat, of this one and all that lie as it does; in the background."""
        before = self._context.document.scene.material(material)
        alike, seed = lying_alike(before.textures, name), len(self._context.document.history)

        def work(job: Job) -> dict[str, Texture]:
            return grown(alike, times, seed=seed, job=job)

        def done(found: dict[str, Texture]) -> None:
            there = self._context.document.scene.materials.get(material)
            if there is None or any(there.textures.get(key) is not one for key, one in alike.items()):
                return  # something else lies there meanwhile
            edits = tuple(SetTexture(material, key, one) for key, one in found.items())
            self._context.editing.apply(Compound(f"Larger pattern of {there.name}", edits))

        self._context.tasks.run(f"Growing the pattern of {before.name}", work, done)

    def _make_coordinates(self) -> None:
        """For all objects with this material that have none."""
        if len(self.materials) == 1:
            scene = self._context.document.scene
            TextureCoordinates(self._context).make(bare_objects(scene, material=self.materials[0]))
