"""Drawings of plans read, checked and mended: against ezdxf, which writes DXF, and shapely, which knows what meets."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_bottlenecks import WALLS, tree
from typer.testing import CliRunner

from tumble import Scene, SceneError, _engine
from tumble.bottlenecks import check, files, measures, paths, study
from tumble.bottlenecks.files import Reading
from tumble.cli import application


def geojson() -> dict[str, Any]:
    def feature(kind: str, form: str, points: Any, **words: Any) -> dict[str, Any]:
        return {
            "type": "Feature",
            "properties": {"kind": kind, **words},
            "geometry": {"type": form, "coordinates": points},
        }

    area = [[0.5, 0.5], [5, 0.5], [5, 3.5], [0.5, 3.5], [0.5, 0.5]]
    features = [
        *(feature("wall", "LineString", wall) for wall in WALLS),
        feature("door", "LineString", [[6, 1.6], [6, 2.4]], name="door"),
        feature("exit", "LineString", [[9, 1], [9, 3]], name="out"),
        feature("start", "Polygon", [area], name="people", count=20),
    ]
    return {"type": "FeatureCollection", "features": features}


SVG = """<svg xmlns="http://www.w3.org/2000/svg">
<g id="walls"><path d="M600 -240 V-400 H0 V0 h600 v-160"/><polyline points="600,-400 900,-400 900,-300"/>
<path d="m 600 0 h 300 v -100"/></g>
<line class="door" x1="600" y1="-160" x2="600" y2="-240" data-name="door"/>
<line class="exit" x1="900" y1="-100" x2="900" y2="-300" data-name="out"/>
<polygon class="start" points="50,-50 500,-50 500,-350 50,-350" data-name="people"/></svg>"""


def words(path: Path, **said: Any) -> dict[str, Any]:
    return files.scene(path, Reading(**said))


def test_drawings_give_the_scene_that_they_show(tmp_path: Path) -> None:
    (tmp_path / "a.geojson").write_text(json.dumps(geojson()))
    (tmp_path / "a.svg").write_text(SVG)
    expected = study(Scene(tree(20)), seeds=1)
    for name, scale in (("a.geojson", 1.0), ("a.svg", 0.01)):
        found = study(Scene(words(tmp_path / name, scale=scale, people=20)), seeds=1)
        for a, b in zip(found.rows, expected.rows, strict=True):
            assert (a.gate, a.crossed) == (b.gate, b.crossed) and a.width == pytest.approx(b.width)
        # The same room with the same people: what differs is round-off, which changes who goes first.
        assert found.rows[0].lost.mean == pytest.approx(expected.rows[0].lost.mean, rel=0.3)


def drawn(folder: Path, wrong: str = "") -> Path:
    """The rooms of `tree` in millimetres as an office draws them: the door a block with leaf and swing, turned and scaled."""
    import ezdxf
    from ezdxf import units

    paper = ezdxf.new("R2010", setup=True)
    paper.units = 0 if wrong == "units" else units.MM
    space = paper.modelspace()
    layer = (lambda name: "0") if wrong == "layers" else (lambda name: name)
    for wall in WALLS:
        space.add_lwpolyline([(1000 * x, 1000 * y) for x, y in wall], dxfattribs={"layer": layer("A-WALL")})
    leaf = paper.blocks.new("LEAF", base_point=(1, 1))
    leaf.add_line((1, 1), (1, 2))
    leaf.add_arc((1, 1), 1, 0, 90)
    place = {"layer": layer("Türen"), "xscale": 800, "yscale": 800, "rotation": 90}
    space.add_blockref("LEAF", (6000, 1600), dxfattribs=place)
    space.add_line((9000, 1000), (9000, 3000), dxfattribs={"layer": layer("Notausgang")})
    area = [(500, 500), (5000, 500), (5000, 3500), (500, 3500)]
    space.add_lwpolyline(area, close=True, dxfattribs={"layer": layer("start")})
    space.add_text("OFFICE", dxfattribs={"layer": layer("A-ANNO")})
    path = folder / f"plan{wrong}.dxf"
    paper.saveas(path)
    return path


def test_a_dxf_of_an_office_is_the_plan_that_it_shows(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    found = words(drawn(tmp_path), people=20)
    (plan,), (crowd,) = found["plan"], found["crowd"]
    assert plan["scale"] == 0.001 and crowd["count"] == 20
    assert [[[x / 1000, y / 1000] for x, y in wall] for wall in plan["walls"]] == WALLS
    (door,), (out,) = plan["door"], plan["exit"]
    ends = sorted([door["from"], door["to"]], key=lambda p: p[1])
    assert ends == [pytest.approx([6000, 1600]), pytest.approx([6000, 2400])]
    assert [list(out["from"]), list(out["to"])] == [[9000, 1000], [9000, 3000]]
    assert not check.faults(Scene(found))


def test_blocks_arcs_and_curves_are_where_ezdxf_has_them(tmp_path: Path) -> None:
    """Nested blocks with mirrors, rows and rotations; bulges, ellipses and splines."""
    ezdxf = pytest.importorskip("ezdxf")
    shapely = pytest.importorskip("shapely")
    from ezdxf import path as paths
    from ezdxf.disassemble import recursive_decompose

    paper = ezdxf.new("R2010")
    paper.units = 6
    inner, outer = paper.blocks.new("INNER", base_point=(0.5, 0.2)), paper.blocks.new("OUTER")
    inner.add_lwpolyline([(0, 0, 0.4), (2, 0, -1), (2, 1, 0), (0, 1, 0.2)], format="xyb", close=True)
    inner.add_arc((1, 1), 0.7, 200, 20)
    outer.add_blockref("INNER", (1, 2), dxfattribs={"xscale": -1.5, "yscale": 1.5, "rotation": 30})
    outer.add_ellipse((3, 3), (2, 1), 0.4, 0.3, 4.0)
    space = paper.modelspace()
    at = {"layer": "wall", "xscale": 2, "yscale": 2, "rotation": -70, "column_count": 2, "row_count": 2}
    space.add_blockref("OUTER", (10, 5), dxfattribs=at | {"column_spacing": 20, "row_spacing": 15})
    space.add_circle((30, 30), 4, dxfattribs={"layer": "wall"})
    space.add_arc((40, 0), 3, 10, 120, dxfattribs={"layer": "wall", "extrusion": (0, 0, -1)})
    space.add_open_spline([(0, 40), (5, 50), (12, 38), (20, 45), (22, 60)], dxfattribs={"layer": "wall"})
    space.add_polyline2d([(0, 70, 0.5), (5, 70, 0)], format="xyb", dxfattribs={"layer": "wall"})
    paper.saveas(tmp_path / "a.dxf")
    ours = shapely.MultiLineString(_engine.plan(tmp_path / "a.dxf", "dxf")["walls"])
    pieces = [
        paths.make_path(one) for one in recursive_decompose(space) if one.dxf.layer == "wall" or one.dxf.layer == "0"
    ]
    theirs = shapely.MultiLineString([[(p.x, p.y) for p in piece.flattening(1e-3)] for piece in pieces])
    assert len(pieces) == 16 and ours.length == pytest.approx(theirs.length, rel=2e-3)
    assert ours.hausdorff_distance(theirs) < 0.02


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("a.geojson", "{}", "expected a FeatureCollection"),
        ("a.geojson", "[", "no JSON"),
        ("a.geojson", '{"features": [null]}', "no wall and no exit and no start in it: nothing is drawn"),
        ("a.geojson", json.dumps(geojson()).replace("[6, 1.6]", "[6]"), "no list of points"),
        ("a.geojson", json.dumps(geojson()).replace('"count": 20', '"count": "x"'), 'count "x" is no number'),
        ("a.geojson", json.dumps(geojson()).replace('"exit"', '"portal"'), "--layer exit=NAME, or draw them. Layers:"),
        ("a.geojson", json.dumps(geojson()).replace('"exit"', '"portal"'), "'portal': 1 line"),
        ("a.svg", "<svg", "a.svg: no XML"),
        ("a.svg", SVG, "have no count; give one to each, or --people N"),
        ("a.svg", SVG.replace("V-400", "Q1 2 x 4"), "its path"),
        ("a.svg", SVG.replace('x2="600"', 'x2="3%"'), "is no length"),
        ("a.wkt", "POLYGON ((0 0, 9 0, 9 4, 0 0))", "no exit and no start in it: all lines are on one layer"),
    ],
)
def test_drawings_that_cannot_be_read_say_why(tmp_path: Path, name: str, text: str, told: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(SceneError) as error:
        words(tmp_path / name, scale=0.01 if name.endswith("svg") else None)
    assert told in str(error.value) and str(error.value).startswith(str(tmp_path / name))


def test_units_are_asked_for_where_the_size_is_no_building(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    with pytest.raises(SceneError) as error:
        words(drawn(tmp_path, "units"), people=5)
    told = str(error.value)
    assert "walls span 9000 by 4000 m, in metres, as the file does not say its unit" in told
    assert "--scale, or --units mm (9 by 4 m), --units cm" in told and "--units m (" not in told
    assert words(drawn(tmp_path, "units"), people=5, units="mm") == {
        **words(drawn(tmp_path), people=5),
        "title": "planunits",
    }
    with pytest.raises(SceneError, match="as the file says, in mm"):
        words(mend(drawn(tmp_path), 9000, 9000000), people=5)
    with pytest.raises(SceneError, match="--units and --scale"):
        words(drawn(tmp_path), people=5, units="mm", scale=1.0)
    with pytest.raises(SceneError, match="--units rod: no unit that is known"):
        words(drawn(tmp_path), people=5, units="rod")


def test_degrees_are_no_metres(tmp_path: Path) -> None:
    tree = geojson()
    for feature in tree["features"]:
        text = json.dumps(feature["geometry"]["coordinates"])
        feature["geometry"]["coordinates"] = degrees(json.loads(text))
    (tmp_path / "a.geojson").write_text(json.dumps(tree))
    with pytest.raises(SceneError, match="longitudes and latitudes"):
        words(tmp_path / "a.geojson")


def degrees(points: Any) -> Any:
    """Metres to degrees, somewhere."""
    return (
        [degrees(p) for p in points] if isinstance(points[0], list) else [8.5 + 1e-5 * points[0], 50 + 1e-5 * points[1]]
    )


def mend(path: Path, old: int, new: int) -> Path:
    path.write_text(path.read_text().replace(f"\n{old}.0\n", f"\n{new}.0\n"))
    return path


def test_layers_are_listed_and_taken_by_name(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    with pytest.raises(SceneError, match=r"all lines are on one layer, '0' \(.*3 polylines.*\); put walls"):
        words(drawn(tmp_path, "layers"), people=5)
    path = drawn(tmp_path)
    with pytest.raises(SceneError) as error:
        words(path, people=5, layers=["exit=nowhere"])
    assert "'A-WALL': 3 polylines, taken as wall" in str(error.value) and "'Notausgang': 1 line\n" in str(error.value)
    assert words(path, people=5, layers=["exit=notausgang"]) == words(path, people=5)
    for wrong, told in (("exit", "expected KIND=NAME"), ("gate=x", "is no kind of layers")):
        with pytest.raises(SceneError, match=told):
            words(path, people=5, layers=[wrong])


def test_repaired_walls_are_joined_and_single(tmp_path: Path) -> None:
    """Shapely says of the mended plan: no crossing, nothing twice, the rooms closed but for their gates."""
    shapely = pytest.importorskip("shapely")
    wrong = tree(10)
    plan = wrong["plan"][0]
    # A gap, a double, a wall on through the door, and a loop.
    plan["walls"] = [
        [[6, 4], [0, 4], [0, 0], [6, 0], [6, 4]],
        [[6.03, 3.98], [9, 4], [9, 3]],
        [[6, 0], [9, 0], [9, 1]],
        [[0, 0], [4, 0]],
        [[7, 1], [8, 2], [8, 1], [7, 2]],
    ]
    scene = Scene(wrong)
    kinds = {fault.kind for fault in check.faults(scene)}
    assert kinds == {"closed", "gap", "double", "crossing", "jamb", "locked", "unused"}
    new, done = check.mended(scene)
    assert {fault.kind for fault in done} == {"closed", "gap", "double", "crossing"} and not check.faults(new)
    walls = shapely.MultiLineString(new.to_dict()["plan"][0]["walls"])
    assert shapely.union_all([walls]).length == pytest.approx(walls.length)
    lines = list(walls.geoms)
    assert not any(a.crosses(b) for k, a in enumerate(lines) for b in lines[:k])
    gates = [[g["from"], g["to"]] for key in ("door", "exit") for g in new.to_dict()["plan"][0][key]]
    rooms = sorted(
        room.area for room in shapely.polygonize([shapely.union_all([walls, shapely.MultiLineString(gates)])]).geoms
    )
    # The triangle of the loop; the rooms.
    assert rooms == [pytest.approx(0.25), pytest.approx(11.75), pytest.approx(24.0)]
    assert study(new, seeds=1).outcomes[0].left == 10


def test_the_radius_of_the_largest_body_decides() -> None:
    narrow = tree(5)
    narrow["plan"][0]["door"][0] |= {"from": [6, 1.8], "to": [6, 2.2]}
    assert not any(fault.kind == "narrow" for fault in check.faults(Scene(narrow)))
    narrow["crowd"][0] |= {"radius": 0.19, "radius_spread": 0.1}
    (fault,) = (fault for fault in check.faults(Scene(narrow)) if fault.kind == "narrow")
    assert fault.fatal and fault.places == ((6.0, 2.0),) and "0.418 m" in fault.text


def test_the_command_line_checks_draws_and_repairs(tmp_path: Path) -> None:
    wrong = tree(5)
    wrong["plan"][0]["walls"] = [[[6, 4], [0, 4], [0, 0], [6, 0], [6, 4]], *WALLS[1:]]
    (tmp_path / "plan.json").write_text(json.dumps(wrong))
    command = ["bottlenecks", str(tmp_path / "plan.json"), "--out", str(tmp_path / "out"), "--seeds", "1"]
    said = CliRunner().invoke(application(), [*command, "--check"])
    assert said.exit_code == 2 and "fatal  closed" in said.output and "--repair" in said.output
    assert (tmp_path / "out/check.png").read_bytes()[:4] == b"\x89PNG" and not (tmp_path / "out/plan.json").exists()
    listed = json.loads(CliRunner().invoke(application(), [*command, "--check", "--json"]).stdout)
    assert not listed["ok"] and listed["faults"][0]["places"] == [[6.0, 2.0]]
    refused = CliRunner().invoke(application(), command)
    assert refused.exit_code == 2 and "check.png" in refused.output
    ran = CliRunner().invoke(application(), [*command, "--repair"])
    assert ran.exit_code == 0 and "ended a wall at a gate at (6, 2)" in ran.output
    assert not check.faults(Scene.load(tmp_path / "out/plan.json"))


@pytest.mark.parametrize("suffix", ["dxf", "svg", "geojson", "wkt"])
def test_each_format_runs_from_end_to_end(tmp_path: Path, suffix: str) -> None:
    if suffix == "dxf":
        pytest.importorskip("ezdxf")
        file = drawn(tmp_path)
    else:
        file = tmp_path / f"plan.{suffix}"
        texts = {"svg": SVG, "geojson": json.dumps(geojson()), "wkt": WKT}
        file.write_text(texts[suffix])
    scale = ["--scale", "0.01"] if suffix == "svg" else []
    command = ["bottlenecks", str(file), "--seeds", "1", "--people", "8", "--out", str(tmp_path / "out"), *scale]
    said = CliRunner().invoke(application(), command)
    assert said.exit_code == 0, said.output
    assert "last person out after" in said.output


WKT = "\n".join(
    [
        *("LINESTRING (" + ", ".join(f"{x} {y}" for x, y in wall) + ")" for wall in WALLS),
        'door "door" LINESTRING (6 1.6, 6 2.4)',
        'exit "out" LINESTRING (9 1, 9 3)',
        "start POLYGON ((0.5 0.5, 5 0.5, 5 3.5, 0.5 3.5, 0.5 0.5))",
    ]
)

# The upper floor of 5 m x 3 m lies to the right of the lower one; a flight of stairs of 1.2 m leads from one to the other.
FLOORS = """LINESTRING (5 0.9, 5 0, 0 0, 0 0.9)
LINESTRING (0 2.1, 0 3, 5 3, 5 2.1)
LINESTRING (10 2.1, 10 3, 15 3, 15 0, 10 0, 10 0.9)
exit "out" LINESTRING (0 0.9, 0 2.1)
door "stairs head" LINESTRING (10 0.9, 10 2.1)
LINESTRING (5 0.9, 6.5 0.9, 6.5 2.1, 5 2.1)
LINESTRING (10 0.9, 8.5 0.9, 8.5 2.1, 10 2.1)
start POLYGON ((11 0.5, 14 0.5, 14 2.5, 11 2.5, 11 0.5))
"""
LINK = 'link "stairs" LINESTRING (6 0.9, 6 2.1)\nlink "stairs" LINESTRING (9 2.1, 9 0.9)\n'


def test_people_of_an_upper_floor_leave_by_the_lower(tmp_path: Path) -> None:
    file, out = tmp_path / "floors.wkt", tmp_path / "out"
    command = ["bottlenecks", str(file), "--seeds", "1", "--people", "8", "--out", str(out)]
    file.write_text(FLOORS)
    refused = CliRunner().invoke(application(), command)
    assert refused.exit_code == 2 and "no way leads from there to an exit" in refused.output
    file.write_text(FLOORS + LINK)
    ran = CliRunner().invoke(application(), command)
    assert ran.exit_code == 0, ran.output
    rows = (out / "bottlenecks.csv").read_text().splitlines()
    crossed = {row.split(",")[1]: float(row.split(",")[4]) for row in rows[1:]}
    assert crossed == {"stairs head": 8.0, "out": 8.0}
    # A person on each floor, so that nobody leaps and crosses what lies between.
    walk = paths.walked(Scene(words(file, people=8)), 100.0)
    assert len(np.unique(walk.person)) == 16 and measures.speeds(walk).max() < 2.5
    lines = {"stairs head": [[10, 0.9], [10, 2.1]], "between": [[7, 0], [7, 3]]}
    found = {name: len(measures.crossings(walk, np.array(line, float))) for name, line in lines.items()}
    assert found == {"stairs head": 8, "between": 0}


def test_a_mended_plan_in_millimetres_keeps_all_that_is_on_it(tmp_path: Path) -> None:
    file = tmp_path / "floors.wkt"
    file.write_text(FLOORS + LINK)
    found = words(file, people=8)
    (plan,) = found["plan"]
    large = json.loads(
        json.dumps(plan), parse_float=lambda text: 1000 * float(text), parse_int=lambda text: 1000 * int(text)
    )
    stairs = {"area": [[5000, 900], [6000, 2100]], "up": [1, 0]}
    place = {"name": "desk", "at": [13000, 1500]}
    plan = large | {"scale": 0.001, "stairs": [stairs], "waypoint": [place]}
    plan["door"] = [plan["door"][0] | {"opens": 5.0}]
    new = check.mended(Scene(found | {"plan": [plan]}))[0].to_dict()["plan"][0]
    assert new["door"][0]["opens"] == 5.0
    assert new["scale"] == 1.0
    assert new["link"][0]["to"] == [pytest.approx([9.0, 0.9]), pytest.approx([9.0, 2.1])]
    assert new["stairs"][0]["area"] == [pytest.approx([5.0, 0.9]), pytest.approx([6.0, 2.1])]
    assert new["waypoint"][0]["at"] == pytest.approx([13.0, 1.5]) and new["waypoint"][0]["radius"] == 1.0
