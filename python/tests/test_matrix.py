"""Ten scenes that ship have the same bits on 1, 2 and 8 threads, restored, and as WebAssembly; `make validate` does all."""

from dataclasses import replace
from pathlib import Path

import matrix
import numpy as np
import pytest
from needs import missing

from tumble import World, _engine


@pytest.mark.parametrize("kind", list(matrix.TEN))
def test_a_scene_has_the_same_bits_everywhere(kind: str, tmp_path: Path) -> None:
    case = matrix.TEN[kind]
    row, checkpoints = matrix.native(case, tmp_path)
    ways = {"2 threads", "8 threads", "restored"}
    if matrix.why_no_wasm() is None:
        matrix.wasm([(row, checkpoints)])
        ways |= {"wasm", "native to wasm"}
    assert len(row.reference) == case.frames + 1
    assert row.ways == dict.fromkeys(ways, "same") and row.good, str(row)


def test_native_bits_are_the_same_on_any_count_of_threads_and_restored(tmp_path: Path) -> None:
    case = replace(matrix.NATIVE[0], frames=2)
    row, _ = matrix.native(case, tmp_path)
    assert row.ways == dict.fromkeys(["2 threads", "8 threads", "restored"], "same") and row.good, str(row)
    portable = World(matrix.scene_of(replace(case, bits="portable")))
    if _engine.instructions in ("avx2", "avx512"):  # Else there is but one arithmetic.
        assert matrix.states(portable, 2)[1:] != row.reference[1:]


def test_webassembly_was_there() -> None:
    if lacking := matrix.why_no_wasm():
        missing(lacking)


def test_a_single_bit_is_seen(tmp_path: Path) -> None:
    case = matrix.Case("structures/rope", 6, 2)
    row, checkpoints = matrix.native(case, tmp_path)
    assert row.good and len(checkpoints) == 2

    def touch(world: World) -> None:
        if world.frame_index == 3:
            place = world.columns("position")["rope"]["position"]
            place[-1, 2] = np.nextafter(place[-1, 2], np.float32(9))
            world.write("rope", "position", place)

    row.note("touched", matrix.states(World(matrix.scene_of(case)), 6, touch))
    row.note("short", row.reference[:5])
    row.note("restored", [*row.reference[4:6], "0" * 16], 4)
    assert row.ways["touched"] == "differs at frame 4" and row.ways["short"] == "differs at frame 5"
    assert row.ways["restored"] == "differs at frame 6"
    assert not row.good and "touched: differs at frame 4" in str(row)
    still = matrix.Row(case, ["a", "a"], {"2 threads": "same"})
    assert not still.good and "DOES NOT MOVE" in str(still)


def test_webassembly_that_does_something_else_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if lacking := matrix.why_no_wasm():
        missing(lacking)
    case = matrix.Case("structures/rope", 3, 1)
    row, checkpoints = matrix.native(case, tmp_path)
    monkeypatch.setattr(matrix, "_overrides", lambda _: ['bits="portable"', "force.0.rate=0.2000001"])
    matrix.wasm([(row, checkpoints)])
    assert row.ways["wasm"] == "differs at frame 1" and row.ways["native to wasm"] == "differs at frame 3"


def test_every_scene_is_in_the_long_matrix() -> None:
    names = {case.name for case in matrix.every_scene()}
    assert names >= {case.name for case in matrix.TEN.values()} | matrix.SLOW
    assert len(names) >= 49
