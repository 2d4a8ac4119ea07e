"""The MaterialX library (Academy Software Foundation), loaded on first use; it belongs to an extra.

It reads XML in a parser of its own that refuses deep nesting and knows no entities, brings files of versions
from 1.22 on up to 1.39, and follows no includes unless it is told how to.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from studio_core.errors import InputError

MOST_BYTES = 16 << 20
INSTALL = "MaterialX files need the library materialx: pip install lucarne[materialx]"


def library() -> Any:
    """The module; InputError that says how to get it."""
    try:
        import MaterialX
    except ImportError:
        raise InputError(INSTALL) from None
    return MaterialX


def read(path: Path) -> tuple[Any, str]:
    """The document of a file, in today's version, and its text; InputError in one sentence."""
    mx = library()
    try:
        if not path.is_file():
            raise _refuse(path, "there is no such file")
        if path.stat().st_size > MOST_BYTES:
            raise _refuse(path, f"it is larger than {MOST_BYTES >> 20} MB")
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _refuse(path, "it is no text in UTF-8") from None
    except OSError as error:
        raise _refuse(path, error.strerror or str(error)) from None
    except ValueError as error:
        raise InputError(f"{str(path)!r} cannot be imported: {error}") from None
    document, options = mx.createDocument(), mx.XmlReadOptions()
    options.readXIncludeFunction = None
    try:
        mx.readFromXmlString(document, text.replace("\0", ""), mx.FileSearchPath(), options)
    except Exception as error:  # of its own kinds, LookupError and RuntimeError among them
        cause = " ".join(str(error).split())[:150].rstrip(".") or type(error).__name__
        raise _refuse(path, f"it is no MaterialX ({cause})") from None
    return document, text


def _refuse(path: Path, cause: str) -> InputError:
    return InputError(f"{path} cannot be imported: {cause}")
