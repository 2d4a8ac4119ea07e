"""The session as JSON in the project file, so that a project opens as it was left."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.kernels.tonemap import KINDS
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.nodes import Camera, Scene
from studio_core.scene.transform import Transform, normalized, vec3
from studio_core.session import LIGHTS, Session, View, framing


def session_form(session: Session) -> dict[str, Any]:
    """What is remembered of a session."""
    view = session.view
    return {
        "view": {
            "translation": list(view.transform.translation),
            "rotation": list(view.transform.rotation),
            "fov": view.fov,
            "focus": view.focus,
        },
        "exposure": session.exposure,
        "tonemap": session.tonemap,
        "backend": session.backend,
        "params": dict(session.params),
        "bouncing": session.bouncing,
        "indirect": session.indirect,
        "indirect_params": {name: dict(values) for name, values in session.indirect_params.items()},
        "light": session.light,
    }


def take_session(session: Session, form: Mapping[str, Any], scene: Scene, backends: list[str]) -> None:
    """Take over what fits of `form`; what does not is left alone. A view is found where none is kept."""
    view = _view(form.get("view"), session.view)
    session.look(view if view is not None else first_view(scene, session.view))
    exposure, tonemap = form.get("exposure"), form.get("tonemap")
    session.display(
        exposure=float(exposure) if isinstance(exposure, int | float) and abs(exposure) <= 32 else 0.0,
        tonemap=tonemap if tonemap in KINDS else "srgb",
    )
    backend, params = form.get("backend"), form.get("params")
    if backend in backends:
        plain = params if isinstance(params, dict) else {}
        if (backend, dict(plain)) != (session.backend, dict(session.params)):
            session.shade_with(str(backend), frozen_map(plain))

    _take_bounces(session, form)


def _take_bounces(session: Session, form: Mapping[str, Any]) -> None:
    """How light goes on between surfaces; what a project does not say is as at the start."""
    plain, light = Session(), form.get("light")
    on, method, params = form.get("bouncing"), form.get("indirect"), form.get("indirect_params")
    session.bounce(
        on if isinstance(on, bool) else plain.bouncing,
        method if isinstance(method, str) and method else plain.indirect,
    )
    known = params if isinstance(params, dict) else {}
    session.indirect_params = frozen_map(
        {name: frozen_map(values) for name, values in known.items() if isinstance(values, dict)}
    )
    session.show_light(light if light in LIGHTS else plain.light)


def first_view(scene: Scene, view: View) -> View:
    """What the first camera sees, or everything."""
    camera = next(scene.of(Camera), None)
    if camera is not None:
        return View.of(camera, scene, view.width, view.height)
    low, high = scene_bounds(scene)
    return framing(low, high, dataclasses.replace(view, fov=View.fov))


def _view(form: Any, old: View) -> View | None:
    with contextlib.suppress(KeyError, TypeError, ValueError):
        w, x, y, z = (float(c) for c in form["rotation"])
        place = Transform(vec3(form["translation"]), normalized((w, x, y, z)))
        fov, focus = float(form["fov"]), float(form["focus"])
        if 1 <= fov <= 170 and 1e-3 <= focus <= 1e5:
            return dataclasses.replace(old, transform=place, fov=fov, focus=focus)
    return None
