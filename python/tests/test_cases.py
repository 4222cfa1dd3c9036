"""What people report of other programs: small inputs, each with the value that is right."""

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tumble
from tumble import Scene, World, emitters, energy

Tree = dict[str, Any]


def plate(folder: Path) -> str:
    """A unit square of four quadrangles at z = 0."""
    places = [f"v {0.5 * x} {0.5 * y} 0" for y in range(3) for x in range(3)]
    faces = ["f 1 2 5 4", "f 2 3 6 5", "f 4 5 8 7", "f 5 6 9 8"]
    (folder / "plate.obj").write_text("\n".join(places + faces) + "\n")
    return "plate.obj"


def balloon(folder: Path) -> str:
    """A closed surface whose vertices lie unevenly: circles of latitude that crowd on one side."""
    rings, around = 7, 12
    lines = ["v 0 0 0.3", "v 0 0 -0.3"]
    for i in range(1, rings):
        polar = math.pi * (i / rings) ** 1.3
        for k in range(around):
            turn = 2 * math.pi * (k / around + 0.07 * math.sin(2 * math.pi * k / around))
            at = (math.sin(polar) * math.cos(turn), math.sin(polar) * math.sin(turn), math.cos(polar))
            lines.append("v {:.6f} {:.6f} {:.6f}".format(*(0.3 * x for x in at)))
    row = [[3 + (i - 1) * around + k % around for k in range(around + 1)] for i in range(1, rings)]
    for k in range(around):
        lines += [f"f 1 {row[0][k]} {row[0][k + 1]}", f"f 2 {row[-1][k + 1]} {row[-1][k]}"]
        for a, b in pairwise(row):
            lines += [f"f {a[k]} {b[k]} {b[k + 1]}", f"f {a[k]} {b[k + 1]} {a[k + 1]}"]
    (folder / "balloon.obj").write_text("\n".join(lines) + "\n")
    return "balloon.obj"


@pytest.mark.parametrize("precision", ["single", "double"])
def test_masses_over_a_plate_of_no_thickness_rest_on_it(tmp_path: Path, precision: str) -> None:
    """From 4,001 heights, above nodes of the distance grid and between them."""
    heights = np.linspace(0.011, 0.3, 4001)
    shape = {"mesh": {"path": plate(tmp_path), "shell": True}}
    tree = {
        "version": 1,
        "precision": precision,
        "time": {"frames": 12},
        "particles": [{"name": "drops", "position": [[0.3, 0.41, float(z)] for z in heights]}],
        "collider": [{"name": "plate", "thickness": 0.01, "shape": shape}],
    }
    world = World(Scene(tree, tmp_path))
    world.step(12)
    z = world.frame["drops"]["position"][:, 2]
    assert np.abs(z - 0.01).max() < 1e-5
    assert world.ledger["penetration"] < 1e-6


def test_cloth_over_a_plate_lies_on_it(tmp_path: Path) -> None:
    shape = {"mesh": {"path": plate(tmp_path), "shell": True}}
    sheet = {"name": "s", "size": [0.6, 0.6], "resolution": [25, 25], "center": [0.5, 0.5, 0.2], "rotate": [3, 2, 0]}
    tree = {
        "version": 1,
        "system": [{"method": "position_based"}],
        "sheet": [sheet],
        "collider": [{"name": "plate", "thickness": 0.01, "shape": shape}],
    }
    world = World(Scene(tree, tmp_path))
    world.step(24)
    x = world.frame["s"]["position"]
    assert x[:, 2].min() > 0.0099 and x[:, 2].max() < 0.1


@pytest.mark.parametrize("substeps", [20, 80])
@pytest.mark.parametrize(
    "words",
    [{"links": {"structural": 200.0}, "pressure": {"volume": 1.5, "stiffness": 1000}}, {"membrane": {"warp": 200}}],
)
def test_a_balloon_that_nobody_touches_does_not_turn(tmp_path: Path, words: Tree, substeps: int) -> None:
    net = {"name": "n", "mesh": {"path": balloon(tmp_path)}, "pressure": {"volume": 1.5}, **words}
    tree = {
        "version": 1,
        "world": {"gravity": [0, 0, 0]},
        "system": [{"method": "position_based", "substeps": substeps}],
        "net": [net],
    }
    world = World(Scene(tree, tmp_path))
    moved, turned = 0.0, 0.0
    for _ in range(72):
        world.step()
        ledger = world.ledger
        moved = max(moved, ledger["speed"])
        turned = max(turned, math.hypot(*ledger["angular_momentum"]))
    # Round-off of single precision; where bodies do not keep their momenta it is 0.015 to 0.2.
    assert moved > 0.1 and turned < 2e-6, (moved, turned)


