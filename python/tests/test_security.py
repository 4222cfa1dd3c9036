"""Files of others: formulas compute and do nothing else, names do not lead out of folders, archives hold numbers.

What `tumble view` serves, and to whom, is in test_view.py; links and files of the laboratory are in web/tests/share.test.ts;
bytes that are no meshes in crates/tumble-io/tests/fuzz.rs.
"""

import json
import os
import pickle
import re
import zipfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from counts import FACTOR, note
from hypothesis import given, settings
from hypothesis import strategies as st
from runs import OBJECT, Tree, repack

import tumble as package
from tumble import ExportError, Run, Scene, SceneError, TumbleError, World
from tumble.export import file_names
from tumble.run import simulate

Command = Callable[..., Answer]

# Formulas


def blown(formula: str) -> Tree:
    air = [{"kind": "formula", "velocity": formula}]
    particles = [{"name": "p", "position": [[0, 0, 1]]}]
    return {"version": 1, "particles": particles, "force": [{"kind": "wind", "rate": 1, "air": air}]}


@pytest.mark.parametrize(
    "formula",
    [
        "__import__('os').system('touch hit')",
        "[0, 0, open('hit', 'w')]",
        "[0, 0, exec(x)]",
        "[0, 0, eval(x)]",
        "[0, 0, x.real]",
        "[0, 0, x[0]]",
        "[0, 0, 'x']",
        "[0, 0, 1; 2]",
        "[0, 0, `touch hit`]",
        "[0, 0, $(touch hit)]",
        "[0, 0, lambda: 1]",
        "[0, 0, x if y else z]",
        "[0, 0, while(1, 1)]",
        "[0, 0, sum(x)]",
        "[0, 0, a = 1]",
        "[0, 0, {}]",
        "[0, 0, \0]",
        "[0, 0, 9^9^9^9^9]",
        "[0, 0, 1e999]",
        "[0, 0, " + "(" * 100_000 + "x" + ")" * 100_000 + "]",
        "[0, 0, " + "sin(" * 100_000 + "x" + ")" * 100_000 + "]",
        "[0, 0, " + "-" * 100_000 + "x]",
        "[0, 0, " + "x^" * 100_000 + "x]",
        "[0, 0, " + "(" * 490 + "x" + ")" * 490 + "]",
        "[0, 0, " + "x^" * 490 + "x]",
    ],
    ids=lambda formula: formula[:24].strip("\0"),
)
def test_formulas_that_are_more_than_numbers_are_refused(
    formula: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        World(Scene(blown(formula))).step()
    except SceneError as error:
        assert "velocity" in str(error) and len(str(error)) < 1000
    else:
        # Nested as deep as a formula may be; the numbers are those of the formula.
        assert len(formula) <= 1000 and set(formula) <= set("[0, ]()x^")
    assert not list(tmp_path.iterdir())


WORDS = ["t", "x", "y", "z", "vx", "vy", "vz", "pi", "e", "0", "1", "2.5", "1e300", "+", "-", "*", "/", "^", "(", ")"]
WORDS += [
    "[",
    "]",
    ",",
    "sin",
    "exp",
    "log",
    "sqrt",
    "pow",
    "min",
    "if",
    "while",
    "'",
    '"',
    ";",
    ".",
    "=",
    "\\",
    "_",
    "é",
]


def test_any_formula_is_refused_or_computed() -> None:
    ends: Counter[str] = Counter()

    @settings(max_examples=max(round(300 * FACTOR), 1), deadline=None)
    @given(st.lists(st.sampled_from(WORDS), max_size=40))
    def try_one(words: list[str]) -> None:
        for formula in (" ".join(words), f"[0, 0, {' '.join(words)}]"):
            try:
                World(Scene(blown(formula))).step()
                ends["computed"] += 1
            except TumbleError as error:
                assert str(error)
                ends["refused"] += 1

    try_one()
    assert ends["refused"] > ends["computed"] > 0
    note("random cases", "formulas", cases=ends.total(), **ends)


def test_nothing_of_the_package_runs_text() -> None:
    runs = re.compile(
        r"\b(?:eval|exec|os\.system|os\.popen|marshal|pickle\.loads?|yaml|runpy)\b|shell=True|allow_pickle"
    )
    files = list(Path(package.__file__).parent.rglob("*.py"))
    assert len(files) > 50
    assert [f"{f.name}: {hit[0]}" for f in files if (hit := runs.search(f.read_text(encoding="utf-8")))] == []


# Archives


class Trap:
    """Writes a file when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.mkdir, ("hit",))


def test_archives_with_objects_in_them_are_damaged_ones(
    spring: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: Run
) -> None:
    monkeypatch.chdir(tmp_path)
    trap = np.array([Trap()], dtype=object)
    pickle.loads(pickle.dumps(trap))  # It does bite.
    Path("hit").rmdir()
    path = reference.folder / "frames/000003.npz"
    repack(path, {f"{OBJECT}/position": trap, "static": trap})
    np.savez(reference.folder / "static.npz", **{f"{OBJECT}/mass": trap})
    with pytest.raises(ExportError, match=r"000003\.npz: is damaged"):
        reference.frame(3)
    with pytest.raises(ExportError, match=r"static\.npz: is damaged"):
        _ = Run(reference.folder).static
    path.write_bytes(pickle.dumps(trap))
    with pytest.raises(ExportError, match=r"000003\.npz: is damaged"):
        reference.frame(3)
    with pytest.raises(SceneError):
        World.restore(path)
    assert not Path("hit").exists()


@pytest.mark.parametrize(
    "name", ["../../evil", "/tmp/evil", "..", ".", "a/../../../b", "..\\..\\evil", "C:evil", "~/evil", "-rf"]
)
def test_names_in_archives_do_not_lead_out_of_the_folder(
    name: str, tmp_path: Path, tumble: Command, spring: Tree
) -> None:
    """A run that came from elsewhere, whose objects have names that no scene may have."""
    home = tmp_path / "a" / "b"
    spring["particles"].append({"name": "dust", "position": [[0, 0, 1], [0, 1, 1]]})
    run = simulate(spring, home / "run", frames=2)
    for path in run.folder.rglob("*"):
        if path.suffix in (".json", ".csv"):
            path.write_text(path.read_text().replace('"dust"', json.dumps(name)))
        elif path.suffix == ".npz":
            with np.load(path) as archive:
                arrays = {key.replace("dust/", f"{name}/"): archive[key] for key in archive.files}
            repack(path, arrays)
    assert name in Run(run.folder).frame(1)
    before = {f for f in tmp_path.rglob("*") if not f.is_relative_to(run.folder)}
    for kind in ("--ply", "--usd", "--npz"):
        answer = tumble("export", run.folder, kind)
        assert answer.code in (0, 1, 2) and "Traceback" not in answer.err, (kind, answer)
    after = {f for f in tmp_path.rglob("*") if not f.is_relative_to(run.folder)}
    assert after == before
    assert not Path("/tmp/evil").exists()
    assert len(list(run.folder.glob("ply/*.ply"))) in (3, 6)


@settings(max_examples=200)
@given(st.lists(st.text(min_size=1, max_size=12), unique=True, max_size=6))
def test_names_of_files_are_plain_and_stay_apart(names: list[str]) -> None:
    found = file_names(names)
    assert len(set(found.values())) == len(names)
    assert all(re.fullmatch(r"[\w-]+", stem) for stem in found.values())


def test_scenes_give_no_object_a_name_with_a_way_in_it(spring: Tree, tmp_path: Path) -> None:
    for name in ("../../evil", "/evil", "a/b", ""):
        spring["particles"][0]["name"] = name
        with pytest.raises(SceneError, match="a name that is not empty and has no slash"):
            World(Scene(spring))
    spring["particles"][0]["name"] = "p\0q"
    with pytest.raises(TumbleError, match="NUL"):
        simulate(spring, tmp_path / "run", frames=1)


def test_members_of_archives_are_never_unpacked_to_files() -> None:
    unpacks = re.compile(r"\.extract(?:all)?\(|unpack_archive|tarfile")
    files = list(Path(package.__file__).parent.rglob("*.py"))
    assert [f.name for f in files if unpacks.search(f.read_text(encoding="utf-8"))] == []


def test_a_usdz_whose_members_lead_out_writes_nothing(tmp_path: Path) -> None:
    home = tmp_path / "a" / "b"
    home.mkdir(parents=True)
    mesh = (
        "point3f[] points = [(0,0,0),(1,0,0),(0,1,0)]\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0,1,2]"
    )
    layer = f'#usda 1.0\ndef Mesh "m" {{\n{mesh}\n}}\n'
    with zipfile.ZipFile(home / "evil.usdz", "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("../../evil.usda", layer)
        archive.writestr("/tmp/tumble-evil.usda", layer)
    with suppress(SceneError):
        package.load_mesh(home / "evil.usdz")
    assert {f.name for f in tmp_path.rglob("*") if f.is_file()} == {"evil.usdz"}
    assert not Path("/tmp/tumble-evil.usda").exists()


def test_meshes_in_gltf_come_from_the_file_itself(tmp_path: Path) -> None:
    (tmp_path / "points.bin").write_bytes(np.zeros(9, "<f4").tobytes())
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "points.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    for ending in ("gltf", "glb"):
        for uri in ("points.bin", "../points.bin", "/etc/hostname", "http://127.0.0.1:1/x", "file:///etc/hostname"):
            tree["buffers"][0]["uri"] = uri  # type: ignore[index]
            path = tmp_path / f"mesh.{ending}"
            text = json.dumps(tree).encode()
            text += b" " * (-len(text) % 4)
            head = b"glTF" + np.array([2, 20 + len(text), len(text), 0x4E4F534A], "<u4").tobytes()
            path.write_bytes(text if ending == "gltf" else head + text)
            with pytest.raises(SceneError):
                package.load_mesh(path)
