"""Damaged copies of real project files: each is refused with a sentence or opens as the very same scene.

`LUCARNE_FUZZ` sets the number of mutants (500; a release run takes 20,000).
"""

from __future__ import annotations

import json
import os
import random
import select
import sqlite3
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from project_support.disk import environment
from project_support.forge import Forge, Json
from project_support.samples import renamed, small_scene

from studio_core.document import Step
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.project.store import save
from studio_core.scene.nodes import Group

MUTANTS = int(os.environ.get("LUCARNE_FUZZ", "500"))
SECONDS = 10.0
SPLICES = [
    b"\xff" * 8,
    b"\x00" * 8,
    b"\x7f\xff\xff\xff",
    b"1e999",
    b"NaN",
    b"[[[[[[",
    b'"type":"x"',
    b"CREATE VIEW",
]

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc and rlimits")


class Child:
    """The process that opens mutants; it must outlive them all."""

    def __init__(self, warm: Path) -> None:
        command = [sys.executable, "-W", "error", "-m", "project_support.fuzz_child", str(warm)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment(), bufsize=0
        )

    def open(self, path: Path, *, first: bool = False) -> dict[str, Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{path}\n".encode())
        ready, _, _ = select.select([self.process.stdout], [], [], 60.0 if first else SECONDS)
        assert ready, f"opening took over {SECONDS:.0f} s"
        line = b""
        while not line.endswith(b"\n"):
            piece = self.process.stdout.read(1 << 16)
            assert piece, f"the program died: {self.process.wait(5)}"
            line += piece
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(10)


def mutate(data: bytes, other: bytes, rng: random.Random) -> bytes:
    """One to eight changes of the kinds that find most: bits, numbers, blocks, splices, lengths."""
    made = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 3, 8])):
        if len(made) < 200:
            break
        kind = rng.randrange(9)
        at = rng.randrange(len(made)) if rng.random() < 0.6 else rng.randrange(min(len(made), 4096))
        if kind == 0:
            made[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            made[at] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])
        elif kind == 2:
            made[at : at + 4] = rng.randbytes(4)
        elif kind == 3:
            splice = rng.choice(SPLICES)
            made[at : at + len(splice)] = splice
        elif kind == 4:
            length = rng.choice([16, 512, 4096])
            source = rng.randrange(len(other))
            made[at : at + length] = other[source : source + length]
        elif kind == 5:
            page, another = (4096 * rng.randrange(max(1, len(made) // 4096)) for _ in range(2))
            made[page : page + 4096] = made[another : another + 4096]
        elif kind == 6:
            del made[at : at + rng.choice([1, 100, 4096])]
        elif kind == 7:
            made = made[:at]
        else:
            page = 4096 * rng.randrange(max(1, len(made) // 4096))
            for spot in (page + rng.randrange(12), page + 8 + rng.randrange(200)):
                if spot < len(made):
                    made[spot] = rng.randrange(256)
    return bytes(made)


def mutate_rows(path: Path, rng: random.Random) -> None:
    """Change cells of a well-formed database."""
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA synchronous=OFF")
    table, column = rng.choice(
        [("item", "json"), ("item", "hash"), ("blob", "data"), ("blob", "part"), ("blob", "hash")]
        + [("revision", c) for c in ("id", "parent", "label", "time", "items")]
        + [("meta", "value"), ("meta", "key")]
    )
    rows = connection.execute(f"SELECT rowid, {column} FROM {table}").fetchall()
    rowid, old = rng.choice(rows)
    if isinstance(old, str | bytes) and rng.random() < 0.7:
        raw = bytearray(old.encode() if isinstance(old, str) else old)
        for _ in range(rng.randint(1, 3)):
            at = rng.randrange(len(raw) + 1)
            raw[at : at + rng.randint(0, 3)] = rng.choice([b"", rng.randbytes(2), *SPLICES])
        new: Any = bytes(raw) if isinstance(old, bytes) else raw.decode("latin-1")
    else:
        new = rng.choice(
            [None, -1, 0, 2**63 - 1, 1e308, float("inf"), "", "x", b"", b"\xff" * 100, "é" * 300]
        )
    try:
        connection.execute(f"UPDATE OR REPLACE {table} SET {column} = ? WHERE rowid = ?", (new, rowid))
    except sqlite3.Error:
        connection.execute(f"DELETE FROM {table} WHERE rowid = ?", (rowid,))
    connection.close()


ODD: list[Any] = [None, True, -1, 0.0, 1e308, "", "a", "é" * 999, [], {}, [1.0, 2.0, 3.0], {"blob": "0" * 32}]


def twisted(value: Any, rng: random.Random) -> Any:
    """The value with something inside it replaced, removed or added."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(sorted(value))
        made = dict(value)
        chance = rng.random()
        if chance < 0.15:
            del made[key]
        elif chance < 0.25:
            made[rng.choice(["parent", "geometry", "x"])] = made[key]
        else:
            made[key] = twisted(made[key], rng)
        return made
    if isinstance(value, list) and value and rng.random() < 0.7:
        at = rng.randrange(len(value))
        return [*value[:at], twisted(value[at], rng), *value[at + 1 :]]
    if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.6:
        return rng.choice([value + 1, -value, value * 1e6, int(value), float(value)])
    return rng.choice(ODD)


def forge(path: Path, rng: random.Random) -> None:
    """Twist one node or material and fit all addresses to it."""
    forged = Forge(path)
    victim = rng.choice(sorted(json.loads(text).get("id", "") for text in forged.items.values()))

    def edit(value: Json) -> Any:
        return twisted(value, rng) if value["id"] == victim else None

    forged.change(edit)


def test_mutants_of_projects_are_refused_or_whole(tmp_path: Path) -> None:
    rng = random.Random(404)
    many = small_scene(2).with_nodes(*(Group(id=f"g{k}", name=f"Group {k}") for k in range(300)))
    seeds: list[tuple[Path, list[str], list[list[str]]]] = []
    for name, scene in (("small", small_scene(1, faces=40)), ("many", many)):
        path = tmp_path / f"{name}.lucarne"
        before = renamed(scene, "Before")
        save(path, before, label="First", session={"exposure": 1.0})
        steps = (Step("Open", before), Step("Rename", scene))
        save(path, scene, label="Second", history=History(steps, 1), session={"exposure": 2.0})
        digests = [scene_digest(before), scene_digest(scene)]
        seeds.append((path, digests, [[], digests]))

    child = Child(seeds[0][0])
    outcomes: Counter[str] = Counter()
    try:
        for path, digests, _ in seeds:
            assert child.open(path, first=True)["opened"] == digests[1]
        for number in range(MUTANTS):
            path, digests, histories = rng.choice(seeds)
            mutant = tmp_path / "mutant.lucarne"
            mutant.with_name("mutant.lucarne-journal").unlink(missing_ok=True)
            mutant.write_bytes(path.read_bytes())
            chance = rng.random()
            if chance < 0.2:
                forge(mutant, rng)
            elif chance < 0.45:
                mutate_rows(mutant, rng)
            else:
                mutant.write_bytes(mutate(path.read_bytes(), rng.choice(seeds)[0].read_bytes(), rng))
            if rng.random() < 0.1:
                journal = mutate(path.read_bytes(), rng.randbytes(5000), rng)
                head = bytes.fromhex("d9d505f920a163d7") + (8).to_bytes(4, "big") + bytes(4)
                head += (20).to_bytes(4, "big") + (512).to_bytes(4, "big") + (4096).to_bytes(4, "big")
                mutant.with_name("mutant.lucarne-journal").write_bytes(head.ljust(512, b"\0") + journal)
            answer = child.open(mutant)
            kept = tmp_path / f"found-{number}.lucarne"
            if "wrong" in answer:
                kept.write_bytes(mutant.read_bytes())
                pytest.fail(f"mutant {number} (kept as {kept}): {answer['wrong']}")
            if "refused" in answer:
                assert "mutant.lucarne" in answer["refused"]
                assert "\n" not in answer["refused"]
                outcomes["refused"] += 1
            elif chance < 0.2:
                outcomes["opened, changed"] += 1
            else:
                assert answer["opened"] in digests, f"mutant {number} opened as something else"
                assert answer["steps"] in histories, f"mutant {number} opened with another history"
                assert answer["session"] in ({"exposure": 1.0}, {"exposure": 2.0})
                outcomes["opened whole"] += 1
    finally:
        child.close()
    print(outcomes)
    assert outcomes["refused"] > MUTANTS // 3
    assert outcomes["opened whole"] > 0