def test_inflation_is_told_as_a_source_of_energy(tmp_path: Path) -> None:
    net = {"name": "n", "mesh": {"path": balloon(tmp_path)}, "membrane": {"warp": 200}, "pressure": {"volume": 1.5}}
    scene = Scene({"version": 1, "system": [{"method": "position_based"}], "net": [net]}, tmp_path)
    assert energy.sources(scene.to_dict()) == ["net n"]


def test_births_of_a_rate_in_steps_are_counted() -> None:
    """96 a second for half a second, nothing for half a second, 48 a second for one."""
    rate = {"keys": [[0, 96], [0.5, 0], [1.0, 48]], "interpolation": "step"}
    tap = {"name": "tap", "from": {"point": {"at": [0, 0, 1]}}, "rate": rate}
    scene = Scene({"version": 1, "time": {"frames": 48}, "emitter": [tap]})
    assert emitters.forecast(scene.to_dict())[0].total == 96
    world = World(scene)
    world.step(48)
    assert len(world.frame["tap"]["id"]) == 96


def test_a_map_s_coordinates_are_refused_in_single_precision(tmp_path: Path) -> None:
    sheet = {"name": "tarp", "size": [4, 4], "resolution": [21, 21], "center": [431255.0, 5411805.0, 314.0]}
    with pytest.raises(tumble.SceneError, match=r'sheet "tarp".* to 0\.323 m.*take precision = "double"'):
        World({"version": 1, "sheet": [sheet]})
    far, near = (
        World({"version": 1, "precision": "double", "sheet": [sheet | {"center": center}]})
        for center in (sheet["center"], [0, 0, 314])
    )
    for world in (far, near):
        world.step(5)
    moved = far.frame["tarp"]["position"] - near.frame["tarp"]["position"]
    assert np.abs(moved - [431255.0, 5411805.0, 0.0]).max() < 1e-6


BOX: Tree = {"size": [1, 1, 1], "resolution": 8}
SOFT_MATTER: Tree = {"young": 1e5, "poisson": 0.3}
BAR: Tree = {"name": "b", "box": BOX, "conductivity": 400, "density": 8960, "heat_capacity": 385, "temperature": 300}


def gas(**words: Any) -> Tree:
    return {"gas": [{"name": "g", "box": BOX, **words}]}


def liquid(**words: Any) -> Tree:
    return {"compressible": [{"name": "c", "box": BOX, "sound_speed": 10, "density": 1, **words}]}


@pytest.mark.parametrize(
    ("scene", "refused", "taken"),
    [
        (lambda f: {"heat": [BAR | {"temperature": f}]}, "300 + t", "300 + x"),
        (
            lambda f: {"heat": [BAR | {"region": [{"shape": {"sphere": {"radius": 0.3}}, "temperature": f}]}]},
            "t*x",
            "x",
        ),
        (lambda f: {"heat": [BAR | {"source": [{"power": 5, "profile": f}]}]}, "exp(-t)", "exp(-x)"),
        (lambda f: gas(velocity=[f, 0, 0]), "sin(t)", "sin(x)"),
        (lambda f: gas(velocity=f), {"keys": [[0, 0, 0, 0], [1, 1, 0, 0]]}, [1, 0, 0]),
        (lambda f: gas(smoke={"initial": f}), "t", "0.1"),
        (lambda f: gas(temperature={"initial": f}), "300 + 10*t", "300 + 10*y"),
        (lambda f: liquid(initial_density=f), "1 + t", "1 + 0.1*x"),
        (lambda f: liquid(velocity=f), "[t, 0, 0]", "[x, 0, 0]"),
    ],
)
def test_time_at_the_start_is_refused(scene: Callable[[Any], Tree], refused: Any, taken: Any) -> None:
    with pytest.raises(tumble.SceneError, match="no meaning in a value that does not change; give"):
        World({"version": 1, **scene(refused)})
    World({"version": 1, **scene(taken)})


