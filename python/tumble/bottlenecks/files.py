"""Plans from drawings: DXF, SVG, GeoJSON and WKT to the words of a scene.

What a line is, the name of its layer says, in several languages: wall, door, exit or start (an area where people are). A layer
is one of DXF, Inkscape's label, class or id of an element or of a group around it in SVG, and the property `kind` or `layer` in
GeoJSON; in SVG `data-name`, `data-count` and `data-density` say the rest, in GeoJSON properties.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tumble import _engine
from tumble._engine import SceneError

Points = list[list[float]]

SUFFIXES = (".dxf", ".geojson", ".svg", ".wkt")
"""Of drawings."""

UNITS = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Metres in a unit."""

NEEDED = ("wall", "exit", "start")
"""Kinds without which nobody walks."""

FPS = 20
"""Frames a second of the scene."""

DEGREES = 0.1
"""Plans of a smaller span may be in degrees."""

LISTED = 30
"""Layers that an error lists."""


@dataclass(frozen=True)
class Reading:
    """What a drawing does not say."""

    scale: float | None = None
    """Metres in a unit of it."""
    units: str | None = None
    """The same by name: mm, cm, dm, m, in, ft."""
    layers: Sequence[str] = ()
    """KIND=NAME each: what a layer holds. Of a kind that is named no other layer is."""
    people: int | None = None
    """In all start areas without a count."""

    def metres(self) -> float | None:
        """Metres in a unit, if that was said. Raises SceneError."""
        if self.units is None:
            return self.scale
        if self.scale is not None:
            raise SceneError("--units and --scale both say what a unit is; leave one of them out")
        if self.units not in UNITS:
            raise SceneError(f"--units {self.units}: no unit that is known, expected one of {', '.join(UNITS)}")
        return UNITS[self.units]

    def pairs(self) -> list[tuple[str, str]]:
        """Kinds and layers. Raises SceneError."""
        found = [text.partition("=")[::2] for text in self.layers]
        for (kind, name), text in zip(found, self.layers, strict=True):
            if not kind or not name:
                raise SceneError(f"--layer {text}: expected KIND=NAME, as in wall=A-WALL")
        return found


def scene(path: Path, reading: Reading) -> dict[str, Any]:
    """The words of a scene with the plan that a drawing shows. Raises SceneError with all that is missing."""
    try:
        found = _engine.plan(path, path.suffix, reading.metres(), reading.pairs())
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    scale = float(found["scale"])
    wrong = [*found["faults"], *_missing(found)]
    if found["walls"] and not found["plausible"]:
        wrong.append(_size(found, reading))
    if not wrong:
        wrong += _uncounted(found["starts"], reading.people)
    if wrong:
        raise SceneError("\n".join(f"{path}: {text}" for text in wrong))
    plan = {"name": "plan", "scale": scale, "walls": found["walls"]}
    for kind in ("door", "exit"):
        plan[kind] = [
            {"name": gate["name"] or f"{kind} {k + 1}", "from": gate["line"][0], "to": gate["line"][1]}
            for k, gate in enumerate(found[f"{kind}s"])
        ]
    plan["link"] = [{"name": link["name"], "from": link["lines"][0], "to": link["lines"][1]} for link in found["links"]]
    return {
        "version": 1,
        "title": path.stem,
        "dimension": 2,
        "plane": "xy",
        "time": {"fps": FPS},
        "plan": [plan],
        "crowd": _crowds(found["starts"], scale, reading.people),
    }


def notes(path: Path, reading: Reading) -> list[str]:
    """What a drawing says that its scene does not: layers that hold nothing, stairs, far places."""
    found = _engine.plan(path, path.suffix, reading.metres(), reading.pairs())
    told = [
        f"layer {layer['name']!r} is of kind {layer['kind']} and holds {_holds(layer) or 'nothing'}: no line of it is used"
        for layer in found["layers"]
        if layer["kind"] and not any(form in layer["holds"] for form in ("line", "polyline", "outline", "arc"))
    ]
    told += [
        f"layer {layer['name']!r} is hidden in the drawing and left out; take it by --layer KIND=NAME"
        for layer in found["layers"]
        if layer["hidden"] and layer["holds"] and not layer["kind"]
    ]
    if found["stairs"]:
        told.append(f"{found['stairs']} lines of stairs are left out: they do not say where these rise")
    if any(found["origin"]):
        x, y = found["origin"]
        told.append(f"coordinates are counted from ({x:.15g}, {y:.15g}) of the drawing, which is far from 0")
    return told


