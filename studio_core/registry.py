"""The plugin host: finds plugins by entry point, loads what they provide on first use, contains failures."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.metadata
import inspect
import traceback
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from studio_core.contract import API, KINDS, Brdf, Plugin
from studio_core.errors import PluginError
from studio_core.guards import guarded

GROUP = "studio.plugins"
_NEEDS = {
    "backend": ("id", "label", "Params", "stages"),
    "indirect": ("id", "label", "Params", "stages"),
    "brdf": ("id", "label", "Params", "terms", "textures", "address", "shape", "coefficients"),
    "importer": ("label", "extensions", "load"),
    "exporter": ("label", "extensions", "save"),
    "panel": ("title", "make"),
    "capturer": ("label", "open"),
    "fitter": ("label", "fit"),
}
_BUNDLED = "studio_plugins."
_MOST_FAILURES = 200
State = Literal["loaded", "not needed yet", "failed", "switched off"]


@dataclass(frozen=True)
class Failure:
    """What went wrong with a plugin, for Help ▸ Plugins."""

    plugin: str
    what: str
    traceback: str


@dataclass(frozen=True)
class Origin:
    """The entry point that leads to a plugin, and the distribution that brings it."""

    point: str
    where: str
    distribution: str = ""
    version: str = ""

    @property
    def bundled(self) -> bool:
        """Whether it is part of the program."""
        return self.where.startswith(_BUNDLED)

    @property
    def key(self) -> str:
        """By which it is switched off."""
        return f"{self.distribution}:{self.point}"


@dataclass(frozen=True)
class Listed:
    """A line of Help ▸ Plugins; `plugin` is None where it is switched off or could not be taken in."""

    name: str
    state: State
    origin: Origin | None
    plugin: Plugin | None
    failures: tuple[Failure, ...]


class PluginHost:
    """Holds plugins and what they provide. Built once by the composition root and passed along."""

    def __init__(self, plugins: Iterable[Plugin] = ()) -> None:
        self.plugins: list[Plugin] = []
        self.failures: list[Failure] = []
        self._where: dict[tuple[str, str], tuple[Plugin, str]] = {}
        self._loaded: dict[tuple[str, str], Any] = {}
        self._broken: dict[tuple[str, str], Failure] = {}
        self._origins: dict[str, Origin] = {}  # by plugin, or by entry point where there is none
        self._off: list[Origin] = []
        self._latest = Failure("", "", "")
        for plugin in plugins:
            self.add(plugin)

    @classmethod
    def discover(cls, off: Collection[str] = ()) -> PluginHost:
        """All installed plugins; one that fails to import is noted, the others load.

        Those of other people whose `Origin.key` is among `off` are listed, and no more.
        """
        host = cls()
        points = importlib.metadata.entry_points(group=GROUP)
        bundled_first = sorted(set(points), key=lambda p: (not p.value.startswith("studio_plugins."), p.name))
        for point in bundled_first:
            brought = point.dist
            known = (brought.name, brought.version) if brought is not None else ("", "")
            origin = Origin(point.name, point.value, *known)
            if origin.key in off and not origin.bundled:
                host._off.append(origin)
                continue
            host._origins[point.name] = origin
            host._contained(point.name, "could not be loaded", partial(_add, host, point))
        return host

    def add(self, plugin: Plugin) -> None:
        """Take a plugin in. Raises PluginError when it does not fit this program."""
        if not isinstance(plugin, Plugin):
            raise PluginError(f"{plugin!r} is not a studio_core.contract.Plugin")
        if plugin.api != API:
            raise PluginError(f"{plugin.id} is made for interface {plugin.api}, this is {API}")
        if any(plugin.id == other.id for other in self.plugins):
            raise PluginError(f"there is a plugin {plugin.id} already")
        offered: dict[tuple[str, str], tuple[Plugin, str]] = {}
        for kind, provided in plugin.provides.items():
            if kind not in KINDS:
                raise PluginError(f"{plugin.id} provides the unknown kind {kind!r}")
            for name, where in provided.items():
                if (kind, name) in self._where:
                    other = self._where[kind, name][0].id
                    raise PluginError(f"{plugin.id} provides {kind} {name!r}, which {other} already does")
                offered[kind, name] = (plugin, where)
        self.plugins.append(plugin)
        self._where |= offered

    def names(self, kind: str) -> Sequence[str]:
        """Everything registered of a kind, in order of registration."""
        return [name for have, name in self._where if have == kind]

    def provider(self, kind: str, name: str) -> Plugin:
        """The plugin that provides it."""
        self._known(kind, name)
        return self._where[kind, name][0]

    def get(self, kind: str, name: str) -> Any:
        """The provided object, imported on first use and checked against its kind.

        What failed once fails again without another try, so that a failure is noted once.
        """
        if (kind, name) not in self._loaded:
            plugin, where = self._known(kind, name)
            found: list[Any] = []
            if (kind, name) not in self._broken and not self._contained(
                plugin.id, f"{kind} {name!r} failed to load", lambda: found.append(self._load(kind, where))
            ):
                self._broken[kind, name] = self._latest
            if (kind, name) in self._broken:
                raise PluginError(f"plugin {plugin.id}: {self._broken[kind, name].what}")
            made = found[0]
            if not where.startswith(_BUNDLED):
                made = guarded(kind, made, plugin.id, partial(self.report, plugin.id))
            self._loaded[kind, name] = made
        return self._loaded[kind, name]

    def bundled(self, kind: str, name: str) -> bool:
        """Whether it is part of the program."""
        return str(self._known(kind, name)[1]).startswith(_BUNDLED)

    def brdf(self, model: str) -> Brdf:
        """The BRDF of that name."""
        made: Brdf = self.get("brdf", model)
        return made

    def available(self, kind: str) -> dict[str, Any]:
        """All objects of a kind that load; the others are among `failures`."""
        found = {}
        for name in self.names(kind):
            try:
                found[name] = self.get(kind, name)
            except PluginError:
                continue
        return found

    def report(self, plugin: str, what: str, error: BaseException) -> bool:
        """Note that a plugin misbehaved while it ran; whether it is the first time that it did so."""
        text = "".join(traceback.format_exception(error))
        made = self._latest = Failure(plugin, f"{what}: {type(error).__name__}: {error}", text)
        fresh = all((made.plugin, made.what) != (known.plugin, known.what) for known in self.failures)
        if fresh and len(self.failures) < _MOST_FAILURES:
            self.failures.append(made)
        return fresh

    def listed(self) -> list[Listed]:
        """Everything that was found, bundled first, and how it fares."""
        made = []
        for plugin in self.plugins:
            failures = self._failures_of(plugin.id)
            used = any(self._where[key][0] is plugin for key in self._loaded)
            state: State = "failed" if failures else "loaded" if used else "not needed yet"
            origin = self._origins.get(plugin.id)
            made.append(Listed(plugin.label or plugin.id, state, origin, plugin, failures))
        ids = {plugin.id for plugin in self.plugins}
        for name in dict.fromkeys(failure.plugin for failure in self.failures):
            if name not in ids:
                made.append(Listed(name, "failed", self._origins.get(name), None, self._failures_of(name)))
        made += [Listed(origin.point, "switched off", origin, None, ()) for origin in self._off]
        return made

    def culprit(self, error: BaseException) -> Plugin | None:
        """The plugin of other people whose code an error went through last, or None."""
        modules = {
            _package(where): plugin
            for plugin, where in self._where.values()
            if isinstance(where, str) and not where.startswith(_BUNDLED)
        }
        found = None
        for frame, _ in traceback.walk_tb(error.__traceback__):
            found = modules.get(_package(str(frame.f_globals.get("__name__", "")))) or found
        return found

    def _failures_of(self, plugin: str) -> tuple[Failure, ...]:
        return tuple(failure for failure in self.failures if failure.plugin == plugin)

    def _known(self, kind: str, name: str) -> tuple[Plugin, str]:
        if (kind, name) not in self._where:
            known = ", ".join(self.names(kind)) or "none"
            raise PluginError(f"there is no {kind} {name!r}; known: {known}")
        return self._where[kind, name]

    def _load(self, kind: str, where: str) -> Any:
        module, _, attribute = where.partition(":")
        made = getattr(importlib.import_module(module), attribute)
        missing = [name for name in _NEEDS.get(kind, ()) if not _has(made, name)]
        if missing:
            raise PluginError(f"{where} lacks {', '.join(missing)}")
        if kind in ("backend", "indirect") and not dataclasses.is_dataclass(made.Params):
            raise PluginError(f"{where} has Params that are no dataclass")
        return made

    def _contained(self, plugin: str, what: str, action: Callable[[], object]) -> bool:
        try:
            action()
        except (Exception, SystemExit) as error:
            self.report(plugin, what, error)
            return False
        return True


def _has(thing: object, name: str) -> bool:
    """Like `hasattr`, but asks no property: a BRDF's address would be compiled here."""
    if isinstance(inspect.getattr_static(type(thing), name, None), property):
        return True
    return hasattr(thing, name)


def _add(host: PluginHost, point: importlib.metadata.EntryPoint) -> None:
    plugin = point.load()
    host.add(plugin)
    host._origins[plugin.id] = host._origins[point.name]


def _package(module: str) -> str:
    """The part of a module's name that a plugin has for itself."""
    return module.partition(":")[0].partition(".")[0]
