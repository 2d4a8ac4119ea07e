"""The plugin host: strangers come through the same door, and what fails is named and contained."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from studio_core.contract import API, Plugin
from studio_core.errors import PluginError
from studio_core.registry import GROUP, PluginHost

EXAMPLE = Path(__file__).parent.parent / "example_plugin"
Installer = Callable[[dict[str, str]], PluginHost]


@pytest.fixture
def fresh_imports(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Modules that a test imported are forgotten after it."""
    before = set(sys.modules)
    yield monkeypatch
    for name in set(sys.modules) - before:
        if name.startswith(("lucarne_example", "stranger")):
            del sys.modules[name]
    importlib.invalidate_caches()


@pytest.fixture(scope="session")
def example_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which pip installed the example plugin."""
    site = tmp_path_factory.mktemp("site")
    flags = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target", str(site)]
    subprocess.run(
        [sys.executable, "-m", "pip", "install", *flags, str(EXAMPLE)],
        check=True,
        env={**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_FIND_LINKS": ""},
    )
    return site


@pytest.fixture
def stranger(fresh_imports: pytest.MonkeyPatch, tmp_path: Path) -> Installer:
    """Installs modules by source, each with its `plugin` as an entry point, and discovers everything."""

    def install(sources: dict[str, str]) -> PluginHost:
        info = tmp_path / "stranger-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
        points = "".join(f"{name} = stranger_{name}:plugin\n" for name in sources)
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{points}")
        for name, source in sources.items():
            (tmp_path / f"stranger_{name}.py").write_text(
                f"from studio_core.contract import API, Plugin\n{source}\n"
            )
        fresh_imports.syspath_prepend(str(tmp_path))
        return PluginHost.discover()

    return install


def only_failure(host: PluginHost, plugin: str) -> str:
    (failure,) = (f for f in host.failures if f.plugin == plugin)
    assert failure.traceback.startswith("Traceback")
    return failure.what


# ---------------------------------------------------------------- a real package


def test_an_installed_package_is_found_and_its_model_works(
    fresh_imports: pytest.MonkeyPatch, example_site: Path
) -> None:
    fresh_imports.syspath_prepend(str(example_site))
    host = PluginHost.discover()
    assert "minnaert" in host.names("brdf")
    assert host.provider("brdf", "minnaert").id == "example"
    assert "lucarne_example.minnaert" not in sys.modules
    model = host.brdf("minnaert")
    wo, wi = np.array([0, 0, 1], np.float32), np.array([[0, 0.6], [0, 0], [1, 0.8]], np.float32)
    out = np.zeros(2, np.float32)
    from studio_core.jit import call_address, kernel

    @kernel
    def call(address, shape, wo, count, wi, out):  # type: ignore[no-untyped-def]
        call_address(address, shape, wo, count, wi, out)

    call(model.address, model.shape({"darkening": 2.0}), wo, 2, wi, out)
    assert out == pytest.approx([1.0, 0.8])
    assert "ModuleNotFoundError" in only_failure(host, "example_broken")
    assert "a_library_that_nobody_has" in only_failure(host, "example_broken")


def test_a_model_that_lacks_something_is_refused_by_name(
    fresh_imports: pytest.MonkeyPatch, example_site: Path
) -> None:
    fresh_imports.syspath_prepend(str(example_site))
    host = PluginHost.discover()
    with pytest.raises(
        PluginError, match=r"plugin example: brdf 'unfinished' failed to load: .* lacks Params"
    ):
        host.brdf("unfinished")
    assert "unfinished" not in host.available("brdf")
    assert {"lambert", "minnaert"} <= host.available("brdf").keys()


# ---------------------------------------------------------------- bad strangers


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("import a_library_that_nobody_has", "ModuleNotFoundError: No module named"),
        ("import sys; sys.exit(3)", "SystemExit: 3"),
        ("raise ValueError('no licence')", "ValueError: no licence"),
        ("plugin = (", "SyntaxError"),
        ("other = 1", "AttributeError"),
        ("plugin = 'me'", "PluginError: 'me' is not a studio_core.contract.Plugin"),
        ("plugin = Plugin('bad', API + 1)", f"made for interface {API + 1}, this is {API}"),
        ("plugin = Plugin('bad', API, {'toaster': {'a': 'b:c'}})", "unknown kind 'toaster'"),
        ("plugin = Plugin('bad', API, {'brdf': {'lambert': 'b:c'}})", "'lambert', which brdfs already does"),
        ("plugin = Plugin('brdfs', API)", "there is a plugin brdfs already"),
        ("plugin = Plugin('bad', API, {'brdf': ['a']})", "AttributeError"),
        ("plugin = Plugin('bad', API, None)", "AttributeError"),
    ],
)
def test_what_cannot_be_taken_in_is_noted_and_the_others_work(
    stranger: Installer, source: str, what: str
) -> None:
    host = stranger({"bad": source, "good": "plugin = Plugin('good', API, {'solver': {'mine': 'math:pi'}})"})
    assert what in only_failure(host, "bad")
    assert [p.id for p in host.plugins].count("bad") == 0
    assert host.get("solver", "mine") == np.pi
    assert host.brdf("lambert").id == "lambert"


@pytest.mark.parametrize(
    ("where", "what"),
    [
        ("a_library_that_nobody_has:X", "No module named"),
        ("math:nothing", "has no attribute 'nothing'"),
        ("math", "AttributeError"),
        ("stranger_exits:plugin", "SystemExit"),
        ("math:pi", "lacks id, label, Params, terms, textures, address, shape, coefficients"),
        ("", "ValueError"),
        (7, "AttributeError"),
    ],
)
def test_what_fails_on_first_use_is_noted_once(stranger: Installer, where: object, what: str) -> None:
    source = f"plugin = Plugin('bad', API, {{'brdf': {{'x': {where!r}}}}})"
    host = stranger({"bad": source, "exits": "import sys; sys.exit('bye')"})
    known = len(host.failures)
    for _ in range(3):
        with pytest.raises(PluginError, match="plugin bad: brdf 'x' failed to load"):
            host.get("brdf", "x")
        assert "x" not in host.available("brdf")
    assert len(host.failures) == known + 1
    assert what in only_failure(host, "bad")


def test_a_stranger_cannot_shadow_what_is_bundled(stranger: Installer) -> None:
    host = stranger({"aaa": "plugin = Plugin('aaa', API, {'brdf': {'ggx': 'math:pi'}})"})
    assert host.provider("brdf", "ggx").id == "brdfs"
    assert host.plugins[0].id == "brdfs"


def test_half_a_plugin_is_not_taken_in(stranger: Installer) -> None:
    source = "plugin = Plugin('bad', API, {'solver': {'fine': 'math:pi'}, 'toaster': {}})"
    host = stranger({"bad": source})
    assert "fine" not in host.names("solver")


# ---------------------------------------------------------------- the host itself


@dataclass
class Model:
    """A BRDF whose address must not be asked for in vain."""

    asked: int = 0
    id: str = "model"
    label: str = "Model"
    Params: type = object
    terms: int = 1
    textures: tuple[str, ...] = ()
    shape: object = None
    coefficients: object = None

    @property
    def address(self) -> int:
        self.asked += 1
        raise AssertionError("compiled without need")


MODEL = Model()


def test_loading_is_lazy_and_compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stranger_module", sys.modules[__name__])
    host = PluginHost([Plugin("p", API, {"brdf": {"model": "stranger_module:MODEL"}})])
    assert host.brdf("model") is MODEL
    assert host.brdf("model") is MODEL
    assert MODEL.asked == 0
    assert host.failures == []


def test_adding_refuses_at_once() -> None:
    host = PluginHost([Plugin("p", API, {"solver": {"a": "math:pi"}})])
    for plugin, why in [
        (Plugin("q", API, {"solver": {"a": "math:e"}}), "q provides solver 'a', which p already does"),
        (Plugin("p", API), "there is a plugin p already"),
        (Plugin("q", 0), "made for interface 0"),
    ]:
        with pytest.raises(PluginError, match=why):
            host.add(plugin)
    assert [p.id for p in host.plugins] == ["p"]


def test_what_nobody_provides_is_said_with_what_there_is() -> None:
    host = PluginHost([Plugin("p", API, {"solver": {"a": "math:pi", "b": "math:e"}})])
    with pytest.raises(PluginError, match="there is no solver 'c'; known: a, b"):
        host.get("solver", "c")
    with pytest.raises(PluginError, match="there is no panel 'c'; known: none"):
        host.provider("panel", "c")


def test_misbehaviour_at_run_time_is_kept_with_its_traceback() -> None:
    host = PluginHost()
    try:
        raise RuntimeError("went wrong")
    except RuntimeError as error:
        host.report("p", "painting", error)
    assert host.failures[0].what == "painting: RuntimeError: went wrong"
    assert 'raise RuntimeError("went wrong")' in host.failures[0].traceback


def test_two_hosts_do_not_interact() -> None:
    one, two = PluginHost(), PluginHost()
    one.add(Plugin("p", API, {"solver": {"a": "math:pi"}}))
    assert two.names("solver") == []
    assert two.plugins == two.failures == []


def test_everything_bundled_loads(host: PluginHost) -> None:
    for kind in ("brdf", "importer", "exporter", "backend"):
        assert host.names(kind)
        for name in host.names(kind):
            assert host.get(kind, name).label
    assert host.failures == []
