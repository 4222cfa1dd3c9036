"""The shapes that USD names, as closed polygon meshes whose points lie on them."""

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

AROUND = 32
"""Points around an axis; half as many from pole to pole."""

SHAPES = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")


def polygons(prim: Any, kind: str, time: Any) -> tuple[Floats, Indices, Indices]:
    """Points in the prim's own coordinates, numbers of corners, and corners, counter-clockwise seen from outside."""

    def value(name: str) -> float:
        return float(prim.GetAttribute(name).Get(time))

    if kind == "Cube":
        return _cube(value("size"))
    if kind == "Plane":
        return _plane(value("width"), value("length"), str(prim.GetAttribute("axis").Get(time)))
    if kind == "Sphere":
        return _turned(_arc(value("radius"), 0.0, -0.5, 0.5), "Z")
    axis, height = str(prim.GetAttribute("axis").Get(time)), value("height")
    if kind.endswith("_1"):
        low, high = value("radiusBottom"), value("radiusTop")
    else:
        low = value("radius")
        high = 0.0 if kind == "Cone" else low
    if kind.startswith("Capsule"):
        profile = [*_arc(low, -0.5 * height, -0.5, 0.0), *_arc(high, 0.5 * height, 0.0, 0.5)]
    else:
        profile = [(0.0, -0.5 * height), (low, -0.5 * height), (high, 0.5 * height), (0.0, 0.5 * height)]
    return _turned(profile, axis)


def _arc(radius: float, middle: float, first: float, last: float) -> list[tuple[float, float]]:
    """Distance from the axis and height along an arc, whose ends are angles over π."""
    n = round(AROUND * (last - first) / 2)
    angles = np.pi * np.linspace(first, last, n + 1)
    return [
        (0.0 if abs(a) == np.pi / 2 else radius * float(np.cos(a)), middle + radius * float(np.sin(a))) for a in angles
    ]


def _turned(profile: list[tuple[float, float]], axis: str) -> tuple[Floats, Indices, Indices]:
    """The surface that a profile from the lower pole to the upper one makes as it turns about an axis."""
    points: list[tuple[float, float, float]] = []
    rings: list[list[int]] = []
    for k, (away, height) in enumerate(profile):
        if k and profile[k - 1] == (away, height):
            continue
        angles = 2 * np.pi * np.arange(AROUND if away > 0.0 else 1) / AROUND
        rings.append(list(range(len(points), len(points) + len(angles))))
        points += [(away * float(np.cos(a)), away * float(np.sin(a)), height) for a in angles]
    faces: list[list[int]] = []
    for below, above in pairwise(rings):
        for k in range(AROUND):
            i, j = k, (k + 1) % AROUND
            face = [below[i % len(below)], below[j % len(below)], above[j % len(above)], above[i % len(above)]]
            face = list(dict.fromkeys(face))
            if len(face) >= 3:
                faces.append(face)
    # Even permutations of the axes: what runs counter-clockwise stays so.
    place = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return _of(np.array(points)[:, place], faces)


def _cube(size: float) -> tuple[Floats, Indices, Indices]:
    points = [[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return _of(size * np.array(points), faces)


def _plane(width: float, length: float, axis: str) -> tuple[Floats, Indices, Indices]:
    """A rectangle across an axis; USD lays the width along x, or along z where x is the axis."""
    a, b = 0.5 * width, 0.5 * length
    flat = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
    points = np.zeros((4, 3))
    across = {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]
    points[:, across] = flat
    return _of(points, [[0, 1, 2, 3] if axis == "Z" else [3, 2, 1, 0]])


def _of(points: Floats, faces: list[list[int]]) -> tuple[Floats, Indices, Indices]:
    counts = np.array([len(face) for face in faces], dtype=np.int64)
    return points, counts, np.array([k for face in faces for k in face], dtype=np.int64)
