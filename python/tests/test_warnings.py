"""Warnings have codes, are listed in docs/warnings.md, appear once with a count, and tell of figures unlike anything real."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Answer
from runs import Tree

from tumble import SceneError, World

ROOT = Path(__file__).parents[2]
LISTED = re.findall(r"^### (\S+)$", (ROOT / "docs/warnings.md").read_text(encoding="utf-8"), re.MULTILINE)


def test_every_code_is_listed_and_every_listed_code_is_said() -> None:
    words = re.findall(
        r"(\w+) = \"([a-z-]+)\",", (ROOT / "crates/tumble-interface/src/warning.rs").read_text(encoding="utf-8")
    )
    engine = "".join(file.read_text(encoding="utf-8") for file in (ROOT / "crates/tumble/src").rglob("*.rs"))
    unsaid = [code for variant, code in words if f"Code::{variant}" not in engine]
    front = "".join(file.read_text(encoding="utf-8") for file in (ROOT / "python/tumble").rglob("*.py"))
    said = re.findall(r'(?:warn\(|yield \(\s*|"code": )"([a-z-]+)"', front)
    assert len(words) > 15 and len(said) > 4 and not unsaid
    assert sorted(LISTED) == sorted({code for _, code in words} | set(said))
    assert len(LISTED) == len(set(LISTED))


def test_a_kind_appears_once_with_a_count(scene_file: Callable[..., Path], tumble: Callable[..., Answer]) -> None:
    emitters = [{"name": f"e{i}", "rate": 9, "start": 60, "from": {"point": {"at": [i, 0, 0]}}} for i in range(9)]
    scene = {"version": 1, "time": {"frames": 2}, "emitter": emitters, "output": {"plot": False, "stills": [40]}}
    path = scene_file(scene)
    for words in (["check", path], ["run", path, "--out", path.parent / "out"]):
        answer = tumble(*map(str, words))
        told = [line for line in answer.err.splitlines() if line.startswith("warning[")]
        assert len(told) == 2, answer
        births = next(line for line in told if line.startswith("warning[no-births]: "))
        assert 'emitter "e0": nothing is born' in births and "(8 more of this kind: " in births
        assert births.endswith('emitter "e1", emitter "e2", emitter "e3", emitter "e4", 4 others)'), births
    kept = json.loads((path.parent / "out/run.json").read_text())["warnings"]
    assert [w["code"] for w in kept].count("no-births") == 9 and len(kept) == 10


SHEET = {"name": "s", "size": [1, 1], "resolution": [3, 3]}
BLOCK = {"name": "b", "size": [1, 1, 1], "resolution": [2, 2, 2], "material": {"young": 1e6, "poisson": 0.3}}
ROPE = {"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 2}
LIQUID = {"spacing": 0.1, "fill": [{"center": [0, 0, 0], "size": [0.3, 0.3, 0.3]}]}
SOFT = {"system": [{"method": "position_based"}]}
DOUBTS: list[tuple[Tree, Tree, str, str, str]] = [
    # Suspicious tree, sound tree, code, path, figure.
    (
        {"sheet": [SHEET | {"density": 8.1}]},
        {"sheet": [SHEET | {"density": 7.9}]},
        "implausible-weight",
        'sheet "s".density',
        "20.2 times",
    ),
    (
        {"sheet": [SHEET | {"density": 5e-5}]},
        {"sheet": [SHEET | {"density": 2e-4}]},
        "implausible-weight",
        'sheet "s".density',
        "film",
    ),
    (
        {"sheet": [SHEET | {"fabric": {"name": "denim", "thicken": 30}}]},
        {"sheet": [SHEET | {"fabric": {"name": "denim", "thicken": 10}}]},
        "implausible-weight",
        'sheet "s".fabric',
        "times as much as denim",
    ),
    (
        {"rope": [ROPE | {"density": 1100}]},
        {"rope": [ROPE | {"density": 900}]},
        "implausible-weight",
        'rope "r".density',
        "chains",
    ),
    (
        {"block": [BLOCK | {"density": 45180}]},
        {"block": [BLOCK | {"density": 22500}]},
        "implausible-density",
        'block "b".density',
        "2 times",
    ),
    (
        {"block": [BLOCK | {"density": 0.1}]},
        {"block": [BLOCK | {"density": 0.2}]},
        "implausible-density",
        'block "b".density',
        "0.16",
    ),
    (
        {"particles": [{"name": "p", "fluid": LIQUID | {"density": 1}}], **SOFT},
        {"particles": [{"name": "p", "fluid": LIQUID}], **SOFT},
        "implausible-density",
        'particles "p".fluid.density',
        "less than 70",
    ),
    (
        {"block": [BLOCK | {"material": {"young": 2.4e12, "poisson": 0.3}}]},
        {"block": [BLOCK | {"material": {"young": 1.1e12, "poisson": 0.3}}]},
        "implausible-stiffness",
        'block "b".material.young',
        "2 times as stiff as diamond",
    ),
    (
        {"rope": [ROPE], "world": {"gravity": [0, 0, -980.665]}},
        {"rope": [ROPE], "world": {"gravity": [0, 0, -274]}},
        "implausible-gravity",
        "world.gravity",
        "100 times",
    ),
    (
        {"sheet": [SHEET | {"size": [210, 1]}]},
        {"sheet": [SHEET | {"size": [190, 1]}]},
        "implausible-size",
        'sheet "s".size',
        "210 m",
    ),
    (
        {"block": [BLOCK | {"size": [5e-5] * 3}]},
        {"block": [BLOCK | {"size": [2e-4] * 3}]},
        "implausible-size",
        'block "b".size',
        "5e-5",
    ),
]


FLOOR: Tree = {"collider": [{"name": "c", "shape": {"floor": {}}}]}
GAS: Tree = {"gas": [{"name": "g", "box": {"size": [1, 1, 1], "resolution": 4}}]}
WARM: Tree = {
    "heat": [
        {
            "name": "h",
            "box": {"size": [1, 1, 1], "resolution": 4},
            "conductivity": 1,
            "density": 1000,
            "heat_capacity": 1000,
            "temperature": 300,
        }
    ]
}


POINT: Tree = {"name": "p", "position": [[0, 0, 1]], "mass": [1]}
SPRAY: Tree = {"name": "e", "rate": 9, "from": {"point": {"at": [0, 0, 1]}}}
TRACERS: Tree = {"name": "t", "method": "tracers", "integrator": "rk4"}
SWIRL: Tree = {"field": [{"kind": "vortex", "center": [0, 0, 0], "axis": [0, 0, 1], "swirl": 1}]}
AIR: Tree = {"force": [{"kind": "air"}]}
MAGNET: Tree = {"force": [{"kind": "magnetic", "field": [0, 0, 1]}]}
WIRE: Tree = {"name": "wire", "shape": {"capsule": {"from": [0, -1, -1], "to": [0, 1, -1], "radius": 0.1}}}
MEETING: Tree = {"method": "position_based", "self_contact": {"thickness": 0.01}}
TIED: Tree = {"system": [{"method": "position_based", "position_based": {"tethers": 1.1}}]}
TWO: Tree = {"system": [{"name": "a"}, {"name": "b"}]}


def haired(segments: int) -> Tree:
    ball = {"name": "ball", "shape": {"sphere": {"center": [0, 0, 3], "radius": 1}}}
    return SOFT | {
        "hair": [{"name": "h", "on": "ball", "count": 1, "length": 1, "segments": segments}],
        "collider": [ball, WIRE],
    }


def ball(center: list[float]) -> Tree:
    return {"name": "ball", "shape": {"sphere": {"center": center, "radius": 1}}}


def sprung(end: list[float], rest_length: float, **words: Any) -> Tree:
    spring = {"between": [0, 1], "stiffness": 10, "rest_length": rest_length, **words}
    return {"particles": [{"name": "p", "position": [[0, 0, 1], end], "spring": [spring]}]}


def sandy(position: list[list[float]] | None = None, **system: Any) -> Tree:
    grains = {"name": "g", "radius": 0.01, "position": position or [[0, 0, 0.1]]}
    return {"grains": [grains], "system": [{"name": "main"}, {"name": "sand", "method": "grains"} | system]}


def hooked(x: float) -> Tree:
    body = {"name": "b", "shape": {"sphere": {"radius": 0.1}}}
    return {"body": [body], "joint": [{"name": "hook", "between": ["b"], "at": [x, 0, 0], "kind": {"ball": {}}}]}


def together(x: float, **words: Any) -> Tree:
    scene = anchored(1.0)
    scene["particles"][1]["position"] = [[x, 0, 0]]
    scene["anchor"][0] |= words
    return scene


def charged(charge: float, free: float = 0.0) -> Tree:
    """Two charges at one place, and one elsewhere."""
    points = {"name": "p", "position": [[0, 0, 1], [1, 0, 1], [0, 0, 1]], "charge": [1e-6, free, charge]}
    return {"particles": [points], "force": [{"kind": "electrostatics", "softening": 0.01}]}


def atoms(x: float) -> Tree:
    """Atoms of two objects."""
    points = [{"name": name, "position": [[i * x, 0, 1]]} for i, name in enumerate("ab")]
    return {"particles": points, "force": [{"kind": "lennard_jones", "epsilon": 1e-3, "sigma": 0.1}]}


def anchored(stiffness: float) -> Tree:
    ends = [{"name": name, "system": name, "position": [[i, 0, 0]], "mass": [1]} for i, name in enumerate("ab")]
    anchor = {"name": "tie", "between": ["a 0", "b 0"], "stiffness": stiffness}
    return TWO | {"particles": ends, "anchor": [anchor]}


def carried(*order: str) -> Tree:
    systems = {"t": TRACERS, "g": {"name": "g", "method": "gas"}}
    gas = GAS["gas"][0] | {"name": "air", "system": "g"}
    return {
        "system": [systems[name] for name in order],
        "particles": [POINT | {"system": "t"}],
        "gas": [gas],
        "field": [{"kind": "gas", "of": "air"}],
    }


def killed_within(radius: float) -> Tree:
    rule = {"inside": {"sphere": {"center": [0, 0, 0], "radius": radius}}}
    return {"emitter": [SPRAY | {"velocity": [0, 0, -10], "kill": [rule]}]}


VAIN: list[tuple[str, str, Tree, Tree]] = [
    # Code, place, what is doubtful, and what is not.
    ("idle-fields", "field", {"particles": [POINT], **SWIRL}, {"particles": [POINT], "system": [TRACERS], **SWIRL}),
    (
        "idle-tracers",
        "",
        {"particles": [POINT], "system": [TRACERS]},
        {"particles": [POINT], "system": [TRACERS], **SWIRL},
    ),
    (
        "unfelt",
        'collider "wire".edges',
        {"sheet": [SHEET], "collider": [WIRE | {"edges": True}]},
        {"sheet": [SHEET], "collider": [WIRE | {"edges": True}], "system": [MEETING]},
    ),
    (
        "unfelt",
        "collider",
        {"particles": [POINT], "system": [TRACERS], **SWIRL, **FLOOR},
        {"particles": [POINT], **FLOOR},
    ),
    ("no-surface", "force[0]", {"particles": [POINT], **AIR}, {"sheet": [SHEET], **AIR}),
    ("no-charge", "force[0]", {"particles": [POINT], **MAGNET}, {"particles": [POINT | {"charge": [1]}], **MAGNET}),
    (
        "no-collider",
        'emitter "e".kill[0]',
        {"emitter": [SPRAY | {"kill": [{"near_collider": 0.1}]}]},
        {"emitter": [SPRAY | {"kill": [{"near_collider": 0.1}]}], **FLOOR},
    ),
    ("no-births", 'emitter "e"', {"emitter": [SPRAY | {"start": 60}]}, {"emitter": [SPRAY]}),
    (
        "no-such-frame",
        "output.stills",
        {"particles": [POINT], "time": {"frames": 2}, "output": {"stills": [3]}},
        {"particles": [POINT], "time": {"frames": 2}, "output": {"stills": [2]}},
    ),
    ("thin-region", 'emitter "e".kill[0].inside', killed_within(0.1), killed_within(1.0)),
    (
        "thin-collider",
        'collider "wire"',
        {"sheet": [SHEET], "collider": [WIRE]},
        {"sheet": [SHEET], "collider": [WIRE | {"edges": True}], "system": [MEETING]},
    ),
    (
        "thin-collider",
        'collider "wire"',
        {"rope": [ROPE | {"segments": 8, "length": 2}], "collider": [WIRE]},
        {"rope": [ROPE | {"segments": 8}], "collider": [WIRE]},
    ),
    ("thin-collider", 'collider "wire"', haired(2), haired(8)),
    (
        "unfelt",
        'system "main".position_based.tethers',
        {"rope": [ROPE], **TIED},
        {"rope": [ROPE | {"pin": ["start"]}], **TIED},
    ),
    ("late-carrier", 'system "t"', carried("t", "g"), carried("g", "t")),
    (
        "starts-inside",
        '"p"',
        {"particles": [POINT | {"position": [[0, 0, -1]]}], **FLOOR},
        {"particles": [POINT], **FLOOR},
    ),
    ("stiff-anchor", 'anchor "tie"', anchored(1e6), anchored(1.0)),
    ("round-off", '"s"', {"sheet": [SHEET | {"center": [4e4, 0, 1]}]}, {"sheet": [SHEET | {"center": [100, 0, 1]}]}),
    (
        "round-off",
        'collider "ball"',
        {"particles": [POINT], "collider": [ball([0, 9e5, 0])]},
        {"particles": [POINT], "collider": [ball([0, 0, -9])]},
    ),
    ("stiff-contact", 'system "sand".step', sandy(step=1e-2), sandy(step=1e-4)),
    ("starts-inside", 'system "sand"', sandy([[0, 0, 0.1], [0, 0, 0.11]]), sandy([[0, 0, 0.1], [0, 0, 0.13]])),
    ("unfelt", "grains", sandy() | {"particles": [POINT]}, sandy()),
    ("far-joint", 'joint "hook"', hooked(40.0), hooked(0.4)),
    ("coincident", 'anchor "tie"', together(0.0, rest_length=1), together(0.5, rest_length=1)),
    ("coincident", '"p"', sprung([0, 0, 1], 0.3), sprung([0, 0, 1.1], 0.3)),
    ("coincident", '"p"', sprung([0, 0, 1], 0.3, hardening=2), sprung([0, 1, 1], 0.3, hardening=2)),
    ("coincident", "force[0]", charged(1e-6), charged(0.0, free=1e-6)),
    ("coincident", "force[0]", atoms(0.0), atoms(1.0)),
]


@pytest.mark.parametrize(("code", "path", "vain", "heeded"), VAIN, ids=[row[0] for row in VAIN])
def test_what_a_scene_says_in_vain_is_told(code: str, path: str, vain: Tree, heeded: Tree) -> None:
    def told(words: Tree) -> list[tuple[str, str]]:
        return [(warning["code"], warning["path"]) for warning in World({"version": 1} | words).warnings]

    assert told(vain) == [(code, path)]
    assert told(heeded) == []


def test_systems_that_do_not_agree_are_told_once() -> None:
    def told(coupling: Tree) -> list[tuple[str, str]]:
        words = anchored(1e3)
        words["system"] = [system | {"substeps": 50} for system in words["system"]]
        words["particles"][0]["velocity"] = [[1, 0, 0]]
        world = World({"version": 1, "world": {"coupling": coupling}} | words)
        report = world.step(4)
        assert report["passes"] >= 8 and report["disagreement"] is not None, report
        return [(warning["code"], warning["path"]) for warning in world.warnings]

    ((code, path),) = told({"iterations": 2, "tolerance": 1e-9})
    assert code == "disagreement" and path.startswith("system "), path
    assert told({"iterations": 100, "tolerance": 1e-3}) == []


@pytest.mark.parametrize(
    ("word", "idle", "used"),
    [
        ("max_stretch", GAS, {"rope": [ROPE]}),
        ("max_penetration", {"rope": [ROPE]}, {"rope": [ROPE], **FLOOR}),
        ("max_intersections", {"rope": [ROPE]}, {"sheet": [SHEET]}),
        (
            "max_intersections",
            {"rope": [ROPE]},
            {"rope": [ROPE], "collider": [WIRE | {"edges": True}], "system": [MEETING]},
        ),
        ("max_volume_error", {"sheet": [SHEET]}, {"block": [BLOCK]}),
        ("max_divergence", {"rope": [ROPE]}, GAS),
        ("max_heat_error", GAS, WARM),
    ],
)
def test_bounds_on_what_nothing_measures_are_errors(word: str, idle: Tree, used: Tree) -> None:
    with pytest.raises(SceneError, match=f"{word} bounds nothing here") as caught:
        World({"version": 1, "expect": {word: 1}} | idle)
    assert [issue["path"] for issue in caught.value.issues] == [f"expect.{word}"]
    assert World({"version": 1, "expect": {word: 1}} | used).warnings == []


@pytest.mark.parametrize(("doubtful", "fine", "code", "path", "figure"), DOUBTS)
def test_figures_unlike_anything_real_are_told(doubtful: Tree, fine: Tree, code: str, path: str, figure: str) -> None:
    def told(words: Tree) -> list[dict[str, Any]]:
        return World({"version": 1} | words).warnings

    (warning,) = told(doubtful)
    assert (warning["code"], warning["path"]) == (code, path) and figure in warning["message"], warning
    assert told(fine) == []


def test_a_mesh_in_millimetres_is_told(tmp_path: Path) -> None:
    (tmp_path / "body.obj").write_text(
        "v 0 0 0\nv 1700 0 0\nv 0 300 0\nv 0 0 200\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    )

    def told(scale: float) -> list[tuple[str, str]]:
        mesh = {"path": str(tmp_path / "body.obj"), "scale": scale}
        things = {"net": [{"name": "n", "mesh": mesh}], "collider": [{"name": "c", "shape": {"mesh": mesh}}]}
        return [
            (w["code"], w["path"]) for w in World({"version": 1} | things).warnings if w["code"] == "implausible-size"
        ]

    assert told(1.0) == [("implausible-size", 'net "n".mesh'), ("implausible-size", 'collider "c".shape.mesh')]
    assert told(0.001) == []


def test_convex_parts_that_fill_more_than_their_mesh_are_told(tmp_path: Path) -> None:
    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]
    corners = [f"v {x} {y} {z}" for z in (0, 1) for x, y in outline]
    lids = [f"f {a} {c} {b}\nf {a + 6} {b + 6} {c + 6}" for a, b, c in ((1, 2, 3), (1, 3, 4), (1, 4, 6), (4, 5, 6))]
    sides = [f"f {i + 1} {(i + 1) % 6 + 1} {(i + 1) % 6 + 7} {i + 7}" for i in range(6)]
    (tmp_path / "l.obj").write_text("\n".join(corners + lids + sides))

    def told(most: int) -> list[tuple[str, str]]:
        concave = {"mesh": {"path": str(tmp_path / "l.obj")}, "most": most}
        scene = {"version": 1, "body": [{"name": "l", "shape": {"concave": concave}}]}
        return [(w["code"], w["path"]) for w in World(scene).warnings]

    # The hull of an L exceeds it by a quarter; two boxes are it.
    assert told(1) == [("coarse-parts", 'body "l".shape')]
    assert told(2) == []
