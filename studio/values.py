"""Parameters as the command line has them: KEY=VALUE, once for each."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from studio_core.errors import InputError


def add_values(verb: argparse.ArgumentParser, option: str, of: str) -> None:
    """The option, which may be repeated."""
    text = f"a parameter of {of}; may be repeated"
    verb.add_argument(option, action="append", default=[], metavar="KEY=VALUE", help=text)


def key_values(option: str, texts: Sequence[str]) -> dict[str, object]:
    """Names and their texts, the last one of each; InputError that names the option."""
    values: dict[str, object] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"{option} {text!r}: write KEY=VALUE")
        values[name] = value
    return values


__all__ = ["add_values", "key_values"]
