"""Read-only arrays: nobody can change a scene from outside, and versions share what is already frozen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studio_core.arrays import content_hash, frozen_map, readonly

ARRAYS = hnp.arrays(
    st.sampled_from([np.float32, np.float64, np.uint8]),
    hnp.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5),
    elements={"min_value": 0, "max_value": 100},
)
VIEWS = {
    "itself": lambda a: a,
    "a view": lambda a: a[:],
    "transposed": lambda a: a.T,
    "every other": lambda a: a[::2],
    "a read-only view": lambda a: _locked(a.view()),
    "a read-only view of a view": lambda a: _locked(a[:].view()),
    "a broadcast": lambda a: np.broadcast_to(a, (2, *a.shape)),
}


def _locked(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


@given(ARRAYS, st.sampled_from(sorted(VIEWS)))
def test_later_writes_to_the_source_are_not_seen(array: np.ndarray, view: str) -> None:
    given_ = VIEWS[view](array)
    made = readonly(given_, np.float32)
    wanted = np.array(given_, np.float32)
    array.flags.writeable = True
    array += 1
    assert made.dtype == np.float32
    assert made.flags.c_contiguous
    assert not made.flags.writeable
    assert np.array_equal(made, wanted)
    if made.size:
        with pytest.raises(ValueError, match="read-only"):
            made[...] = 0


@given(ARRAYS)
def test_what_is_frozen_already_is_shared(array: np.ndarray) -> None:
    made = readonly(array, array.dtype)
    assert readonly(made, array.dtype) is made


def test_bytes_are_not_copied() -> None:
    array = np.frombuffer(bytes(12), np.float32)
    assert readonly(array, np.float32, -1) is array


def test_shapes_are_checked() -> None:
    assert readonly([[1, 2, 3]], np.float32, -1, 3).shape == (1, 3)
    for shape in ((3,), (1, 2), (1, 3, 1)):
        with pytest.raises(ValueError, match="expected an array of shape"):
            readonly(np.zeros(shape), np.float32, -1, 3)


def test_a_frozen_map_is_a_copy_in_order() -> None:
    source = {"b": 1, "a": 2}
    made = frozen_map(source)
    source["c"] = 3
    assert list(made.items()) == [("b", 1), ("a", 2)]
    with pytest.raises(TypeError):
        made["d"] = 4  # type: ignore[index]


@given(ARRAYS, ARRAYS)
def test_hashes_are_equal_exactly_for_equal_content(a: np.ndarray, b: np.ndarray) -> None:
    same = a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    assert (content_hash(a) == content_hash(b)) == same
    assert content_hash(a.T) == content_hash(np.ascontiguousarray(a.T))


def test_a_hash_sees_shape_kind_and_the_border_between_arrays() -> None:
    whole = np.arange(6, dtype=np.uint8)
    assert content_hash(whole) != content_hash(whole.reshape(2, 3))
    assert content_hash(whole) != content_hash(whole.view(np.int8))
    assert content_hash(whole[:2], whole[2:]) != content_hash(whole[:4], whole[4:])
