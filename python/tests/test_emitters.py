"""Births and deaths in single precision, where ages are sums that round."""

from typing import Any

import numpy as np
import pytest

import tumble


def world(fps: float, *emitters: dict[str, Any]) -> tumble.World:
    scene = {
        "version": 1,
        "time": {"fps": fps, "frames": 1000},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "verlet", "substeps": 1}],
        "emitter": list(emitters),
    }
    return tumble.World(scene)


@pytest.mark.parametrize(("fps", "lifetime"), [(24, 2.0), (30, 2.0), (30, 3.0), (25, 4.0), (24, 0.5), (60, 10.0)])
def test_a_lifetime_of_whole_frames_ends_with_its_last_frame(fps: float, lifetime: float) -> None:
    there = world(fps, {"name": "p", "from": {"point": {}}, "burst": [{"count": 3}], "lifetime": lifetime})
    frames = round(fps * lifetime)
    there.step(frames - 1)
    assert len(there.frame["p"]["id"]) == 3
    there.step()
    assert len(there.frame["p"]["id"]) == 0


def test_no_child_is_born_twice_or_forgotten() -> None:
    parent = {"name": "p", "from": {"point": {}}, "burst": [{"count": 1}], "velocity": [2, 0, 0]}
    child = {"name": "q", "from": {"particles": {"of": "p"}}, "rate": 24.0}
    there = world(24, parent, child)
    there.step(240)
    places = np.sort(there.frame["q"]["position"][:, 0])
    # Child k is left at the parent's age k/24; a distance of 20 m in single precision is told to 2e-6 m.
    assert np.allclose(places, 2.0 * np.arange(1, 241) / 24, atol=1e-4)


def test_what_breaks_is_named_by_its_id() -> None:
    # Born at 24 a second, alive for 6 frames: the first to pass x = 1 is by then not the first row.
    source = {"name": "p", "from": {"point": {}}, "rate": 24, "lifetime": 0.25, "velocity": ["4*t", 0, 0]}
    scene = world(24, source).scene.to_dict()
    scene["force"] = [{"kind": "acceleration", "value": ["0*sqrt(1 - x)", 0, 0]}]
    with pytest.raises(tumble.StepError, match=r'in emitter "p", the particle with id \d+\.') as failure:
        tumble.World(scene).step(100)
    report = failure.value.report
    assert f"id {report['id']}." in str(failure.value)
    assert report["id"] > 20
    assert report["index"] < 7
