"""Where compiled kernels lie on disk, and how a stale or damaged file is noticed.

numba's own cache forgets four things, each seen to bite: a helper edited in another module, the flags
under which a kernel was compiled (`NUMBA_BOUNDSCHECK`), files cut short or damaged, and two processes
that write the index at once. Here a kernel's file name holds everything that decides its machine code
(numba, processor and flags in the folder; signature and the sources of its module and of all project
modules that this one imports in the file), there is no index, and a file carries a checksum of itself.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import logging
import os
import platform
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

# numba's inner modules are typed in some versions and not in others.
from studio_core.folders import user_cache

llvm: Any = importlib.import_module("llvmlite.binding")
numba: Any = importlib.import_module("numba")
numba_caching: Any = importlib.import_module("numba.core.caching")

log = logging.getLogger(__name__)

KEPT_FOLDERS = 3  # numba versions, flags: older folders are deleted
KEPT_VERSIONS = 4  # of one kernel and signature: older sources' machine code is deleted
_IGNORED_VARIABLES = {"NUMBA_NUM_THREADS", "NUMBA_CACHE_DIR", "NUMBA_DEBUG_CACHE"}
_IMPORT = re.compile(r"^\s*(?:from\s+([.\w]+)\s+import\s+(\([^)]*\)|[^\n]+)|import\s+([^\n]+))", re.MULTILINE)


def cache_root() -> Path:
    """The folder of all kernels of this user; `LUCARNE_CACHE` moves it."""
    return user_cache() / "kernels"


def environment_hash() -> str:
    """Hex digest of what decides machine code besides the sources: versions, processor, flags."""
    flags = sorted(
        f"{name}={value}"
        for name, value in os.environ.items()
        if name.startswith("NUMBA_") and name not in _IGNORED_VARIABLES
    )
    features = llvm.get_host_cpu_features().flatten()
    facts = (
        sys.version,
        platform.machine(),
        numba.__version__,
        str(llvm.llvm_version_info),
        str(numba.config.CPU_NAME or llvm.get_host_cpu_name()),
        str(numba.config.CPU_FEATURES or features),
        str(numba.config.BOUNDSCHECK),
        str(numba.config.DISABLE_JIT),
        str(numba.config.OPT),
        *flags,
    )
    return hashlib.blake2b("\n".join(facts).encode(), digest_size=8).hexdigest()


def open_cache(root: Path) -> Path | None:
    """Makes the folder for this environment and deletes old ones; None where nothing can be written."""
    folder = root / environment_hash()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink(missing_ok=True)
        os.utime(folder)
    except OSError as error:
        log.warning("compiled kernels are not kept: %s", error)
        return None
    _keep_newest([path for path in root.iterdir() if path.is_dir()], KEPT_FOLDERS)
    return folder


def _keep_newest(paths: list[Path], kept: int) -> None:
    dated = []
    for path in paths:
        try:
            dated.append((path.stat().st_mtime_ns, path))
        except OSError:  # another process was faster
            continue
    for _, path in sorted(dated, reverse=True)[kept:]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            try:
                path.unlink(missing_ok=True)
            except OSError:  # held open elsewhere
                continue


@functools.lru_cache(maxsize=4096)
def _read_source(path: str, mtime_ns: int, size: int) -> tuple[bytes, tuple[tuple[str, str], ...]]:
    """Digest of a source file and its imports as (module, names) in the file's own, unresolved words."""
    source = Path(path).read_bytes()
    found = []
    for module, names, modules in _IMPORT.findall(source.decode("utf-8", "replace")):
        if modules:
            found += [(word.split(" as ")[0].split("#")[0].strip(), "") for word in modules.split(",")]
        else:
            found.append((module, re.sub(r"#[^\n]*|[()]", " ", names)))
    return hashlib.blake2b(source, digest_size=16).digest(), tuple(found)


