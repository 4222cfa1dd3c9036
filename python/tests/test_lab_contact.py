"""The page of contact: are its exact figures right, and do its verdicts follow what is simulated?"""

import csv
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from conftest import Answer
from scipy.special import ellipj, ellipk

from tumble import SceneError, StepError, World
from tumble.lab.contact import CASES, Case, blows, flows, page, slopes, statics, tumbling
from tumble.lab.contact.figure import Result, near, small, within
from tumble.lab.contact.report import run, text

Command = Callable[..., Answer]


def broken(result: Result) -> set[str]:
    """The figures that do not hold."""
    return {figure.what for figure in result.figures if not figure.holds}


def table(path: Path) -> list[dict[str, str]]:
    with path.with_suffix(".csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Exact figures


def test_elliptic_functions_are_those_of_scipy() -> None:
    u = np.linspace(-5.0, 30.0, 300)
    for m in (0.1, 0.5, 0.99, 0.99990001):
        assert tumbling.quarter(m) == pytest.approx(ellipk(m), rel=1e-13)
        for own, other in zip(tumbling.jacobi(u, m), ellipj(u, m), strict=False):
            assert np.abs(own - other).max() < 1e-11


def test_the_exact_wing_nut_obeys_eulers_equations() -> None:
    h = 1e-4
    times = np.linspace(0.0, 45.0, 400)
    before, now, after = (tumbling.exact(times + d) for d in (-h, 0.0, h))
    one, two, three = tumbling.INERTIA
    w1, w2, w3 = now.T
    torque_free = np.column_stack(
        [(two - three) / one * w2 * w3, (three - one) / two * w3 * w1, (one - two) / three * w1 * w2]
    )
    # Differences are of second order: h² of a third derivative of order one.
    assert np.abs((after - before) / (2 * h) - torque_free).max() < 1e-7
    assert np.abs(tumbling.exact(np.zeros(1))[0] - tumbling.START).max() < 1e-12
    # The zero and the period are known to 9 digits.
    assert abs(tumbling.exact(np.array([tumbling.ZERO]))[0, 1]) < 1e-7
    assert np.abs(tumbling.exact(np.array([tumbling.PERIOD]))[0] - tumbling.START).max() < 1e-7


def test_the_line_of_thrust_of_many_stones_is_that_of_milankovitch() -> None:
    # The published figure is one of very many stones: 0.1074779 of 2000, 0.1074762 of 401. Fewer need less.
    assert statics.least_thickness(2000) == pytest.approx(statics.MANY, abs=1e-6)
    assert statics.least_thickness(21) < statics.least_thickness(22) < statics.least_thickness(401) < statics.MANY
    assert statics.least_thickness(21) == pytest.approx(0.10679, abs=1e-5)


def test_the_least_friction_of_thin_cards_is_that_of_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    thick = statics.least_friction()
    monkeypatch.setattr(statics, "THICK", 1e-6)
    thin = statics.least_friction()
    assert thin == pytest.approx(0.5 / math.tan(math.radians(statics.LEAN)), rel=1e-5)
    assert 0.9 * thin < thick < 0.95 * thin


def test_bands_of_run_outs() -> None:
    assert flows.band(2.0) == pytest.approx((2.4, 3.6))
    assert flows.band(1.0) == pytest.approx((1.2, 1.8))
    assert flows.band(4.0) == pytest.approx((1.9 * 4 ** (2 / 3), 2.3 * 4 ** (2 / 3)))


def test_what_slides_and_what_rolls() -> None:
    for angle in (0.1, 0.5, 1.0):
        down = slopes.GRAVITY * math.sin(angle)
        assert slopes.rolling_down(angle, 10.0) == pytest.approx(5 / 7 * down)
        assert slopes.sliding(angle, 0.0) == pytest.approx(down) == slopes.rolling_down(angle, 0.0)
    limit = math.atan(0.5)
    assert slopes.sliding(limit - 1e-9, 0.5) == 0.0 < slopes.sliding(limit + 1e-3, 0.5) < 0.02


# Verdicts


def test_a_figure_holds_within_its_bounds_alone() -> None:
    assert near("x", 1.004, 1.0, 5e-3).holds and not near("x", 1.006, 1.0, 5e-3).holds
    assert near("x", -0.996, -1.0, 5e-3).holds and not near("x", -0.99, -1.0, 5e-3).holds
    assert near("x", 1.1, 1.0, 0.2).deviation == pytest.approx(0.1)
    assert small("x", -0.09, 0.1).holds and not small("x", -0.11, 0.1).holds
    assert within("x", 2.0, 1.0, 3.0).holds and not within("x", 0.5, 1.0, 3.0).holds
    for figure in (near("x", math.nan, 1.0, 1.0), small("x", math.nan, 1.0), within("x", math.nan, 0.0, math.inf)):
        assert not figure.holds


@pytest.mark.parametrize(
    ("right", "wrong", "seen"),
    [
        (slopes.block, partial(slopes.block, 0.45), "block: angle of friction"),
        (slopes.rolling, partial(slopes.rolling, 0.05), "rigid body rolls: acceleration at 25°"),
        (slopes.slipping, partial(slopes.slipping, 0.25), "rigid body: time until it rolls"),
        (blows.cradle, partial(blows.cradle, 0.9), "1 in: height of the lowest ball out"),
        (blows.bounce, partial(blows.bounce, (0.52, 0.8, 0.9)), "rigid body, e = 0.5: time until it rests"),
        (statics.cards, partial(statics.cards, 0.95), "least friction at which it stands"),
        (tumbling.wing_nut, partial(tumbling.wing_nut, (0.012, 1.0, 0.0)), "first zero of ω₂"),
    ],
    ids=["block", "rolling", "slipping", "cradle", "bounce", "cards", "wing-nut"],
)
def test_figures_hold_and_fail_where_the_scene_is_false(
    right: Callable[[], Result], wrong: Callable[[], Result], seen: str
) -> None:
    assert broken(right()) == set()
    assert seen in broken(wrong())


def test_the_page_says_what_does_not_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CASES, "cards", Case("cards", "A card house", partial(statics.cards, 0.95)))
    told: list[tuple[int, int]] = []
    path, lines = page(tmp_path, ["cards"], progress=lambda done, total: told.append((done, total)))
    assert told[0] == (0, 2) and told[-1] == (2, 2)
    html = path.read_text(encoding="utf-8")
    # Friction is a twentieth short, so that it takes a twentieth more.
    assert "<b>2 of 3 figures hold.</b>" in html
    assert "<b>Does not hold:</b> A card house, least friction at which it stands: 0.28" in html
    assert html.count("<b>does not hold</b>") == 1
    assert lines.splitlines()[-1].endswith(
        "2 of 3 figures hold; does not hold: cards: least friction at which it stands"
    )
    assert [row["holds"] for row in table(path)] == ["no", "yes", "yes"]


