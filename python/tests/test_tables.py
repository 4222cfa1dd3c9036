"""Columns over all frames: stacks, pandas, xarray; and runs in notebooks."""

import base64
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import Tree

import tumble
from tumble import ExportError, Run, folder

ROPE: Tree = {
    "version": 1,
    "title": "a rope & more",
    "time": {"fps": 10, "frames": 4},
    "rope": [{"name": "rope", "from": [0, 0, 1], "to": [1, 0, 1], "segments": 5, "pin": ["start"]}],
    "output": {"columns": ["position", "velocity", "link_strain"]},
}
BORN: Tree = {
    "version": 1,
    "time": {"fps": 10, "frames": 6},
    "emitter": [{"name": "e", "rate": 20, "lifetime": 0.25, "from": {"point": {"at": [0, 0, 1]}}}],
}
PLATE: Tree = {
    "version": 1,
    "dimension": 2,
    "time": {"fps": 10, "frames": 2},
    "heat": [
        {
            "name": "h",
            "box": {"size": [0.4, 0.2, 0.2], "resolution": 4},
            "conductivity": 1,
            "density": 1000,
            "heat_capacity": 1000,
            "temperature": "300 + x",
        }
    ],
    "output": {"columns": ["temperature"]},
}


@pytest.fixture
def rope(tmp_path: Path) -> Run:
    return tumble.simulate(ROPE, tmp_path / "rope")


@pytest.fixture
def born(tmp_path: Path) -> Run:
    return tumble.simulate(BORN, tmp_path / "born")


def test_a_stack_is_all_frames(rope: Run) -> None:
    stack = rope.stack("rope", "position")
    whole = np.stack([rope.frame(i)["rope"]["position"] for i in range(5)])
    assert (
        stack.shape == whole.shape == (5, 6, 3) and len(stack) == 5 and stack.unit == "m" and stack.dtype == whole.dtype
    )
    assert (stack.ndim, stack.size) == (whole.ndim, whole.size)
    for index in (
        0,
        -1,
        slice(None),
        slice(1, None, 2),
        (slice(None), -1),
        (2, slice(None), 2),
        (..., 2),
        ([0, 3], 1),
        (),
    ):
        np.testing.assert_array_equal(stack[index], whole[index])
    np.testing.assert_array_equal(np.asarray(stack), whole)
    np.testing.assert_array_equal(np.asarray(stack, dtype=np.float64), whole.astype(np.float64))
    np.testing.assert_array_equal(list(stack), whole)
    assert stack[3:3].shape == (0, 6, 3)
    with pytest.raises(IndexError):
        stack[5]


