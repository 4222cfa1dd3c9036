"""Whole worlds, from scenes of any kind: they are refused with places, or simulated, or break with a report; nothing else happens. And
they take no more memory than twice what was estimated.

Trees that the checker refuses, by the hundred thousand, are in crates/tumble-interface/tests/fuzz.rs; bytes of meshes, figures and
fabrics in crates/tumble-io/tests/fuzz.rs; links in web/tests/share.test.ts. `TUMBLE_FUZZ=20` tries twenty times as many.
"""

import copy
import json
import math
import os
import random
import re
import time
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nursery import Nursery
from runs import Tree

import tumble as package
from tumble import Scene, SceneError, TumbleError

FACTOR = float(os.environ.get("TUMBLE_FUZZ", "1"))
SHIPPED = {f"{f.parent.name}/{f.stem}": f for f in sorted(Path(package.__file__).parent.glob("scenes/*/*.toml"))}
WORDS = sorted(set(re.findall(r'"(?:const|enum)": "?\[?"([a-z_]+)"', json.dumps(Scene.schema()))))
WORDS += sorted({word for text in re.findall(r'"enum": \[([^\]]*)\]', json.dumps(Scene.schema())) for word in re.findall(r'"(\w+)"', text)})

LIMIT = 0.25
"""Memory that a changed scene may ask for [GiB]."""

ALWAYS = 48 << 20
"""Bytes that come with any scene: the stacks of threads, pages of the library, what Python makes of the tree and of the frame."""

SLOW = ["cloth/dress", "cloth/drapes", "cloth/mannequin", "cloth/hair-on-bunny", "gas/bunny", "drape/sheet-on-bunny", "cloth/pile"]
"""Half a second a frame and more: left out where many cases matter more."""

# Changed scenes


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every place in a tree: what holds it, and its key or index."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else []
    for key, below in items:
        yield tree, key
        yield from places(below)


def number(x: float, dice: random.Random) -> float | int:
    """A number in place of another."""
    y = dice.choice(
        [
            lambda: 0,
            lambda: -x,
            lambda: x * 10 ** dice.uniform(-3, 3),
            lambda: x * 10 ** dice.uniform(-30, 30),
            lambda: x + dice.choice([-1, 1]),
            lambda: dice.choice([1e-300, 1e300, 5e-324, 1e9, 1e-9, 0.5, 1, 2, 3, 1e38, 1e39, 4294967295]),
            lambda: dice.uniform(-10, 10),
        ]
    )()
    return round(y) if isinstance(x, int) and abs(y) < 1e18 and dice.random() < 0.9 else float(y)


def change(tree: Tree, dice: random.Random, others: list[Tree]) -> None:
    """One change: mostly of numbers, which pass the checker more often."""
    holder, key = dice.choice(list(places(tree)))
    value = holder[key]
    match dice.randrange(16):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, list):
            holder.extend(copy.deepcopy(value) for _ in range(dice.randrange(1, 4)))
        case 2:
            holder[key] = dice.choice([None, True, "", [], {}, [0, 0, 1], dice.choice(WORDS), "sin(t)", "[x, y, z]", math.nan, math.inf])
        case 3 | 4:
            # Things and settings of another scene.
            other = dice.choice(others)
            kind = dice.choice([k for k in other if k not in ("version", "title", "output", "camera", "expect")])
            if isinstance(other[kind], list):
                tree[kind] = tree.get(kind, []) if dice.random() < 0.7 and isinstance(tree.get(kind, []), list) else []
                tree[kind].append(copy.deepcopy(dice.choice(other[kind])))
            else:
                tree[kind] = copy.deepcopy(other[kind])
        case _:
            numbers = [(h, k) for h, k in places(tree) if isinstance(h[k], int | float) and not isinstance(h[k], bool)]
            for holder, key in dice.sample(numbers, min(len(numbers), dice.choice([1, 1, 1, 3]))):
                holder[key] = number(holder[key], dice)
            texts = [(h, k) for h, k in places(tree) if isinstance(h[k], str) and h[k] in WORDS]
            if texts and dice.random() < 0.2:
                holder, key = dice.choice(texts)
                holder[key] = dice.choice(WORDS)


def changed(which: Path, seed: int, others: list[Tree]) -> Tree:
    dice = random.Random(seed)
    tree = tomllib.loads(which.read_text(encoding="utf-8"))
    for _ in range(dice.choice([1, 1, 1, 2, 2, 4])):
        change(tree, dice, others)
    tree["version"] = 1
    if not isinstance(tree.get("world"), dict):
        tree["world"] = {}
    tree["world"]["memory_limit"] = LIMIT
    return tree


def wrong(answer: dict[str, Any]) -> str | None:
    """What is wrong with the end of a case."""
    if answer["end"] not in ("refused", "built", "broke", "stopped"):
        return str(answer["text"])
    if answer["end"] == "refused":
        if not answer["issues"]:
            return "refused without an issue"
        for issue in answer["issues"]:
            message = issue["message"]
            # Of a scene that is empty, or of its depth, there is no place to name.
            whole = message.startswith(("nothing to simulate", "nested too deeply"))
            if not (issue["path"] or whole) or not message or re.search(r"[\n\r\0]", message) or len(message) > 3000:
                return f"refused with {issue}"
    if answer["end"] == "built" and (not answer["finite"] or not re.fullmatch("[0-9a-f]{16}", answer["hash"])):
        return f"a frame that is not finite: {answer['energy']}"
    if answer["end"] == "broke" and (not answer["text"] or "\n" in answer["text"]):
        return f"broke with {answer['text']!r}"
    if answer.get("taken", 0) > 2 * LIMIT * 2**30 + ALWAYS:
        return f"{answer['taken'] / 2**20:.0f} MiB where {LIMIT} GiB are the limit"
    return None


def test_changed_worlds_are_refused_built_or_break() -> None:
    """200 of them; a failure names the seed, from which `changed` makes the tree again."""
    files = [file for name, file in SHIPPED.items() if name not in SLOW]
    others = [tomllib.loads(file.read_text(encoding="utf-8")) for file in SHIPPED.values()]
    ends: Counter[str] = Counter()
    begin, most, failures = time.perf_counter(), 0.0, []
    first = int(os.environ.get("TUMBLE_FUZZ_SEED", "0"))
    with Nursery() as nursery:
        for seed in range(first, first + max(round(200 * FACTOR), 1)):
            file = files[seed % len(files)]
            answer = nursery.ask(changed(file, seed, others), str(file.parent))
            ends[answer["end"]] += 1
            most = max(most, (answer.get("taken", 0) - ALWAYS) / (LIMIT * 2**30))
            if problem := wrong(answer):
                failures.append(f"{file.stem}, seed {seed}: {problem}")
    counts = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    print(f"\nworlds, changed: {sum(ends.values())} cases, {counts}, {time.perf_counter() - begin:.0f} s, memory at most {most:.2f} of the limit")
    assert not failures, "\n".join(failures)