@pytest.mark.parametrize(
    "thing",
    [
        {"rope": [{"name": "o", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 8}]},
        {
            "rope": [
                {"name": "o", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 8, "rod": {"stretch": 500, "bend": 0.01}}
            ]
        },
        {"sheet": [{"name": "o", "size": [1, 1], "resolution": [5, 5]}]},
        {"block": [{"name": "o", "size": [1, 1, 1], "resolution": [3, 3, 3], "material": SOFT_MATTER}]},
        {"net": [{"name": "o", "mesh": {"path": "plate.obj"}}]},
        {
            "cloth": [
                {"name": "o", "panels": [{"name": "p", "outline": [[0, 0], [1, 0], [1, 1], [0, 1]]}], "resolution": 0.2}
            ]
        },
    ],
    ids=["rope", "rod", "sheet", "block", "net", "cloth"],
)
@pytest.mark.parametrize("integrator", ["velocity_verlet", "position_based"])
def test_things_can_be_thrown(tmp_path: Path, thing: Tree, integrator: str) -> None:
    plate(tmp_path)
    ((kind, [words]),) = thing.items()
    velocity = [1.5, -0.5, 2.0]
    tree = {"version": 1, "world": {"gravity": [0, 0, 0]}, "system": [{"integrator": integrator}]}
    world = World(Scene(tree | {kind: [words | {"velocity": velocity}]}, tmp_path))
    start = world.frame["o"]["position"]
    assert np.allclose(world.ledger["momentum"], world.ledger["mass"] * np.array(velocity), rtol=1e-5)
    world.step(12)
    # Half a second: all of it flies, and nothing else happens to it.
    assert np.abs(world.frame["o"]["position"] - start - 0.5 * np.array(velocity)).max() < 1e-4


def test_what_is_held_is_not_thrown() -> None:
    rope = {"name": "o", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 8, "velocity": [0, 0, 2], "pin": ["start"]}
    world = World({"version": 1, "rope": [rope]})
    world.step(3)
    x = world.frame["o"]["position"]
    assert np.array_equal(x[0], [0, 0, 0]) and x[-1][2] > 0.1


ROOM = {
    "version": 1,
    "dimension": 2,
    "time": {"frames": 48},
    "system": [{"method": "gas"}],
    "gas": [
        {
            "name": "room",
            "box": {"size": [2, 1, 1], "center": [0, 0, 0.5], "resolution": 64},
            "smoke": {"weight": 0},
            "source": [
                {
                    "shape": {"box": {"center": [-0.7, 0, 0.3], "size": [0.2, 1, 0.2]}},
                    "density": 1,
                    "velocity": [3, 0, 0],
                }
            ],
        }
    ],
}


@pytest.mark.parametrize(
    "wall",
    [
        {"center": [0.0, 0, 0.5], "size": [0.01, 2, 1.2]},
        {"center": [0.01, 0, 0.5], "size": [0.02, 2, 1.6], "rotate": [0, 30, 0]},
        {"center": [-0.1, 0, 0.5], "size": [0.003, 2, 1.6], "rotate": [0, -17, 0]},
    ],
)
def test_a_wall_thinner_than_a_cell_blocks_a_gas(wall: Tree) -> None:
    world = World(Scene({**ROOM, "collider": [{"name": "wall", "shape": {"box": wall}}]}))
    world.step(48)
    smoke = world.frame["room"]["density"]
    x, z = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, (np.arange(32) + 0.5) / 32 - 0.5, indexing="ij")
    lean = math.radians(wall.get("rotate", [0, 0, 0])[1])
    beyond = (x - wall["center"][0]) * math.cos(lean) - z * math.sin(lean) > 2 / 32
    assert smoke[~beyond].max() > 0.5
    assert smoke[beyond].max() < 1e-12


@pytest.mark.parametrize(("stop", "rate"), [(0.5, 2.0), (1.25, 0.8)])
def test_a_source_of_a_gas_works_as_its_keys_say(stop: float, rate: float) -> None:
    """The smoke that is there when the source has stopped: rate x time x its part of the room, and not more later."""
    room = ROOM["gas"][0]  # type: ignore[index]
    words = {"shape": room["source"][0]["shape"], "smoke": {"keys": [[0, rate], [stop, 0]], "interpolation": "step"}}
    world = World(Scene({**ROOM, "gas": [{**room, "source": [words]}]}))
    world.step(48)
    assert world.ledger["mass"] == pytest.approx(rate * stop * 0.2 * 0.2, rel=0.02)


def test_pins_let_go_when_their_time_is_over() -> None:
    tree = {
        "version": 1,
        "time": {"frames": 48},
        "sheet": [
            {"name": "curtain", "size": [1, 1], "resolution": [10, 10], "pin": [{"which": "edge y+", "until": 1.0}]}
        ],
    }
    world = World(Scene(tree))
    world.step(24)
    edge = world.frame["curtain"]["position"][-10:, 2]
    assert np.ptp(edge) == 0
    world.step(24)
    fallen = edge - world.frame["curtain"]["position"][-10:, 2]
    # The cloth below pulls the edge down with it: faster than a stone at first.
    assert fallen.min() > 0.5 * 9.8 / 2
    assert fallen.max() < 1.5 * 9.8


