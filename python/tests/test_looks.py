"""How objects are drawn, as the engine says it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Run, Scene, SceneError, World, looks
from tumble.columns import KINDS
from tumble.pictures.drawn import Tubes
from tumble.pictures.things import Stage, objects
from tumble.run import simulate
from tumble.style import PALETTE, rgb

ROOT = Path(__file__).parents[1] / "tumble" / "scenes"
SCENES = sorted(ROOT.rglob("*.toml"))

NEEDED = {
    "points": set(),
    "curve": {"curve"},
    "strands": {"curve", "curve_points"},
    "surface": {"triangles"},
    "body": {"triangles"},
    "instances": {"vertices", "triangles", "mass"},
    "solid": {"position", "triangles"},
    "container": {"position", "triangles"},
    "liquid": set(),
    "ground": {"position", "triangles"},
    "image": {"grid_cells"},
    "smoke": {"grid_cells"},
}
"""Columns that do not change, of which forms are drawn."""


def words(**more: Any) -> dict[str, Any]:
    return {"version": 1, "time": {"fps": 10, "frames": 1}} | more


@pytest.mark.parametrize("path", SCENES, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_each_object_of_a_scene_has_a_look(path: Path) -> None:
    scene = Scene.load(path).to_dict()
    things = [thing for kind in KINDS for thing in scene.get(kind) or ()]
    # What breaks is seen as its pieces.
    pieces = {thing["name"]: (thing.get("fracture") or {}).get("pieces") for thing in things}
    names = [
        n for name, count in pieces.items() for n in ([f"{name}.{k + 1}" for k in range(count)] if count else [name])
    ]
    names += [f"{t['name']}.{kind}" for t in things if t.get("whitewater") for kind in ("spray", "foam", "bubbles")]
    # Of a liquid the surface is seen.
    shown = [look.object.removesuffix(".surface") for look in looks.of(scene).objects]
    assert sorted(shown) == sorted(names)


def test_forms_have_the_columns_that_they_are_drawn_of() -> None:
    seen = set()
    for name in (
        "drape/sheet-on-ball",
        "structures/blocks",
        "structures/rope",
        "gas/ball_in_a_tank",
        "heat/finned_plate",
    ):
        world = World(Scene.load(ROOT / f"{name}.toml"))
        for look in looks.of(world.scene.to_dict()).objects:
            seen.add(look.form)
            assert NEEDED[look.form] <= set(world.topology.get(look.object, {}))
    assert set(NEEDED) == set(looks.FORMS)
    assert len(seen) > 4


def test_colours_of_objects_are_those_of_plots() -> None:
    n = len(PALETTE) + 1
    scene = words(particles=[{"name": f"p{k}", "position": [[k, 0, 0]]} for k in range(n)])
    found = [look.color for look in looks.of(scene).objects]
    np.testing.assert_allclose(found, [rgb(PALETTE[k % len(PALETTE)]) for k in range(n)], rtol=1e-14)


def test_a_run_says_how_its_objects_are_drawn(tmp_path: Path) -> None:
    ends = ["p 0", "q 0"]
    scene = words(
        particles=[
            {"name": "p", "position": [[0, 0, 0]], "radius": 0.3, "color": [0.1, 0.2, 0.3], "trail": 1.0},
            {"name": "q", "position": [[1, 0, 0]]},
        ],
        anchor=[
            {"name": "slack", "between": ends, "stiffness": 0},
            {"name": "pulling", "between": ends[::-1], "stiffness": 1},
        ],
        collider=[{"name": "floor", "shape": {"plane": {"normal": [0, 0, 3], "point": [0, 0, -9]}}}],
    )
    run = simulate(scene, tmp_path / "run")
    p, q, floor = run.looks.objects
    assert (p.form, p.radius, p.color, p.trail, p.few) == ("points", 0.3, (0.1, 0.2, 0.3), 1.0, True)
    assert (q.object, floor.form, floor.plane) == ("q", "ground", ((0.0, 0.0, -9.0), (0.0, 0.0, 1.0)))
    assert [thing.name for thing in objects(run)] == ["p", "q", "floor"]
    # One without stiffness and damping does nothing, and is not drawn.
    assert run.looks.anchors == ((("q", 0), ("p", 0)),)
    (tube,) = (t for t in Stage(run).things(0) if isinstance(t, Tubes) and t.name == "anchors")
    np.testing.assert_allclose(tube.points, [[1, 0, 0], [0, 0, 0]])


def test_words_of_another_version_are_told(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="partikles"):
        looks.of(words(partikles=[]))
    run = simulate(Scene(words(particles=[{"name": "p", "position": [[0, 0, 0]]}])), tmp_path / "run")
    run.manifest["tumble"] = "0.0.1"
    run.manifest["scene"]["expect"] = {"max_oddness": 1}
    assert run.looks.objects[0].object == "p"
    old = Run(tmp_path / "run")
    old.manifest["tumble"] = "0.0.1"
    old.manifest["scene"]["partikles"] = []
    with pytest.raises(SceneError, match=r"a run of tumble 0\.0\.1, whose scene this version cannot read .*partikles"):
        _ = old.looks
