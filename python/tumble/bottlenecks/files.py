"""Plans from drawings: GeoJSON and SVG to the words of a scene.

What a line is, its `kind` says: wall, door, exit or start (an area where people are). In GeoJSON it is a property of the
feature, beside `name`, `count` and `density`; in SVG the class, id or label of an element or of a group around it, beside
`data-name`, `data-count` and `data-density`.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tumble._engine import SceneError

Points = list[list[float]]

SUFFIXES = (".geojson", ".svg")
"""Of drawings."""

KINDS = ("wall", "door", "exit", "start")

LEAST = 1.0
"""A plan that is less wide [m] is in other units."""

FPS = 20
"""Frames a second of the scene."""


def scene(path: Path, scale: float, people: int | None) -> dict[str, Any]:
    """The scene of a drawing, `scale` metres in a unit of it. `people` are spread over start areas without a count.
    Raises SceneError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise SceneError(f"{path}: {error}") from None
    read = _geojson if path.suffix.lower() == ".geojson" else _svg
    try:
        found = list(read(text))
    except (ValueError, ElementTree.ParseError, RecursionError) as error:
        raise SceneError(f"{path}: {error}") from None
    wrong: list[str] = []
    plan: dict[str, Any] = {"name": "plan", "scale": scale, "walls": [], "door": [], "exit": []}
    starts: list[tuple[Points, Mapping[str, Any]]] = []
    for k, (kind, points, words) in enumerate(found):
        if kind == "wall":
            plan["walls"].append(points)
        elif kind == "start":
            starts.append(([[scale * x, scale * y] for x, y in points], words))
        elif len(points) != 2:
            wrong.append(f"{kind} {words.get('name', k)}: {len(points)} points, expected a line from jamb to jamb")
        else:
            name = str(words.get("name") or f"{kind} {len(plan[kind]) + 1}")
            plan[kind].append({"name": name, "from": points[0], "to": points[1]})
    kinds = {kind for kind, _, _ in found}
    wrong += [
        f"no {kind} in it; mark lines with kind {', '.join(KINDS)}"
        for kind in ("wall", "exit", "start")
        if kind not in kinds
    ]
    across = [scale * p[a] for wall in plan["walls"] for p in wall for a in (0, 1)]
    if across and max(across) - min(across) < LEAST:
        wrong.append(f"walls span {max(across) - min(across):.3g} m; give the metres in a unit of it by --scale")
    if wrong:
        raise SceneError("\n".join(f"{path}: {text}" for text in wrong))
    return {
        "version": 1,
        "title": path.stem,
        "dimension": 2,
        "plane": "xy",
        "time": {"fps": FPS},
        "plan": [plan],
        "crowd": _crowds(path, starts, people),
    }


def _crowds(path: Path, starts: list[tuple[Points, Mapping[str, Any]]], people: int | None) -> list[dict[str, Any]]:
    """A crowd for each start area; people without a place of their own by area."""
    open_ = [_area(points) for points, words in starts if not {"count", "density"} & words.keys()]
    if open_ and people is None:
        raise SceneError(
            f"{path}: {len(open_)} start areas have no count; give one to each, or --people N for all of them"
        )
    crowds, before, done = [], 0.0, 0
    for k, (points, words) in enumerate(starts):
        crowd: dict[str, Any] = {"name": str(words.get("name") or f"people {k + 1}"), "area": points}
        told = next((word for word in ("count", "density") if word in words), None)
        if told is not None:
            try:
                number = _number(words[told])
            except ValueError as error:
                raise SceneError(f"{path}: {crowd['name']}: {told}: {error}") from None
            crowd[told] = int(number) if told == "count" else number
        else:
            # Rounded so that all together are as many as were asked for.
            before += _area(points)
            share = round((people or 0) * before / sum(open_)) - done
            done += share
            if share == 0:
                continue
            crowd["count"] = share
        crowds.append(crowd)
    return crowds


def _area(points: Points) -> float:
    pairs = zip(points, [*points[1:], points[0]], strict=True)
    return 0.5 * abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs))


Found = Iterator[tuple[str, Points, Mapping[str, Any]]]