def test_a_balloon_is_blown_up_over_time(tmp_path: Path) -> None:
    tree = {
        "version": 1,
        "world": {"gravity": [0, 0, 0]},
        "time": {"frames": 48},
        "system": [{"method": "position_based", "substeps": 20}],
        "net": [
            {
                "name": "balloon",
                "mesh": {"path": balloon(tmp_path)},
                "links": {"structural": {"modulus": 10}},
                "pressure": {"volume": {"keys": [[0, 1], [1, 2]]}},
            }
        ],
    }
    world = World(Scene(tree, tmp_path))
    before = world.ledger["volume"]
    volumes = []
    for _ in range(4):
        world.step(12)
        volumes.append(world.ledger["volume"] / before)
    assert volumes == pytest.approx([1.5, 2.0, 2.0, 2.0], rel=2e-3)
    with pytest.raises(tumble.SceneError, match=r"pressure.volume: 0 at t = 1 s, expected a number above 0"):
        World(
            Scene({**tree, "net": [{**tree["net"][0], "pressure": {"volume": {"keys": [[0, 1], [1, 0]]}}}]}, tmp_path)
        )  # type: ignore[index,dict-item]


@pytest.mark.parametrize(
    ("path", "tree"),
    [
        (
            'collider "c".restitution',
            {"collider": [{"name": "c", "shape": {"sphere": {"radius": 1}}, "restitution": "0.5*t"}]},
        ),
        (
            r'rope "r".velocity\[2\]',
            {"rope": [{"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 2, "velocity": [0, 0, "-9*t"]}]},
        ),
        (
            'rope "r".density',
            {"rope": [{"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 2, "density": {"keys": [[0, 1]]}}]},
        ),
        ("camera.resolution", {"camera": {"resolution": {"keys": [[0, 640, 480], [1, 320, 240]]}}}),
    ],
)
def test_a_word_that_cannot_be_animated_says_so(path: str, tree: Tree) -> None:
    with pytest.raises(tumble.SceneError, match=rf"{path}: .*; it does not change in time"):
        World(Scene({"version": 1, "particles": [{"name": "p", "position": [[0, 0, 0]]}], **tree}))


CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
FACES = "0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5"


def box_prim(name: str, edges: tuple[float, float, float], words: str = "") -> str:
    points = ", ".join(f"({x * edges[0]!r}, {y * edges[1]!r}, {z * edges[2]!r})" for x, y, z in CORNERS)
    lines = ["int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]", f"int[] faceVertexIndices = [{FACES}]"]
    return f'def Mesh "{name}" {{\n{words}\n' + "\n".join([*lines, f"point3f[] points = [{points}]"]) + "\n}\n"


@pytest.mark.parametrize(
    ("unit", "up", "edges"),
    [
        (0.01, "Y", (40.0, 210.0, 25.0)),
        (0.0254, "Z", (0.4 / 0.0254, 0.25 / 0.0254, 2.1 / 0.0254)),
        (0.3048, "Y", (0.4 / 0.3048, 2.1 / 0.3048, 0.25 / 0.3048)),
        (1.0, "Z", (0.4, 0.25, 2.1)),
    ],
)
@pytest.mark.filterwarnings("ignore::tumble.usd.UsdWarning")
def test_pillars_of_usd_files_stand_in_metres(
    tmp_path: Path, unit: float, up: str, edges: tuple[float, float, float]
) -> None:
    """Of 0.4 x 0.25 x 2.1 m, beside a box that is not to be seen; what falls on it lies on it."""
    pytest.importorskip("pxr")
    head = f'#usda 1.0\n(\nmetersPerUnit = {unit}\nupAxis = "{up}"\n)\n'
    hidden = box_prim("old", (9e3, 9e3, 9e3), 'token visibility = "invisible"')
    (tmp_path / "pillar.usda").write_text(f'{head}def Xform "root" {{\n{box_prim("pillar", edges)}{hidden}}}\n')
    vertices, _ = tumble.load_mesh(tmp_path / "pillar.usda")
    assert len(vertices) == 8 and np.allclose(np.ptp(vertices, axis=0), [0.4, 0.25, 2.1], atol=1e-6)
    assert vertices[:, 2].min() > -1e-9
    x, y, _ = vertices.mean(axis=0).tolist()
    tree = {
        "version": 1,
        "particles": [{"name": "drop", "position": [[x, y, 2.2]]}],
        "collider": [{"name": "pillar", "shape": {"mesh": {"path": "pillar.usda"}}}],
    }
    world = World(Scene(tree, tmp_path))
    world.step(24)
    assert abs(world.frame["drop"]["position"][0, 2] - 2.1) < 1e-3


def test_a_word_that_is_no_formula_is_told_as_what_it_is() -> None:
    for tree in (
        {"sheet": [{"name": "s", "size": "big", "resolution": [3, 3]}]},
        {"rope": [{"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 3, "density": "heavy"}]},
    ):
        with pytest.raises(tumble.SceneError) as raised:
            World(Scene({"version": 1, **tree}))
        assert "change in time" not in str(raised.value)
