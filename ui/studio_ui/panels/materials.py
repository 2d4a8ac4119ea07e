"""Materials: the list, and the chosen one's model, parameters and pictures."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, QSize, QTimer
from PySide6.QtWidgets import QFileDialog, QLabel, QListWidget, QListWidgetItem, QPushButton, QWidget

from studio_core.contract import Brdf
from studio_core.edits import AddMaterial, Assign, Compound, Edit, RemoveMaterial, SetMaterial, SetTexture
from studio_core.errors import PluginError
from studio_core.params import ParamInfo, Value, defaults, param_infos
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Scene, new_id
from studio_core.shading.job import Job
from studio_ui.context import Context
from studio_ui.fields import Combo
from studio_ui.panels.panel import Panel, clear, note, row
from studio_ui.panels.swatch import SIZE, swatch
from studio_ui.param_form import ParamForm, form_label, form_layout
from studio_ui.sinks import EditSink

_COMMON: Mapping[str, ParamInfo] = param_infos(Material)
PICTURES = "Pictures (*.png *.jpg *.jpeg *.exr *.hdr *.tif *.tiff)"


class MaterialsPanel(Panel):
    """Choosing an object chooses its material here."""

    id = "materials"
    title = "Materials"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.material: MaterialId | None = None
        self._sink = EditSink(context.editing, self._make, lambda name: self._make(name, 0.0).label)
        self.form: ParamForm | None = None
        self.common: ParamForm | None = None
        self.list = QListWidget()
        self.list.setIconSize(QSize(SIZE, SIZE))
        self.list.setUniformItemSizes(True)
        self.list.setMaximumHeight(210)
        self.list.currentItemChanged.connect(lambda item, _: self._chosen(item))
        add, copy = self.tool("add", "New material"), self.tool("duplicate", "Duplicate the material")
        remove = self.tool("delete", "Delete the material, if nothing uses it")
        self.users = self.tool("select", "Choose the objects that have this material")
        self.assign = QPushButton("Assign to selection")
        add.clicked.connect(self.add)
        copy.clicked.connect(self.copy)
        remove.clicked.connect(self.remove)
        self.users.clicked.connect(self.select_users)
        self.assign.clicked.connect(self.assign_to_selection)
        self.column.addWidget(self.list)
        self.column.addLayout(row(add, copy, remove, self.users, self.assign, stretch=4))
        self._column = self.scroller()
        self._model_combo = Combo()
        self._models: list[str] = []
        self._items: dict[MaterialId, Material] = {}
        self._built: tuple[Any, ...] = ()
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self._selected),
            context.warmed.connect(self.refresh),
        )
        self.refresh()

    # list

    def refresh(self) -> None:
        """Show the scene's materials as they are now."""
        materials = self.context.document.scene.materials
        with QSignalBlocker(self.list):
            if list(self._items) != list(materials):
                self.list.clear()
                for material in materials.values():
                    item = QListWidgetItem(swatch(material, self.devicePixelRatioF()), material.name)
                    item.setData(256, material.id)
                    self.list.addItem(item)
            else:
                for index, material in enumerate(materials.values()):
                    if self._items[material.id] is not material:
                        self.list.item(index).setText(material.name)
                        self.list.item(index).setIcon(swatch(material, self.devicePixelRatioF()))
            self._items = dict(materials)
            if self.material not in materials:
                self.material = next(iter(materials), None)
            if self.material is not None:
                self.list.setCurrentRow(list(materials).index(self.material))
        self._selection_changed()
        self._show()

    def choose(self, material: MaterialId) -> None:
        """Show that material."""
        if material in self._items:
            self.list.setCurrentRow(list(self._items).index(material))

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if changes.materials or before.materials.keys() != after.materials.keys():
            self._soon.start(0)

    def _selected(self) -> None:
        scene = self.context.document.scene
        for chosen in self.context.session.selection:
            for below in scene.subtree(chosen) if chosen in scene.nodes else ():
                node = scene[below]
                if isinstance(node, MeshObject) and node.materials:
                    if self.material not in node.materials:
                        self.choose(node.materials[0])
                    self._selection_changed()
                    return
        self._selection_changed()

    def _selection_changed(self) -> None:
        self.assign.setEnabled(self.material is not None and bool(self._selected_meshes()))

    def _selected_meshes(self) -> list[MeshObject]:
        scene = self.context.document.scene
        found = {
            below: scene[below]
            for chosen in self.context.session.selection
            if chosen in scene.nodes
            for below in scene.subtree(chosen)
        }
        return [node for node in found.values() if isinstance(node, MeshObject)]

    def _chosen(self, item: QListWidgetItem | None) -> None:
        self.material = item.data(256) if item is not None else None
        self._selection_changed()
        self._show()

    # the chosen one

    def _show(self) -> None:
        scene = self.context.document.scene
        material = scene.materials.get(self.material) if self.material is not None else None
        model = self._brdf(material.model) if material is not None else None
        key = (
            self.material,
            material.model if material else None,
            model is not None,
            tuple(material.textures.items()) if material else (),
        )
        if key != self._built:
            self._built = key
            self._build(material, model)
        if material is not None and self.common is not None:
            self.common.show_values({name: getattr(material, name) for name in _COMMON})
            if self.form is not None and model is not None:
                self.form.show_values({**defaults(model.Params), **material.values})

    def _brdf(self, name: str) -> Brdf | None:
        if not self.context.warm:
            return None
        try:
            return self.context.host.brdf(name)
        except PluginError:
            return None

    def _build(self, material: Material | None, model: Brdf | None) -> None:
        self._sink.commit()  # a slider that is held goes with its form
        clear(self._column)
        self.form = self.common = None
        if material is None:
            self._column.addWidget(note("The scene has no materials yet."))
            self._column.addStretch(1)
            return
        self.common = ParamForm(_COMMON, self._sink)
        self._column.addWidget(self.common)
        box = QWidget()
        layout = form_layout(box)
        self._model_combo = Combo()
        self._models = list(self.context.host.names("brdf"))
        if material.model not in self._models:
            self._models.append(material.model)
        for name in self._models:
            brdf = self._brdf(name)
            self._model_combo.addItem(brdf.label if brdf is not None else name, name)
        self._model_combo.setCurrentIndex(self._models.index(material.model))
        self._model_combo.setEnabled(self.context.warm)
        self._model_combo.activated.connect(lambda i: self._change_model(self._models[i]))
        layout.addRow(form_label("Kind", "How the surface reflects light"), self._model_combo)
        self._column.addWidget(box)
        if model is not None:
            self.form = ParamForm(param_infos(model.Params), self._sink)
            self._column.addWidget(self.form)
            for name in model.textures:
                self._column.addWidget(
                    self._texture_row(material, name, param_infos(model.Params)[name].label)
                )
        elif self.context.warm:
            self._column.addWidget(note(f"The kind {material.model!r} is not installed: see Help ▸ Plugins."))
        else:
            self._column.addWidget(note("Loading…"))
        self._column.addStretch(1)

    def _texture_row(self, material: Material, name: str, label: str) -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        texture = material.textures.get(name)
        text = QLabel("none")
        text.setProperty("role", "dim")
        if texture is not None:
            height, width = texture.image.pixels.shape[:2]
            text.setText(f"{width} × {height}")
        load = self.tool("open", f"Picture for {label.lower()}, multiplied with it")
        load.clicked.connect(lambda: self._ask_picture(name))
        take = self.tool("cancel", "Take the picture away")
        take.setEnabled(texture is not None)
        take.clicked.connect(lambda: self._set_texture(name, None))
        inside = QWidget()
        inside.setLayout(row(text, load, take, stretch=0))
        layout.addRow(form_label(f"{label} map", "A picture that the value is multiplied with"), inside)
        return box

    # edits

    def _make(self, name: str, value: Value) -> Edit:
        assert self.material is not None
        material = self.context.document.scene.material(self.material)
        if name == "name":
            return SetMaterial(self.material, name=str(value), label="Rename material")
        if name == "opacity":
            return SetMaterial(self.material, opacity=float(value), label=f"Opacity of {material.name}")  # type: ignore[arg-type]
        if name == "catches":
            what = "catches shadows" if value else "is an ordinary surface"
            return SetMaterial(self.material, catches=bool(value), label=f"{material.name} {what}")
        model = self._brdf(material.model)
        info = param_infos(model.Params).get(name) if model is not None else None
        label = f"{info.label if info else name} of {material.name}"
        return SetMaterial(self.material, {name: value}, label=label)

    def _change_model(self, name: str) -> None:
        if self.material is None:
            return
        material = self.context.document.scene.material(self.material)
        model = self._brdf(name)
        if model is None or name == material.model:
            return
        kept = {n: material.values[n] for n in param_infos(model.Params) if n in material.values}
        self.context.editing.apply(
            SetMaterial(self.material, kept, model=name, label=f"Kind of {material.name}")
        )

    def add(self) -> None:
        """A new material."""
        models = self.context.host.names("brdf")
        model = "ggx" if "ggx" in models else next(iter(models), "lambert")
        made = Material(id=new_id("material"), name=self._free_name("Material"), model=model)
        if self.context.editing.apply(AddMaterial(made)):
            self._soon.stop()
            self.refresh()
            self.choose(made.id)

    def copy(self) -> None:
        """A copy of the chosen one."""
        if self.material is None:
            return
        old = self.context.document.scene.material(self.material)
        made = dataclasses.replace(old, id=new_id("material"), name=self._free_name(old.name))
        if self.context.editing.apply(AddMaterial(made, "Duplicate material")):
            self._soon.stop()
            self.refresh()
            self.choose(made.id)

    def remove(self) -> None:
        """Delete it, if nothing uses it."""
        if self.material is not None:
            self.context.editing.apply(RemoveMaterial(self.material))

    def assign_to_selection(self) -> None:
        """Give all chosen objects this material."""
        meshes = self._selected_meshes()
        if self.material is not None and meshes:
            edits = tuple(Assign(node.id, self.material) for node in meshes)
            name = self.context.document.scene.material(self.material).name
            self.context.editing.apply(Compound(f"Assign {name}", edits))

    def select_users(self) -> None:
        """Choose the objects that have it."""
        scene = self.context.document.scene
        self.context.session.select(n.id for n in scene.of(MeshObject) if self.material in n.materials)

    def _free_name(self, name: str) -> str:
        taken = {m.name for m in self.context.document.scene.materials.values()}
        stem = name.rstrip("0123456789 ") or name
        return next(n for n in (name, *(f"{stem} {i}" for i in range(2, 10**6))) if n not in taken)

    def _ask_picture(self, name: str) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Picture for the material", "", PICTURES)
        if path:
            self.load_picture(name, Path(path))

    def load_picture(self, name: str, path: Path) -> None:
        """Read a picture away from the window's thread, then lay it on the surface."""
        material = self.material

        def read(job: Job) -> Image:
            from studio_core.imaging.io import read_image

            return read_image(path)

        def done(image: Image) -> None:
            if material in self.context.document.scene.materials and material is not None:
                self.context.editing.apply(SetTexture(material, name, Texture(image)))

        self.context.tasks.run(f"Reading {path.name}", read, done)

    def _set_texture(self, name: str, texture: Texture | None) -> None:
        if self.material is not None:
            self.context.editing.apply(SetTexture(self.material, name, texture))