def _geojson(text: str) -> Found:
    tree = json.loads(text)
    features = tree.get("features") if isinstance(tree, dict) else None
    if not isinstance(features, list):
        raise ValueError("no list of features, expected a FeatureCollection")
    for k, feature in enumerate(features):
        words = feature.get("properties") if isinstance(feature, dict) else None
        if not isinstance(words, dict) or words.get("kind") not in KINDS:
            continue
        geometry = feature.get("geometry")
        form = geometry.get("type") if isinstance(geometry, dict) else None
        if form not in ("LineString", "MultiLineString", "Polygon"):
            raise ValueError(f"features[{k}]: a {form}, expected a LineString, MultiLineString or Polygon")
        lines = geometry.get("coordinates")
        if form == "LineString":
            lines = [lines]
        if not isinstance(lines, list):
            raise ValueError(f"features[{k}]: coordinates are no list of lines")
        for line in lines:
            points = _points(line, f"features[{k}]")
            if words["kind"] == "start":
                # Its outer ring, which ends where it begins.
                yield "start", points[:-1] if points[:1] == points[-1:] else points, words
                break
            yield words["kind"], points, words


def _points(line: Any, place: str) -> Points:
    if not isinstance(line, list) or not all(isinstance(point, list) and len(point) >= 2 for point in line):
        raise ValueError(f"{place}: coordinates are no list of points")
    return [[_number(x) for x in point[:2]] for point in line]


def _number(x: Any) -> float:
    try:
        found = float(x)
    except (TypeError, ValueError):
        found = math.nan
    if not math.isfinite(found):
        raise ValueError(f"{x!r} is no number")
    return found


def _svg(text: str) -> Found:
    yield from _elements(ElementTree.fromstring(text), None)


def _elements(element: ElementTree.Element, around: str | None) -> Found:
    """What an element and those in it draw; y is turned up."""
    label = next((value for key, value in element.attrib.items() if key.endswith("}label")), "")
    said = " ".join([element.get("class", ""), element.get("id", ""), label]).lower()
    kind = next((kind for kind in KINDS if re.search(rf"\b{kind}s?\b|\b{kind}s?[-_ ]?\d", said)), around)
    if kind is not None and element.get("transform"):
        raise ValueError(
            f"<{element.tag.rpartition('}')[2]}> {said.strip()} has a transform; apply it in the drawing program first"
        )
    if kind is not None:
        names = ("name", "count", "density")
        words = {name: element.get(f"data-{name}") for name in names if element.get(f"data-{name}") is not None}
        for points in _lines(element):
            turned = [[x, -y] for x, y in points]
            yield kind, turned[:-1] if kind == "start" and turned[:1] == turned[-1:] else turned, words
    for child in element:
        yield from _elements(child, kind)


def _lines(element: ElementTree.Element) -> Iterator[Points]:
    """The lines of an element."""

    def at(*names: str) -> list[float]:
        return [_number(element.get(name, "0")) for name in names]

    match element.tag.rpartition("}")[2]:
        case "line":
            x1, y1, x2, y2 = at("x1", "y1", "x2", "y2")
            yield [[x1, y1], [x2, y2]]
        case "rect":
            x, y, w, h = at("x", "y", "width", "height")
            yield [[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]]
        case "polyline" | "polygon" as shape:
            flat = [_number(x) for x in re.findall(r"[^\s,]+", element.get("points", ""))]
            points = [list(pair) for pair in zip(flat[::2], flat[1::2], strict=False)]
            yield points + (points[:1] if shape == "polygon" else [])
        case "path":
            yield from _path(element.get("d", ""))


def _path(words: str) -> Iterator[Points]:
    """Straight lines of a path."""
    tokens = re.findall(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", words)
    points: Points = []
    command, x, y, i = "", 0.0, 0.0, 0
    while i < len(tokens):
        if tokens[i].isalpha():
            command, i = tokens[i], i + 1
            if command in "Zz":
                if points:
                    x, y = points[0]
                    yield [*points, points[0]]
                points = []
                continue
        relative, base = command.islower(), (x, y)
        take = {"M": 2, "L": 2, "H": 1, "V": 1}.get(command.upper(), 0)
        if not take:
            raise ValueError(f"a path has the command {command!r}; expected straight lines: M, L, H, V, Z")
        if i + take > len(tokens) or any(token.isalpha() for token in tokens[i : i + take]):
            raise ValueError("a path ends within a point")
        numbers, i = [_number(token) for token in tokens[i : i + take]], i + take
        if command.upper() == "H":
            x = numbers[0] + (base[0] if relative else 0.0)
        elif command.upper() == "V":
            y = numbers[0] + (base[1] if relative else 0.0)
        else:
            x, y = (numbers[a] + (base[a] if relative else 0.0) for a in (0, 1))
        if command.upper() == "M":
            if len(points) > 1:
                yield points
            points, command = [], "l" if relative else "L"
        elif not points:
            points = [list(base)]
        points.append([x, y])
    if len(points) > 1:
        yield points