def test_a_stack_reads_what_is_looked_at(rope: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    own = Run.frame

    def frame(self: Run, i: int) -> folder.Columns:
        read.append(i)
        return own(self, i)

    stack = rope.stack("rope", "velocity")
    monkeypatch.setattr(Run, "frame", frame)
    stack[2, :, 0]
    assert read == [2]
    stack[::2]
    assert read == [2, 0, 2, 4]


def test_names_and_what_has_no_stack(rope: Run, born: Run) -> None:
    for ask, said in (
        (lambda: rope.stack("rop", "position"), "did you mean rope"),
        (lambda: rope.stack("rope", "positon"), "did you mean position"),
        (lambda: rope.stack("rope", "mass"), "no column of"),
        (lambda: born.stack("e", "position"), "come and go"),
    ):
        with pytest.raises(ExportError) as error:
            ask()
        assert said in str(error.value)


def test_pandas(rope: Run, born: Run) -> None:
    pytest.importorskip("pandas")
    books = rope.to_pandas()
    assert books.index.names == ["frame", "time"] and len(books) == 5
    np.testing.assert_array_equal(books["kinetic"], rope.ledger["kinetic"])
    assert books.attrs["units"]["kinetic"] == "J"
    table = rope.to_pandas("rope", ["position", "velocity"])
    assert list(table.columns) == [f"{name}_{axis}" for name in ("position", "velocity") for axis in "xyz"]
    assert table.shape == (30, 6) and table.attrs["units"]["velocity_z"] == "m/s"
    assert table.loc[(3, slice(None), 5), "position_z"].item() == rope.frame(3)["rope"]["position"][5, 2]
    with pytest.raises(ExportError, match=r"different things \(position 6, link_strain 5"):
        rope.to_pandas("rope", ["position", "link_strain"])
    assert rope.to_pandas("rope").equals(table) and "link_strain" in rope.to_pandas("rope", ["link_strain"])
    living = born.to_pandas("e")
    assert living.index.names == ["frame", "time", "id"]
    counts = [len(born.frame(i)["e"]["id"]) for i in range(born.n_frames)]
    assert [int((living.index.get_level_values("frame") == i).sum()) for i in range(7)] == counts and counts[
        0
    ] < counts[-1]
    for ask, said in (
        (lambda: rope.to_pandas("rop"), "did you mean rope"),
        (lambda: rope.to_pandas(columns=["kintic"]), "did you mean kinetic"),
        (lambda: rope.to_pandas("rope", ["positin"]), "did you mean position"),
    ):
        with pytest.raises(ExportError, match=said):
            ask()


def test_xarray(rope: Run, born: Run, tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    data = rope.to_xarray()
    assert data["rope.position"].dims == ("time", "rope.mass", "axis")
    assert data["rope.link_strain"].dims == ("time", "rope.link")
    assert data["rope.position"].attrs["units"] == "m" and data["energy"].attrs["units"] == "J"
    assert data["rope.position"].sel(axis="z", time=0.2).values[-1] == rope.frame(2)["rope"]["position"][-1, 2]
    np.testing.assert_array_equal(data["energy"], rope.ledger["energy"])
    few = rope.to_xarray(["rope"], ["velocity"])
    assert "rope.velocity" in few and "rope.position" not in few
    living = born.to_xarray()
    lives = np.isfinite(living["e.position"].values).all(axis=2).sum(axis=1)
    assert lives.tolist() == [len(born.frame(i)["e"]["id"]) for i in range(7)]
    last = born.frame(-1)["e"]
    one = living["e.position"].sel({"e.id": last["id"][0]}).isel(time=-1)
    np.testing.assert_array_equal(one.values, last["position"][0])
    plate = tumble.simulate(PLATE, tmp_path / "plate").to_xarray()
    assert plate["h.temperature"].dims == ("time", "h.x", "h.y") and plate["h.temperature"].shape[0] == 3
    with pytest.raises(ExportError, match="did you mean rope"):
        rope.to_xarray(["rpe"])
    with pytest.raises(ExportError, match="did you mean velocity"):
        rope.to_xarray(columns=["velocty"])


@pytest.mark.parametrize(("library", "ask"), [("pandas", Run.to_pandas), ("xarray", Run.to_xarray)])
def test_a_library_that_is_not_there_is_named(
    library: str, ask: object, rope: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ExportError, match=rf"needs {library}: pip install 'tumble\[tables\]'"):
        ask(rope)  # type: ignore[operator]


def test_a_run_is_shown_with_picture_plot_and_film(rope: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tumble.pictures._works", lambda name: name == "matplotlib")
    text = rope._repr_html_()
    pictures = [base64.b64decode(data) for data in re.findall(r'src="data:image/png;base64,([^"]*)"', text)]
    assert len(pictures) == 2 and all(data.startswith(b"\x89PNG") and len(data) > 3_000 for data in pictures)
    assert "a rope &amp; more" in text and "5 frames, finished" in text and "<video" not in text
    tumble.film.film(rope, rope.folder / "film.mp4", size=(64, 48), processes=1)
    (film,) = re.findall(r'src="data:video/mp4;base64,([^"]*)"', rope._repr_html_())
    assert base64.b64decode(film) == (rope.folder / "film.mp4").read_bytes()
    monkeypatch.setattr("tumble.notebook.LARGEST", 10)
    assert "<video" not in rope._repr_html_() and "film.mp4" in rope._repr_html_()


def test_what_cannot_be_drawn_is_said_instead(rope: Run) -> None:
    for file in (rope.folder / "frames").iterdir():
        file.write_bytes(b"nothing")
    text = rope._repr_html_()
    assert "damaged" in text and text.count("<img") == 1