def test_an_experiment_that_breaks_down_is_told() -> None:
    def explodes() -> Result:
        sheet = {"name": "s", "size": [1, 1], "resolution": [5, 5], "links": {"structural": 1e9}, "pin": ["edge x-"]}
        World({"version": 1, "system": [{"substeps": 1, "integrator": "forward_euler"}], "sheet": [sheet]}).step(100)
        raise AssertionError("it was to explode")

    with pytest.raises(StepError):
        explodes()
    result = run(Case("x", "x", explodes))
    assert broken(result) == {"simulated to its end"} and "broke down" in result.text
    assert text({"x": result}).splitlines()[-1] == "0 of 1 figure holds; does not hold: x: simulated to its end"
    with pytest.raises(SceneError):
        run(Case("x", "x", lambda: World({"version": 1, "body": [{"name": "b"}]})))  # type: ignore[arg-type, return-value]


# The command


def test_some_experiments_from_the_command_line(tumble: Command, tmp_path: Path) -> None:
    answer = tumble("lab", "contact", "--case", "cradle", "--case", "block", "--out", tmp_path / "page")
    assert answer.code == 0
    first, *lines, last = answer.out.splitlines()
    assert first.endswith("contact.html") and last == "12 of 12 figures hold"
    # In the order of the page, whatever the order of the options.
    assert [line.split()[0] for line in lines] == ["block"] * 5 + ["cradle"] * 7
    html = (tmp_path / "page" / "contact.html").read_text(encoding="utf-8")
    assert html.count("<img") == 2 and html.count("<h2>") == 3 and "://" not in html
    rows = table(tmp_path / "page" / "contact.html")
    assert len(rows) == 12
    for row in rows:
        assert float(row["low"]) <= float(row["measured"]) <= float(row["high"]) and row["holds"] == "yes"


def test_a_wrong_case_is_told_with_the_nearest_one(tumble: Command) -> None:
    answer = tumble("lab", "contact", "--case", "hoper", "--case", "arch")
    assert answer.code == 2 and "no case 'hoper'; did you mean hopper?" in answer.err
    answer = tumble("lab", "contact", "--case", "pendulum")
    assert answer.code == 2 and "there are block, rolling, slipping, cradle" in answer.err
    assert not Path("out").exists()


def test_help_of_the_command_says_what_there_is(tumble: Command) -> None:
    answer = tumble("lab", "contact", "--help")
    assert answer.code == 0 and "tumble lab contact --case arch" in answer.out
    assert "contact" in tumble("lab", "--help").out


@pytest.mark.long
def test_all_figures_of_the_page_hold(tmp_path: Path) -> None:
    path, lines = page(tmp_path)
    failed = {row["figure"] for row in table(path) if row["holds"] == "no"}
    assert failed == set(), lines
    assert {row["case"] for row in table(path)} == set(CASES)
    assert path.read_text(encoding="utf-8").count("<img") == len(CASES)


@pytest.mark.long
def test_arch_hopper_and_columns_fail_where_the_scene_is_false() -> None:
    assert "t/R = 0.12: keystone sinks in 1.5 s" in broken(statics.arch(0.85))
    assert any("run-out" in what for what in broken(flows.column(0.0, 0.0)))
