"""The page on operators: their orders, and the checkerboard."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from tumble.lab.operators import _operators, around, boards, fields, page, shown


def test_every_operator_is_of_second_order() -> None:
    for coarse, fine in zip(shown(24), shown(48), strict=True):
        order = np.log2(coarse.error / fine.error)
        assert abs(order - 2) < 0.1, f"{coarse.name}: {order}"  # measured: 1.96 to 2.03


def test_only_the_staggered_grid_sees_the_checkerboard() -> None:
    n = 24
    board = boards(n)
    # Central differences see only the smooth part, whose slope is at most 2 pi; on faces every step is 0.8/dx as well.
    assert 6.0 < board.collocated.max() < 2 * np.pi
    assert board.staggered.min() > 0.8 * n
    checkers = board.checkers
    assert checkers["collocated"] > 0.5 > 0.2 > checkers["staggered"] > 0.0, checkers
    # Every second cell of the collocated pressure belongs to another solution; next to the source it is no neighbour at all.
    row = {name: p[:, n // 2] for name, p in board.solved.items()}
    assert abs(row["collocated"][n // 4 + 1]) < 0.2 * abs(row["collocated"][n // 4])
    assert 0.4 < row["staggered"][n // 4 + 1] / row["staggered"][n // 4] < 0.8


def test_the_page_is_written(tmp_path: Path) -> None:
    path = page(tmp_path)
    text = path.read_text(encoding="utf-8")
    assert path.name == "operators.html" and text.count("<img") == 3
    assert (tmp_path / "operators.png").stat().st_size > 50_000
    assert len((tmp_path / "operators.csv").read_text(encoding="utf-8").splitlines()) == 1 + 6 * 4


def test_images_of_all_places_lie_in_the_same_square() -> None:
    f, u = fields(12)
    for field in (f, *u, *(one.field for one in shown(12))):
        left, right, bottom, top = around(field)
        assert (left + right) / 2 == pytest.approx(0.5) and (bottom + top) / 2 == pytest.approx(0.5), field.place
        x, y = field.grid.points(field.place)
        # A pixel is a cell wide, with its value in the middle.
        assert (right - left) / field.array.shape[0] == pytest.approx(1 / 12)
        assert left + 0.5 / 12 == pytest.approx(x.min()) and top - 0.5 / 12 == pytest.approx(y.max())


def test_the_field_and_the_flow_are_shown_with_arrows() -> None:
    figure = Figure()
    _operators(figure, shown(24))
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert len(titles) == 9 and titles[0] == "the field f"
    arrows = {axes.get_title(): axes.findobj(Quiver) for axes in figure.axes if axes.findobj(Quiver)}
    assert list(arrows) == ["f, and its gradient as arrows", "the flow: arrows, and its speed"]
    for quiver in (found[0] for found in arrows.values()):
        assert np.hypot(quiver.U, quiver.V).max() > 0.5
    (quiver,) = arrows["the flow: arrows, and its speed"]
    x, y = quiver.XY.T
    np.testing.assert_allclose(quiver.U, np.sin(3 * x + 1) * np.sin(5 * y), atol=0.02)  # measured: 0.008
    np.testing.assert_allclose(quiver.V, np.cos(4 * x) * np.cos(2 * y - 1), atol=0.02)
