"""Exif: what is told, what counts as not told, and what is never looked at."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from photo_support import ASCII, RATIONAL, SHORT, SIGNED, exif_block, shot_exif

from studio_core.imaging.exif import Told, orientation_block, read_exif
from studio_core.imaging.photograph import ShotFacts


@pytest.mark.parametrize("order", ["<", ">"])
def test_what_a_camera_writes_is_read(order: str) -> None:
    block = exif_block(
        {0x010F: (ASCII, "NIKON CORPORATION"), 0x0110: (ASCII, "NIKON D850"), 0x0112: (SHORT, 8)},
        {
            0x829A: (RATIONAL, (1, 320)),
            0x829D: (RATIONAL, (56, 10)),
            0x8827: (SHORT, 64),
            0x9204: (SIGNED, (-5, 3)),
            0x9003: (ASCII, "2024:05:06 07:08:09"),
            0x9291: (ASCII, "25"),
            0xA434: (ASCII, "8-15mm f/3.5"),
        },
        order=order,
    )
    told = read_exif(block)
    facts = told.facts
    assert facts.seconds == 1 / 320
    assert (facts.aperture, facts.iso, facts.bias) == (5.6, 64.0, -5 / 3)
    assert (facts.camera, facts.lens, told.orientation) == ("NIKON D850", "8-15mm f/3.5", 8)
    assert facts.taken is not None
    assert facts.taken % 60 == pytest.approx(9.25)
    assert read_exif(b"Exif\0\0" + block) == told


def test_apex_values_stand_in_for_missing_ones() -> None:
    facts = read_exif(exif_block({}, {0x9201: (SIGNED, (6, 1)), 0x9202: (RATIONAL, (4, 1))})).facts
    assert (facts.seconds, facts.aperture) == (1 / 64, 4.0)
    both = {0x829A: (RATIONAL, (1, 50)), 0x9201: (SIGNED, (6, 1))}
    assert read_exif(exif_block({}, both)).facts.seconds == 1 / 50


def test_a_speed_beyond_16_bits_is_found_where_it_stands() -> None:
    block = exif_block({}, {0x8827: (SHORT, 65535), 0x8832: (4, 102400)})
    assert read_exif(block).facts.iso == 102400


@pytest.mark.parametrize(
    ("tag", "entry", "name"),
    [
        (0x829A, (RATIONAL, (0, 0)), "seconds"),
        (0x829A, (RATIONAL, (0, 1)), "seconds"),
        (0x829A, (SIGNED, (-1, 50)), "seconds"),
        (0x829A, (RATIONAL, (4_000_000_000, 1)), "seconds"),
        (0x829D, (RATIONAL, (0, 1)), "aperture"),
        (0x8827, (SHORT, 0), "iso"),
        (0x9204, (SIGNED, (100, 1)), "bias"),
        (0x9204, (SIGNED, (1, 0)), "bias"),
        (0x9003, (ASCII, "    :  :     :  :  "), "taken"),
        (0x9003, (ASCII, "2024:02:32 07:08:09"), "taken"),
        (0x9202, (RATIONAL, (0, 1)), "aperture"),
    ],
)
def test_what_makes_no_sense_is_not_told(tag: int, entry: tuple, name: str) -> None:
    assert getattr(read_exif(exif_block({}, {tag: entry})).facts, name) is None


def test_the_position_is_never_looked_at() -> None:
    """Where the position would be are numbers that would be taken for an exposure if they were read."""
    position = {0x829A: (RATIONAL, (1, 7)), 0x8827: (SHORT, 777)}
    assert read_exif(exif_block({}, None, position)) == Told()
    assert read_exif(shot_exif(private=True)) == read_exif(shot_exif())


@given(st.binary(max_size=200), st.sampled_from([b"II*\0", b"MM\0*", b"Exif\0\0II*\0", b""]))
def test_any_bytes_can_be_read(data: bytes, start: bytes) -> None:
    read_exif(start + data)


@given(st.data())
def test_a_damaged_block_tells_less_or_other_but_possible_things(data: st.DataObject) -> None:
    block = bytearray(shot_exif(taken="2024:05:06 07:08:09", part="1", bias=(1, 3)))
    for _ in range(data.draw(st.integers(1, 8))):
        block[data.draw(st.integers(0, len(block) - 1))] = data.draw(st.integers(0, 255))
    told = read_exif(bytes(block[: data.draw(st.integers(0, len(block)))]))
    assert told.facts.seconds is None or 1e-7 <= told.facts.seconds <= 1e5
    assert told.facts.iso is None or told.facts.iso >= 1
    assert 1 <= told.orientation <= 8


def test_a_directory_that_leads_to_itself_ends() -> None:
    block = bytearray(exif_block({}, {0x8827: (SHORT, 100)}))
    place = block.index(struct.pack(">HHI", 0x8769, 4, 1)) + 8
    block[place : place + 4] = struct.pack(">I", 8)
    assert read_exif(bytes(block)).facts.iso is None


@pytest.mark.parametrize("turn", range(1, 9))
def test_the_smallest_block_tells_the_orientation(turn: int) -> None:
    assert read_exif(orientation_block(turn)) == Told(ShotFacts("", orientation=turn))
