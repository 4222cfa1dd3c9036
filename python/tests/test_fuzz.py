"""Whole worlds, from scenes of any kind: they are refused with places, or simulated, or break with a report; nothing else.
And they take no more memory than twice what was estimated.

Trees that the checker refuses, by the hundred thousand, are in crates/tumble-interface/tests/fuzz.rs; bytes of meshes, figures
and fabrics in crates/tumble-io/tests/fuzz.rs; frames and checkpoints in test_archives.py; links in web/tests/fuzz.test.ts.
`TUMBLE_FUZZ=20` tries twenty times as many.
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
from counts import FACTOR, note
from hypothesis import given, settings
from hypothesis import strategies as st
from nursery import Nursery
from runs import Tree

import tumble as package
from tumble import Scene, SceneError, TumbleError

SHIPPED = {f"{f.parent.name}/{f.stem}": f for f in sorted(Path(package.__file__).parent.glob("scenes/*/*.toml"))}
WORDS = sorted(set(re.findall(r'"(?:const|enum)": "?\[?"([a-z_]+)"', json.dumps(Scene.schema()))))
WORDS += sorted(
    {
        word
        for text in re.findall(r'"enum": \[([^\]]*)\]', json.dumps(Scene.schema()))
        for word in re.findall(r'"(\w+)"', text)
    }
)

LIMIT = 0.25
"""Memory that a changed scene may ask for [GiB]."""

ALWAYS = 48 << 20
"""Bytes of any scene: the stacks of threads, pages of the library, what Python makes of the tree and of the frame."""

SLOW = [
    "cloth/dress",
    "cloth/drapes",
    "cloth/mannequin",
    "cloth/hair-on-bunny",
    "gas/bunny",
    "drape/sheet-on-bunny",
    "cloth/pile",
]
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
            holder[key] = dice.choice(
                [None, True, "", [], {}, [0, 0, 1], dice.choice(WORDS), "sin(t)", "[x, y, z]", math.nan, math.inf]
            )
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
    """Fault in the outcome of a case."""
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
    if answer.get("taken", 0) > 2 * answer.get("estimate", 0.0) + ALWAYS and not answer["crushed"]:
        return f"{answer['taken'] / 2**20:.0f} MiB where {answer['estimate'] / 2**20:.1f} were estimated"
    return None


def test_changed_worlds_are_refused_built_or_break() -> None:
    """A failure names the seed, from which `changed` makes the tree again."""
    files = [file for name, file in SHIPPED.items() if name not in SLOW]
    others = [tomllib.loads(file.read_text(encoding="utf-8")) for file in SHIPPED.values()]
    ends: Counter[str] = Counter()
    begin, most, failures = time.perf_counter(), 0.0, []
    first = int(os.environ.get("TUMBLE_FUZZ_SEED", "0"))
    with Nursery() as nursery:
        for seed in range(first, first + max(round(200 * FACTOR), 1)):
            file = files[seed % len(files)]
            tree = changed(file, seed, others)
            answer = nursery.ask(tree, str(file.parent))
            ends[answer["end"]] += 1
            # Of surfaces that are crushed to a point, everything meets everything; the estimate does not know.
            answer["crushed"] = "self_contact" in json.dumps(tree.get("system"))
            if not answer["crushed"]:
                most = max(most, (answer.get("taken", 0) - ALWAYS) / max(answer.get("estimate", 0.0), 1.0))
            if problem := wrong(answer):
                failures.append(f"{file.stem}, seed {seed}: {problem}")
    counts = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    print(
        f"\nworlds, changed: {sum(ends.values())} cases, {counts}, {time.perf_counter() - begin:.0f} s,"
        f" memory at most {most:.2f} of the estimate"
    )
    note("random cases", "worlds, changed", cases=sum(ends.values()), **ends, memory=f"{most:.2f} of the estimate")
    assert not failures, "\n".join(failures)


# Memory

GIB = 2**30


def box(resolution: int) -> Tree:
    return {"size": [1, 1, 1], "resolution": resolution}


def cloud(count: int, **words: Any) -> Tree:
    return {"particles": [{"name": "p", "cloud": {"size": [1, 1, 1], "count": count}}], **words}


def sheet(n: int, system: Tree, **words: Any) -> Tree:
    return {"sheet": [{"name": "s", "size": [2, 2], "resolution": [n, n], **words}], "system": [system]}


def block(n: int, system: Tree, **words: Any) -> Tree:
    return {"block": [{"name": "b", "size": [1, 1, 1], "resolution": [n, n, n], **words}], "system": [system]}


IMPLICIT = {"integrator": "implicit_euler"}
DIRECT = {"integrator": "implicit_euler", "solver": {"linear": "cholesky"}}
POSITIONS = {"method": "position_based", "step": 5e-3}
WARM = {"temperature": 300, "conductivity": 1, "density": 1000, "heat_capacity": 1000}
SMOKE = {"smoke": {}, "temperature": {}}
DOUBLE = {"precision": "double"}
LARGE: dict[str, Tree] = {
    "a million particles": cloud(10**6),
    "a million particles, double": cloud(10**6, **DOUBLE),
    "particles, adaptive": cloud(10**5, system=[{"integrator": "dormand_prince"}], **DOUBLE),
    "particles, neighbours": cloud(10**5, force=[{"kind": "flock", "radius": 0.02}]),
    "emitter": {"emitter": [{"name": "e", "rate": 400_000, "speed": 1, "from": {"disk": {"radius": 0.1}}}]},
    "liquid": {
        "particles": [
            {"name": "w", "fluid": {"spacing": 0.025, "fill": [{"center": [0, 0, 0.5], "size": [1, 1, 0.6]}]}}
        ],
        "system": [POSITIONS],
    },
    "rope": {"rope": [{"name": "r", "from": [0, 0, 0], "to": [2000, 0, 0], "segments": 100_000}], "system": [IMPLICIT]},
    "sheet": sheet(300, IMPLICIT),
    "sheet, positions": sheet(300, POSITIONS),
    "sheet, direct": sheet(200, DIRECT),
    "sheet, membrane": sheet(200, IMPLICIT, membrane={"warp": 100}, isometric=1e-5),
    "sheet, contact": sheet(100, POSITIONS | {"self_contact": {"thickness": 0.01}}),
    "sheet, fabric": sheet(150, POSITIONS, fabric="denim"),
    "sheet, tears": sheet(200, POSITIONS, tear={"strain": 0.5}),
    "block": block(40, IMPLICIT, links={"structural": 100, "shear": 50}),
    "solid": block(25, IMPLICIT, material={"young": 1e4, "poisson": 0.3}),
    "solid, direct": block(20, DIRECT, material={"young": 1e4, "poisson": 0.3}),
    "hair": {
        "collider": [{"name": "ball", "shape": {"sphere": {"radius": 0.5}}}],
        "hair": [{"name": "h", "on": "ball", "count": 5000, "segments": 20, "length": 0.2}],
        "system": [POSITIONS],
    },
    "cloth": {
        "cloth": [
            {"name": "c", "resolution": 0.01, "panels": [{"name": "a", "outline": [[0, 0], [2, 0], [2, 2], [0, 2]]}]}
        ],
        "system": [POSITIONS],
    },
    "solid of changing size": cloud(
        10,
        collider=[
            {
                "name": "ball",
                "shape": {"sphere": {"radius": 0.5, "center": [9, 0, 0]}},
                "motion": {"scale": {"keys": [[0.01 * i, 1 + i % 2] for i in range(2000)]}},
            }
        ],
    ),
    "gas in a plane": {"dimension": 2, "gas": [{"name": "g", "box": box(512), "smoke": {}}]},
    "gas": {"gas": [{"name": "g", "box": box(80), **SMOKE}]},
    "gas, double": {"gas": [{"name": "g", "box": box(80), **SMOKE}], **DOUBLE},
    "fire": {"gas": [{"name": "g", "box": box(64), **SMOKE, "fire": {}, "confinement": 1.0}]},
    "gas of two densities": {"gas": [{"name": "g", "box": box(64), "smoke": {}, "densities": "variable"}]},
    "heat": {"heat": [{"name": "h", "box": box(128), **WARM}], **DOUBLE},
    "heat, explicit": {"heat": [{"name": "h", "box": box(128), **WARM, "scheme": "explicit"}]},
    "sound": {"compressible": [{"name": "c", "box": box(64), "sound_speed": 10, "density": 1}]},
    "sound, double": {"compressible": [{"name": "c", "box": box(64), "sound_speed": 10, "density": 1}], **DOUBLE},
}
"""Scenes that take much, of every kind of object."""


def compare_memory(trees: dict[str, tuple[Tree, str]]) -> None:
    failures, most, begin = [], (0.0, ""), time.perf_counter()
    with Nursery() as nursery:
        for name, (tree, folder) in trees.items():
            answer = nursery.ask(tree, folder, frames=2, patience=300)
            taken, guess = answer["taken"], answer["estimate"]
            if answer["end"] not in ("built", "broke") or taken > 2 * guess + ALWAYS:
                failures.append(
                    f"{name}: {answer['end']}, {taken / 2**20:.0f} MiB taken, {guess / 2**20:.0f} MiB estimated"
                )
            most = max(most, ((taken - ALWAYS) / guess, name))
            print(f"{name}: {taken / 2**20:.0f} MiB taken, {guess / 2**20:.1f} estimated")
    print(
        f"memory: {len(trees)} scenes, {time.perf_counter() - begin:.0f} s,"
        f" memory at most {most[0]:.2f} of the estimate ({most[1]})"
    )
    note("memory", "scenes, estimated and weighed", cases=len(trees), most=f"{most[0]:.2f} of the estimate ({most[1]})")
    assert not failures, "\n".join(failures)


def test_memory_is_estimated() -> None:
    few = [
        "a million particles",
        "emitter",
        "solid of changing size",
        "sheet, direct",
        "sound, double",
    ]
    compare_memory({name: ({"version": 1} | LARGE[name], ".") for name in few})


@pytest.mark.long
def test_memory_of_everything_is_estimated() -> None:
    trees = {name: ({"version": 1} | tree, ".") for name, tree in LARGE.items()}
    trees |= {name: (tomllib.loads(f.read_text(encoding="utf-8")), str(f.parent)) for name, f in SHIPPED.items()}
    compare_memory(trees)


def test_a_scene_that_asks_for_more_than_there_may_be_takes_nothing() -> None:
    with Nursery() as nursery:
        for tree in (
            {"version": 1} | cloud(10**8),
            {"version": 1, "gas": [{"name": "g", "box": box(4000), "smoke": {}}]},
        ):
            answer = nursery.ask(tree)
            assert answer["end"] == "refused" and answer["taken"] < ALWAYS
            assert re.search(r"about \d+\.\d GiB, the limit is 8 GiB", answer["text"])


# Trees of Python

LEAVES = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cc", "Cs"]), max_size=8)
    | st.sampled_from([np.float32(1), np.int64(2), np.zeros(3), np.zeros((2, 3)), np.array(["a"]), np.nan, np.zeros(0)])
    | st.sampled_from([10**400, -(10**400), b"bytes", {1, 2}, object(), 1j, range(3), Ellipsis, int, "\ud800"])
)
TREES = st.recursive(
    LEAVES,
    lambda below: (
        st.lists(below, max_size=4)
        | st.tuples(below, below)
        | st.dictionaries(st.sampled_from(WORDS) | st.text(max_size=4) | st.integers(), below, max_size=4)
    ),
    max_leaves=12,
)


def test_any_tree_of_python_is_refused_or_a_scene() -> None:
    ends: Counter[str] = Counter()

    @settings(max_examples=max(round(400 * FACTOR), 1), deadline=None)
    @given(TREES, st.sampled_from([None, "particles", "sheet", "world", "system", "force", "gas"]))
    def try_one(tree: Any, key: str | None) -> None:
        try:
            Scene(tree if key is None else {"version": 1, key: tree})
            ends["read"] += 1
        except TumbleError as error:
            assert isinstance(error, SceneError) and error.issues and str(error)
            assert all(issue["message"] for issue in error.issues)
            ends["refused"] += 1

    try_one()
    note("random cases", "trees of Python", cases=ends.total(), **ends)


def test_trees_that_hold_themselves_are_refused() -> None:
    tree: dict[str, Any] = {"version": 1}
    tree["world"] = tree
    items: list[Any] = []
    items.append(items)
    for whole in (tree, {"version": 1, "particles": items}, items):
        with pytest.raises(SceneError):
            Scene(whole)  # type: ignore[arg-type]