def _missing(found: Mapping[str, Any]) -> list[str]:
    """Kinds of which there is nothing, and the layers that there are."""
    lacking = [kind for kind in NEEDED if not found[f"{kind}s"]]
    if not lacking:
        return []
    layers = [layer for layer in found["layers"] if layer["holds"]]
    what = f"no {' and no '.join(lacking)} in it"
    cure = " ".join(f"--layer {kind}=NAME" for kind in lacking)
    if len({layer["name"] for layer in layers}) == 1:
        only = layers[0]["name"]
        text = f"{what}: all lines are on one layer, {only!r} ({_holds(layers[0])})"
        return [f"{text}; put walls, doors, exits and start areas on layers of their own"]
    lines = [f"  {layer['name']!r}: {_holds(layer)}{_taken(layer)}" for layer in layers[:LISTED]]
    more = [f"  and {len(layers) - LISTED} more"] if len(layers) > LISTED else []
    there = "\n".join([f"{what}; say which layers they are by {cure}, or draw them. Layers:", *lines, *more])
    return [there if layers else f"{what}: nothing is drawn in it"]


def _taken(layer: Mapping[str, Any]) -> str:
    hidden = " (hidden)" if layer["hidden"] else ""
    return f"{hidden}, taken as {layer['kind']}" if layer["kind"] else hidden


def _holds(layer: Mapping[str, Any]) -> str:
    return ", ".join(f"{n} {form}{'s' if n > 1 else ''}" for form, n in layer["holds"].items())


def _size(found: Mapping[str, Any], reading: Reading) -> str:
    """That a plan is no building, and which units would make it one."""
    scale, (width, height) = float(found["scale"]), found["span"]
    unit = found["unit"]
    given = reading.metres() is not None
    says = (
        "as was said"
        if given
        else f"as the file says, in {unit[0]}"
        if unit
        else "in metres, as the file does not say its unit"
    )
    if not found["likely"] and max(width, height) < DEGREES:
        return f"walls span {width:.3g} by {height:.3g}: longitudes and latitudes? Export it in metres, in a projected system"
    text = f"walls span {scale * width:.4g} by {scale * height:.4g} m, {says}: that is no building"
    sizes = [f"--units {name} ({UNITS[name] * width:.4g} by {UNITS[name] * height:.4g} m)" for name in found["likely"]]
    return f"{text}; give the metres in a unit of it by --scale{', or ' if sizes else ''}{', '.join(sizes)}"


def _uncounted(starts: Sequence[Mapping[str, Any]], people: int | None) -> list[str]:
    open_ = [start for start in starts if start["count"] is None and start["density"] is None]
    if not open_ or people is not None:
        return []
    return [f"{len(open_)} start areas have no count; give one to each, or --people N for all of them"]


def _crowds(starts: Sequence[Mapping[str, Any]], scale: float, people: int | None) -> list[dict[str, Any]]:
    """A crowd for each start area; people without a place of their own by area."""
    open_ = [_area(start["points"]) for start in starts if start["count"] is None and start["density"] is None]
    crowds, before, done = [], 0.0, 0
    for k, start in enumerate(starts):
        area = [[scale * x, scale * y] for x, y in start["points"]]
        crowd: dict[str, Any] = {"name": start["name"] or f"people {k + 1}", "area": area}
        if start["count"] is not None:
            crowd["count"] = max(1, round(start["count"]))
        elif start["density"] is not None:
            crowd["density"] = start["density"]
        else:
            # Rounded so that all together are as many as were asked for.
            before += _area(start["points"])
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
