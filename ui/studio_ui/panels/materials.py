"""Materials: the list, what is done with them, and what the chosen ones are like."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import QPoint, Qt, QTimer
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QLineEdit, QMenu, QPushButton, QSizePolicy, QSplitter, QToolButton, QWidget

from studio_core.edits import AddMaterial, Compound, RemoveMaterial, SetMaterial
from studio_core.library.lucmat import Kept
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Scene, new_id
from studio_ui.context import Context
from studio_ui.forms.fields import Combo
from studio_ui.forms.param_form import ParamForm
from studio_ui.library.library import MaterialLibrary
from studio_ui.look.theme import Theme
from studio_ui.material_view.strip import MaterialStrip
from studio_ui.material_view.thumbnails import MaterialThumbnails
from studio_ui.material_view.work import PreviewWork
from studio_ui.objects.choosing import meshes_below, users
from studio_ui.objects.material_drag import assigned
from studio_ui.objects.new_material import free_name
from studio_ui.panels.material_form import MaterialForm
from studio_ui.panels.material_list import MaterialList, users_of
from studio_ui.panels.panel import Panel, row
from studio_ui.panels.swatch import SIZE

_WHAT_CHANGES_USERS = Aspect.STRUCTURE | Aspect.MATERIAL
_WHAT_CHANGES_SIZES = Aspect.GEOMETRY | Aspect.TRANSFORM  # of patterns; once a gesture ends
_WHAT_LIGHTS = Aspect.STRUCTURE | Aspect.LIGHT | Aspect.GAIN


class MaterialsPanel(Panel):
    """Choosing an object chooses its material here. `open_library()` shows the library's panel."""

    id = "materials"
    title = "Materials"

    def __init__(
        self, context: Context, library: MaterialLibrary, open_library: Callable[[], object]
    ) -> None:
        super().__init__(context)
        self._library = library
        self.chosen: tuple[MaterialId, ...] = ()
        self.list = MaterialList()
        self.list.chosen = self._chosen
        self.list.renamed = self._rename
        self.list.customContextMenuRequested.connect(self._menu)
        self.find = QLineEdit()
        self.find.setPlaceholderText("Find a material")
        self.find.setAccessibleName("Find a material")
        self.find.setClearButtonEnabled(True)
        self.find.textChanged.connect(self.list.narrow)
        self.work = PreviewWork(context)
        self.thumbnails = MaterialThumbnails(context, self.work, SIZE)
        self.thumbnails.came = lambda material: self.list.redraw((material,))
        self.list.picture = self.thumbnails.icon
        self.strip = MaterialStrip(context, self.work)
        self.editor = MaterialForm(context, self.tool)
        add = self.tool("add", "New material")
        copy = self.tool("duplicate", "Duplicate the chosen material")
        self.users = self.tool("select", "Choose the objects that have the chosen materials")
        self.new = QMenu(add)
        self.new.addAction("New material", self.add)
        self.new.addAction("From the library…", open_library)
        add.setMenu(self.new)
        add.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        copy.clicked.connect(self.copy)
        self.users.clicked.connect(self.select_users)
        self.assign = QPushButton("Assign")
        self.assign.setToolTip("Give the chosen objects this material; or drag it onto an object")
        self.assign.clicked.connect(self.assign_to_selection)
        self.slot = Combo()
        self.slot.setAccessibleName("Slot")
        self.slot.setToolTip("Which slot of the chosen object")
        self.slot.setMinimumContentsLength(5)
        top = QWidget()
        above = self.column_of(top)
        above.addWidget(self.find)
        above.addWidget(self.list, 1)
        above.addLayout(row(add, copy, self._delete_button(), self.users, self.assign, self.slot, stretch=4))
        below = QWidget()
        beneath = self.column_of(below)
        beneath.addWidget(self.strip)
        self.scroller(beneath).addWidget(self.editor)
        area = beneath.itemAt(beneath.count() - 1).widget()
        area.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)  # the strip comes first
        split = QSplitter(Qt.Orientation.Vertical)
        split.setChildrenCollapsible(False)
        split.addWidget(top)
        split.addWidget(below)
        split.setSizes([240, 400])
        for part, share in enumerate((2, 3)):
            split.setStretchFactor(part, share)
        self.column.addWidget(split)
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self._selected),
            context.session.displayed.connect(self._pictures),
            context.editing.settled.connect(self._pictures),
            context.warmed.connect(self._warmed),
        )
        self._relit = QTimer(self)
        self._relit.setSingleShot(True)
        self._relit.timeout.connect(self.list.redraw)
        self.refresh()

    def _delete_button(self) -> QToolButton:
        made = self.tool("delete", "Delete materials")
        menu = QMenu(made)
        menu.addAction("Delete the chosen materials", self.remove)
        menu.addAction("Delete all that no object has", self.remove_unused)
        made.setMenu(menu)
        made.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        return made

    @property
    def material(self) -> MaterialId | None:
        """The one that was chosen last."""
        return self.chosen[-1] if self.chosen else None

    @property
    def form(self) -> ParamForm | None:
        """The parameters of the chosen materials' model."""
        return self.editor.form

    @property
    def common(self) -> ParamForm | None:
        """What all materials have."""
        return self.editor.common

    def use_actions(self, actions: Mapping[str, QAction]) -> None:
        """One more way to a new material."""
        self.new.addAction(actions["file.fit_material"])

    def close_panel(self) -> None:
        """Stop listening and making."""
        super().close_panel()
        self.strip.close_strip()
        self.work.close()

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        super().set_theme(theme)
        self.strip.set_theme(theme)
        self.list.set_theme(theme)
        self.refresh()

    # the list

    def refresh(self) -> None:
        """Show the scene's materials as they are now."""
        self._soon.stop()
        scene = self.context.document.scene
        self.list.show_scene(scene)
        self.chosen = tuple(m for m in self.chosen if m in scene.materials)
        if not self.chosen:
            self.chosen = tuple(scene.materials)[:1]
        if set(self.list.selected) != set(self.chosen):
            self.list.select_materials(self.chosen)
        self._offer_slots()
        self.editor.show_materials(self.chosen)
        self.strip.show_material(self.material)

    def _warmed(self) -> None:
        self.work.warmed()
        self.refresh()
        self.list.redraw()

    def _pictures(self) -> None:
        self._relit.start(0)

    def choose(self, material: MaterialId) -> None:
        """Show that material."""
        if material in self.context.document.scene.materials:
            self.chosen = (material,)
            self.refresh()

    def load_picture(self, name: str, path: Path) -> None:
        """A picture for a parameter of the chosen material."""
        self.editor.load_picture(name, path)

    def _chosen(self, materials: tuple[MaterialId, ...]) -> None:
        if materials:
            self.chosen = materials
            self.editor.show_materials(materials)
            self.strip.show_material(self.material)
            self._offer_slots()

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if (
            changes.materials
            or changes.aspects & _WHAT_CHANGES_USERS
            or (changes.aspects & _WHAT_CHANGES_SIZES and not self.context.editing.busy)
        ):
            self._soon.start(0)
        if changes.aspects & _WHAT_LIGHTS and not self.context.editing.busy:
            self._pictures()

    def _selected(self) -> None:
        meshes = self._meshes()
        if meshes and not any(m in meshes[0].materials for m in self.chosen) and meshes[0].materials:
            self.choose(meshes[0].materials[0])
        self._offer_slots()

    def _meshes(self) -> tuple[MeshObject, ...]:
        return meshes_below(self.context.document.scene, self.context.session.selection)

    def _offer_slots(self) -> None:
        """Where a material can go to: slots are asked for only where there are several."""
        meshes = self._meshes()
        self.assign.setEnabled(bool(self.chosen and meshes))
        slots = meshes[0].materials if len(meshes) == 1 else ()
        scene = self.context.document.scene
        names = [f"{i}: {scene.material(m).name}" for i, m in enumerate(slots, 1)]
        names = ["All slots", *names] if len(slots) > 1 else []
        if names != [self.slot.itemText(i) for i in range(self.slot.count())]:
            self.slot.clear()
            self.slot.addItems(names)
        self.slot.setVisible(bool(names))

    # what is done

    def add(self) -> None:
        """A new material."""
        models = self.context.host.names("brdf")
        model = "ggx" if "ggx" in models else next(iter(models), "lambert")
        name = free_name(self.context.document.scene, "Material")
        made = Material(id=new_id("material"), name=name, model=model)
        if self.context.editing.apply(AddMaterial(made)):
            self.choose(made.id)

    def keep(self) -> None:
        """Put the chosen ones into the library."""
        self._library.keep([self.context.document.scene.material(material) for material in self.chosen])

    def export(self) -> None:
        """The chosen ones as files of their own."""
        scene = self.context.document.scene
        self._library.export_kept([Kept(scene.material(material)) for material in self.chosen])

    def copy(self) -> None:
        """A copy of the chosen one."""
        if self.material is None:
            return
        old = self.context.document.scene.material(self.material)
        name = free_name(self.context.document.scene, old.name)
        made = dataclasses.replace(old, id=new_id("material"), name=name)
        if self.context.editing.apply(AddMaterial(made, f"Duplicate {old.name}")):
            self.choose(made.id)

    def remove(self) -> None:
        """Delete the chosen ones, if nothing uses them."""
        self._remove(self.chosen)

    def remove_unused(self) -> None:
        """Delete all that no object has."""
        scene = self.context.document.scene
        there = users_of(scene)
        unused = tuple(m for m in scene.materials if not there[m])
        if unused:
            self._remove(unused)
        else:
            self.context.journal.write("Every material is used.")

    def _remove(self, materials: tuple[MaterialId, ...]) -> None:
        names = [self.context.document.scene.material(m).name for m in materials]
        if names:
            what = names[0] if len(names) == 1 else f"{len(names)} materials"
            self.context.editing.apply(
                Compound(f"Delete {what}", tuple(RemoveMaterial(m) for m in materials))
            )

    def assign_to_selection(self) -> None:
        """Give all chosen objects this material, or the chosen slot of one."""
        if self.material is None:
            return
        nodes = self.context.session.selection
        slot = self.slot.currentIndex() - 1 if self.slot.count() else -1
        edit = assigned(self.context.document.scene, nodes, self.material, slot if slot >= 0 else None)
        if edit is not None:
            self.context.editing.apply(edit)

    def select_users(self) -> None:
        """Choose the objects that have them."""
        self.context.session.select(users(self.context.document.scene, self.chosen))

    def _rename(self, material: MaterialId, name: str) -> None:
        old = self.context.document.scene.material(material).name
        if name and name != old:
            self.context.editing.apply(SetMaterial(material, name=name, label=f"Rename {old}"))
        elif not name:
            self.list.set_theme(self.theme)  # draws the old name again
            self._soon.start(0)

    def _menu(self, place: QPoint) -> None:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        if self.material is not None:
            menu.addAction("Rename\tF2", self.list.edit_name)
            menu.addAction("Duplicate", self.copy)
            assign = menu.addAction("Assign to what is chosen", self.assign_to_selection)
            assign.setEnabled(self.assign.isEnabled())
            menu.addAction("Select objects that have it", self.select_users)
            menu.addAction("Keep for all projects", self.keep)
            menu.addAction("Export…", self.export)
            menu.addSeparator()
            menu.addAction("Delete", self.remove)
        menu.addAction("Delete all that no object has", self.remove_unused)
        menu.popup(self.list.viewport().mapToGlobal(place))
