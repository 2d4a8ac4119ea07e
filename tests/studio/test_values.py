"""KEY=VALUE on the command line."""

from __future__ import annotations

import argparse

import pytest

from studio.values import add_values, key_values
from studio_core.errors import InputError


def test_the_last_of_a_name_counts_and_values_may_hold_anything() -> None:
    assert key_values("--param", ["a=1", "b=x=y", "a=", "c= 2"]) == {"a": "", "b": "x=y", "c": " 2"}


def test_a_text_without_a_value_is_refused_by_its_option() -> None:
    with pytest.raises(InputError, match=r"--solver-param 'level': write KEY=VALUE"):
        key_values("--solver-param", ["a=1", "level"])


def test_the_option_may_be_repeated_or_left_out() -> None:
    verb = argparse.ArgumentParser()
    add_values(verb, "--param", "the backend")
    assert verb.parse_args([]).param == []
    assert verb.parse_args(["--param", "a=1", "--param", "b=2"]).param == ["a=1", "b=2"]
