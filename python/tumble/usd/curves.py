"""Curves of USD files as polylines: guides of hair, in metres, z up.

Cubic curves are evaluated finely enough that the polyline is off by less than a ten-thousandth of the curve's length.
"""

from typing import Any

import numpy as np

from tumble.usd.stage import MOST, Floats, Indices, Reading, Surface, names, note

_OFF = 1e-4
"""Distance of the polyline from its curve, over the curve's length."""

_FINEST = 64
"""Pieces of a cubic span, at most."""

_MEANT = ("BasisCurves", "NurbsCurves", "HermiteCurves", "NurbsPatch", "Points")
"""Prims that a groom may have been put into; a mesh beside it is what it grows on."""

_BASES = {
    "bezier": [[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]],
    "bspline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6,
    "catmullRom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2,
}
"""Coefficients of 1, u, u² and u³ from the four points of a span."""


class Strands(Reading):
    """The curves that a stage shows at a time code, by default its start."""

    wanted, words = "open curves of straight pieces or cubics", "guides"

    def __init__(self, stage: Any, time: float | None = None) -> None:
        super().__init__(stage, time)
        self.curves: list[Floats] = []
        """Points [m] of each curve, n x 3."""

    def surface(self, prim: Any, place: Floats, moved: bool = False) -> Surface | None:
        """Collects the curves of a prim; there is never a surface."""
        from pxr import UsdGeom

        kind, path = str(prim.GetTypeName()), str(prim.GetPath())
        if not prim.IsA(UsdGeom.Gprim):
            return None
        if not prim.IsA(UsdGeom.BasisCurves):
            if kind in _MEANT:
                note(self.unused, f"{path} ({kind})")
            return None
        curves = UsdGeom.BasisCurves(prim)
        if curves.GetWrapAttr().Get(self.time) == UsdGeom.Tokens.periodic:
            note(self.unused, f"{path} (BasisCurves, periodic: closed curves have no root)")
            return None
        attributes = [curves.GetPointsAttr(), curves.GetCurveVertexCountsAttr()]
        if moved or any(a.ValueMightBeTimeVarying() for a in attributes):
            note(self.moving, path)
        found = _polylines(curves, self.time, MOST - self.points)
        if not found:
            note(self.unused, f"{path} (BasisCurves without curves)")
        self.points += sum(map(len, found))
        self.curves += [points @ place[:3, :3] + place[3, :3] for points in found]
        return None

    def obj(self) -> str:
        """The curves as polylines of one OBJ. Raises ValueError if there are none."""
        self.surfaces()
        if not self.curves:
            left = f"; what is in it cannot be used: {names(self.unused)}" if self.unused else ""
            left += f"; left out as invisible, guide or proxy: {names(self.hidden)}" if self.hidden else ""
            raise ValueError(
                f"there are no curves in it{left}; export the strands as BasisCurves that are visible, or let hair grow on a "
                "mesh as mesh = { path = ... }"
            )
        lines: list[str] = []
        first = 1
        for curve in self.curves:
            lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in curve.tolist()]
            lines.append("l " + " ".join(map(str, range(first, first + len(curve)))))
            first += len(curve)
        return "\n".join(lines) + "\n"


def _polylines(curves: Any, time: Any, most: int) -> list[Floats]:
    """Points of each curve of a prim, in its own coordinates. Raises ValueError."""
    path = curves.GetPath()
    try:
        points = np.array(curves.GetPointsAttr().Get(time) or [], dtype=float).reshape(-1, 3)
        counts = np.array(curves.GetCurveVertexCountsAttr().Get(time) or [], dtype=np.int64).ravel()
    except ValueError as error:
        raise TypeError from error
    if counts.sum() != len(points) or (counts < 0).any():
        raise ValueError(f"{path}: its curves do not fit its points; the file is damaged, export it again")
    if not np.isfinite(points).all():
        bad = int(np.searchsorted(np.cumsum(counts), np.flatnonzero(~np.isfinite(points).all(axis=1))[0], side="right"))
        raise ValueError(f"{path}: curve {bad + 1} goes through a point that is not finite; export it again")
    cubic = curves.GetTypeAttr().Get(time) == "cubic"
    basis, pinned = str(curves.GetBasisAttr().Get(time)), curves.GetWrapAttr().Get(time) == "pinned"
    if cubic and basis not in _BASES:
        raise ValueError(f"{path}: its basis is {basis}, expected {', '.join(_BASES)}; export it again")
    pinned = pinned and cubic and basis != "bezier"
    least = 4 if cubic and not pinned else 2
    fits = (counts >= least) & ((counts % 3 == 1) if cubic and basis == "bezier" else True)
    if not fits.all():
        k = int(np.flatnonzero(~fits)[0])
        kind = f"{basis} curve" if cubic else "linear curve"
        more = ", 7, 10 and so on" if basis == "bezier" and cubic else " or more"
        more += '; straight pieces have type = "linear"' if cubic else ""
        raise ValueError(
            f"{path}: curve {k + 1} has {counts[k]} points, a {kind} has {least}{more}; export it again, or leave it out"
        )
    own = np.split(points, np.cumsum(counts)[:-1]) if len(counts) else []
    if not cubic:
        return own
    if pinned:
        # Points beyond the ends make it begin at its first point and end at its last.
        own = [np.concatenate([[2 * c[0] - c[1]], c, [2 * c[-1] - c[-2]]]) for c in own]
    return _evaluated(own, basis, most, str(path))


def _evaluated(own: list[Floats], basis: str, most: int, path: str) -> list[Floats]:
    """Polylines of cubic curves. Raises ValueError if they have more points than `most`."""
    step = 3 if basis == "bezier" else 1
    firsts = [np.arange(0, len(c) - 3, step) for c in own]
    spans: Floats = np.concatenate([c[f[:, None] + np.arange(4)] for c, f in zip(own, firsts, strict=True)])
    which: Indices = np.repeat(np.arange(len(own)), [len(f) for f in firsts])
    terms = np.einsum("ij,sjc->sic", np.array(_BASES[basis], dtype=float), spans)
    # A chord over 1/n of a span is off by a curve's second derivative, which is largest at an end, over 8 n².
    ends = np.stack([2 * terms[:, 2], 2 * terms[:, 2] + 6 * terms[:, 3]], axis=1)
    chords = np.linalg.norm(terms[:, 1:].sum(axis=1), axis=1)
    lengths = np.maximum(np.bincount(which, chords, minlength=len(own)), 1e-300)
    bent = float((np.linalg.norm(ends, axis=2).max(axis=1) / lengths[which]).max())
    n = int(np.clip(np.ceil(np.sqrt(bent / 8 / _OFF)), 1, _FINEST))
    if len(spans) * n > most:
        raise ValueError(f"{path}: its curves need more than {most} points; export fewer, or with fewer points each")
    u = np.arange(n) / n
    inner = np.einsum("un,snc->suc", u[:, None] ** np.arange(4), terms)
    last = terms.sum(axis=1)
    cuts = np.cumsum([len(f) for f in firsts])
    parts = zip(np.split(inner, cuts[:-1]), last[cuts - 1], strict=True)
    return [np.concatenate([part.reshape(-1, 3), [end]]) for part, end in parts]
