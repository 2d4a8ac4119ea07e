"""Words and runs say the same, at every edge of a word and in both kinds of records."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle

from studio_plugins.cuts.intervals import (
    clear,
    gather_records,
    hide,
    lowest_bit,
    record_type,
    relabel,
    runs_of,
    set_bits,
)

TYPES = (np.uint16, np.uint32)
WORDS = 5
edges = st.sampled_from([0, 1, 31, 62, 63, 64, 65, 126, 127, 128, 191, 192, 255, 256, 318, 319])
places = edges | st.integers(0, 64 * WORDS - 1)
spans = st.lists(st.tuples(places, places).map(sorted), max_size=6)


def leaves(pairs, of=False):
    made = np.full(64 * WORDS, of)
    for first, last in pairs:
        made[first : last + 1] = not of
    return made


def test_records_are_as_small_as_they_can_be():
    assert record_type(16) is np.uint16
    assert record_type(17) is np.uint32
    assert np.iinfo(record_type(16)).max >= (1 << 16) - 1


@given(st.integers(0, 63), st.integers(0, (1 << 64) - 1))
def test_the_lowest_bit_is_found(place, above):
    assert lowest_bit(np.uint64(((above << 1 | 1) << place) & ((1 << 64) - 1))) == place


@given(spans, st.sampled_from(TYPES))
def test_runs_of_words(pairs, kind):
    bits = leaves(pairs)
    out = np.full(2 * len(bits) + 3, 7, kind)
    after = runs_of(oracle.words_of(bits), WORDS, out, 3)
    found = list(zip(out[3:after:2].tolist(), out[4:after:2].tolist(), strict=True))
    assert found == oracle.runs(bits)
    assert (out[:3] == 7).all()
    assert (out[after:] == 7).all()


@given(st.lists(st.booleans(), min_size=64, max_size=64))
def test_runs_of_any_word(bits):
    out = np.zeros(64, np.uint16)
    after = runs_of(oracle.words_of(np.array(bits)), 1, out, 0)
    assert list(zip(out[:after:2].tolist(), out[1:after:2].tolist(), strict=True)) == oracle.runs(bits)


@given(spans, places, places)
def test_setting_and_clearing(pairs, a, b):
    first, last = min(a, b), max(a, b)
    bits = leaves(pairs)
    more, less = oracle.words_of(bits), oracle.words_of(bits)
    set_bits(more, first, last)
    clear(less, first, last)
    np.testing.assert_array_equal(oracle.leaves_of(more), bits | leaves([(first, last)]))
    np.testing.assert_array_equal(oracle.leaves_of(less), bits & leaves([(first, last)], True))


@given(st.lists(spans, min_size=1, max_size=4), st.sampled_from(TYPES), st.integers(0, 15), st.booleans())
def test_what_records_hide(objects, kind, skipped, first):
    known = {3 + slot: oracle.runs(leaves(pairs)) for slot, pairs in enumerate(objects)}
    numbers = oracle.record(known)
    pool = np.array([9, 9] * first + numbers + [1, 1, 1, 1], kind)
    skip = np.zeros(8, np.bool_)
    skip[[slot for slot in known if skipped >> (slot - 3) & 1]] = True
    words = oracle.words_of(np.ones(64 * WORDS, np.bool_))
    hide(pool, 2 * first, len(numbers), skip, words)
    np.testing.assert_array_equal(
        oracle.leaves_of(words), oracle.seen(numbers, 64 * WORDS, np.flatnonzero(skip))
    )


@pytest.mark.parametrize("kind", TYPES)
def test_leaves_beyond_what_a_small_record_holds(kind):
    top = np.iinfo(np.uint16).max if kind is np.uint16 else (1 << 17) - 1
    words = np.zeros((top + 1) // 64, np.uint64)
    set_bits(words, top - 1, top)
    out = np.zeros(4, kind)
    assert runs_of(words, len(words), out, 0) == 2
    assert out[:2].tolist() == [top - 1, top]


def test_records_are_gathered_and_renamed():
    first, second = {2: [(0, 3), (9, 9)], 0: []}, {1: [(5, 6)], 2: [(7, 7)]}
    a, b = oracle.record(first), oracle.record(second)
    pool = np.array([8, 8, *b, 8, *a], np.uint16)
    length = np.array([len(a), len(b)], np.int32)
    out = np.zeros(len(a) + len(b), np.uint16)
    start = np.array([3 + len(b), 2])
    gather_records(pool, start, length, np.array([0, len(a)]), out)
    assert out.tolist() == a + b
    size = relabel(out, length, np.array([4, 5, 3]))
    assert out[:size].tolist() == oracle.record({3: first[2], 4: []}) + oracle.record(
        {5: [(5, 6)], 3: [(7, 7)]}
    )


def test_segments_of_what_has_no_new_name_are_left_out():
    records = [{2: [(0, 3), (9, 9)], 0: [(1, 1)]}, {1: [(5, 6)]}, {2: [], 1: [(4, 8)]}]
    numbers = [oracle.record(known) for known in records]
    pool = np.array([number for own in numbers for number in own], np.uint16)
    length = np.array([len(own) for own in numbers], np.int32)
    size = relabel(pool, length, np.array([0, -1, 7]))
    left = [oracle.record({7: [(0, 3), (9, 9)], 0: [(1, 1)]}), [], oracle.record({7: []})]
    assert length.tolist() == [len(own) for own in left]
    assert pool[:size].tolist() == [number for own in left for number in own]
