"""The page on operators: their orders, and the checkerboard."""

from pathlib import Path

import numpy as np

from tumble.lab.operators import boards, page, shown


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