def _imported_modules(found: tuple[tuple[str, str], ...], package: str) -> set[str]:
    names = set()
    for module, words in found:
        dots = len(module) - len(module.lstrip("."))
        if dots:
            parents = package.split(".")
            base = ".".join(parents[: len(parents) - dots + 1])
            module = f"{base}.{module[dots:]}".strip(".")
        names.add(module)
        names |= {f"{module}.{word.split(' as ')[0].strip()}" for word in words.split(",")}
    return names


def source_stamp(function: Callable[..., Any]) -> str:
    """Hex digest over a kernel's module and all modules of the project that it imports, directly or not.

    "Of the project" are studio_core, studio_plugins and the kernel's own top-level package. Only modules
    that are loaded already count: names a kernel uses were imported above its decorator.
    """
    code_file = function.__code__.co_filename
    package = str(function.__globals__.get("__package__") or "")
    own = {"studio_core", "studio_plugins", function.__module__.split(".")[0]}
    digests: dict[str, bytes] = {}
    waiting = [(code_file, package)]
    while waiting:
        path, package = waiting.pop()
        if path in digests:
            continue
        try:
            status = Path(path).stat()
            digest, found = _read_source(path, status.st_mtime_ns, status.st_size)
        except OSError:  # no file (made at run time, or in an archive): its code alone must do
            digests[path] = function.__code__.co_code
            continue
        digests[path] = digest
        for name in _imported_modules(found, package):
            module = sys.modules.get(name) if name.split(".")[0] in own else None
            if module is not None and getattr(module, "__file__", None):
                waiting.append((str(module.__file__), str(module.__package__ or "")))
    # Digests alone: the same sources in another folder give the same machine code.
    return hashlib.blake2b(b"".join(sorted(digests.values())), digest_size=8).hexdigest()


class _KernelFile(numba_caching.IndexDataCacheFile):  # type: ignore[misc]
    """One file a kernel, signature and source version: numba's payload followed by its SHA-256."""

    def __init__(self, cache_path: str, filename_base: str, stamp: str):
        super().__init__(cache_path, filename_base, stamp)
        self._base, self._stamp = filename_base, stamp

    def _name(self, key: object) -> tuple[str, str]:
        signature = hashlib.blake2b(repr(key).encode(), digest_size=8).hexdigest()
        prefix = f"{self._base}.{signature}."
        return prefix, f"{prefix}{self._stamp}.nbc"

    def flush(self) -> None:
        for path in Path(self._cache_path).glob(f"{self._base}.*.nbc"):
            path.unlink(missing_ok=True)

    def save(self, key: object, data: object) -> None:
        prefix, name = self._name(key)
        payload = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(payload)
            file.write(hashlib.sha256(payload).digest())
        _keep_newest(list(Path(self._cache_path).glob(f"{prefix}*.nbc")), KEPT_VERSIONS)

    def load(self, key: object) -> object | None:
        _, name = self._name(key)
        path = Path(self._data_path(name))
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        if len(content) < 32 or hashlib.sha256(content[:-32]).digest() != content[-32:]:
            log.warning("a damaged kernel file was removed: %s", path.name)
            path.unlink(missing_ok=True)
            return None
        data: object = self._load_data(name)  # numba's own reader stops before the checksum
        return data


class KernelCache(numba_caching.FunctionCache):  # type: ignore[misc]
    """numba's function cache with the file above; whatever goes wrong on disk means "compile again"."""

    def __init__(self, function: Callable[..., Any]):
        super().__init__(function)
        self._cache_file = _KernelFile(
            str(self._cache_path), str(self._impl.filename_base), source_stamp(function)
        )

    def load_overload(self, sig: object, target_context: object) -> object | None:
        """The compiled kernel, or None when there is none that can be used."""
        try:
            loaded: object | None = super().load_overload(sig, target_context)
        except Exception as error:
            log.warning("kernel %s is compiled again: %s", self._impl.filename_base, error)
            try:
                self._cache_file.flush()
            except OSError:
                log.warning("its damaged file stays: %s", self._cache_path)
            return None
        return loaded

    def save_overload(self, sig: object, data: object) -> None:
        """Keeps the compiled kernel; a full or read-only disk costs only the next start's time."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            log.warning("kernel %s is not kept: %s", self._impl.filename_base, error)
