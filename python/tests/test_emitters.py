"""Births and deaths in single precision, where ages are sums that round; and what is told of them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer

import tumble
from tumble import Scene, SceneError, World, emitters

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]


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


# Messages before a run


def emitting(*emitters: dict[str, Any], frames: int = 48, **more: Any) -> dict[str, Any]:
    """A scene of 24 frames a second."""
    return {"version": 1, "time": {"fps": 24, "frames": frames}, "emitter": list(emitters), **more}


POINT = {"name": "p", "from": {"point": {"at": [0, 0, 1]}}}


@pytest.mark.parametrize(
    ("words", "born", "largest"),
    [
        ({"rate": 100}, 200, 200),
        ({"rate": 100, "start": 0.5, "end": 1.25}, 75, 75),
        ({"rate": 100, "lifetime": 0.5}, 200, 50),
        ({"rate": 100, "lifetime": 0.5, "lifetime_spread": 0.9}, 200, 50),
        # Of those born before t = 1 none is left at the end.
        ({"rate": 100, "lifetime": {"keys": [[0, 0.5], [2, 1.5]]}}, 200, 100),
        ({"rate": 100, "lifetime": "0.5 + 0.5*t"}, 200, 100),
        ({"rate": 100, "most": 30}, 200, 30),
        ({"rate": "100*t"}, 200, 200),
        ({"rate": {"keys": [[0, 0], [1, 100]]}}, 150, 150),
        ({"rate": {"keys": [[0, 96], [0.5, 0], [1.0, 48]], "interpolation": "step"}}, 96, 96),
        ({"rate": {"keys": [[0.33, 300], [0.777, 0], [0.9, 50]], "interpolation": "step"}, "start": 0.1}, 258, 258),
        ({"burst": [{"time": 0.5, "count": 70}, {"time": 1.5, "count": 30}, {"time": 3, "count": 9}]}, 100, 100),
        ({"burst": [{"time": 0.5, "count": 70}, {"time": 1.5, "count": 30}], "lifetime": 0.8}, 100, 70),
        ({"rate": 100, "start": 5}, 0, 0),
    ],
)
def test_what_an_emitter_will_hold(words: dict[str, Any], born: int, largest: int) -> None:
    # By hand: rates times times. Sums over a thousandth of 2 s miss at most one piece, 0.2 particles.
    (expected,) = emitters.forecast(tumble.Scene(emitting({**POINT, **words})).to_dict())
    assert (expected.total, expected.largest, expected.known) == (born, largest, True)
    there = tumble.World(emitting({**POINT, **words}))
    counts = []
    for _ in range(48):
        there.step()
        counts.append(len(there.frame["p"]["id"]))
    assert max(counts) == pytest.approx(largest, abs=0.2 * largest if "lifetime_spread" in words else 5)


def test_children_are_counted_where_that_can_be_done() -> None:
    parent = {**POINT, "rate": 10, "lifetime": 0.5}

    def of(**words: Any) -> dict[str, Any]:
        at = words.pop("at", "death")
        return {"name": "q", "from": {"particles": {"of": "p", "at": at}}, **words}

    def child(parent: dict[str, Any], words: dict[str, Any]) -> emitters.Forecast:
        return emitters.forecast(tumble.Scene(emitting(parent, words)).to_dict())[1]

    # 15 of 20 have died after 2 s.
    assert child(parent, of(burst=[{"count": 4}])).total == pytest.approx(60, abs=1)
    # Five at once from 0.5 s on, and half as many on the way there: 2.5/2 + 5 x 1.5 particle seconds.
    assert child(parent, of(rate=8)).total == pytest.approx(8 * (0.5 * 2.5 + 1.5 * 5), abs=1)
    assert child(parent, of(burst=[{"count": 4}])).known
    assert not child(parent, of(at="bounce", burst=[{"count": 4}])).known
    assert not child({**parent, "kill": [{"faster_than": 1}]}, of(burst=[{"count": 4}])).known


STIFF = emitting(
    {**POINT, "from": {"sphere": {"radius": 0.5}}, "burst": [{"time": 0.2, "count": 200}], "mass": 0.001},
    frames=24,
    system=[{"integrator": "velocity_verlet", "substeps": 1}],
    force=[{"kind": "drag", "coefficient": 1.0}],
)


def test_check_judges_particles_that_are_not_yet_born(tumble: Command, scene_file: SceneFile) -> None:
    answer = tumble("check", scene_file(STIFF))
    assert answer.code == 1
    # k/m = 1000/s and a limit of h k/m <= 1 for velocity Verlet: 41.7 ms is 41.7 times too long.
    assert "will explode: 41.7 times the largest stable step" in answer.out
    assert 'emitter    "p": 200 born in 1 s, up to 200 at once' in answer.out
    assert "up to 200 emitted particles" in answer.out
    assert "tracer" not in answer.out and "fine" not in answer.out
    # Of 200 particles 32 bytes each, in 20 of the 25 frames.
    assert "up to 6.4 kB on disk, the run 128 kB" in answer.out
    answer = tumble("check", scene_file(STIFF), "--set", "system.0.substeps=100")
    assert (answer.code, "fine: " in answer.out, "with 200 particles" in answer.out) == (0, True, True)


def test_check_says_what_it_cannot_judge(
    tumble: Command, scene_file: SceneFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tumble.cli.check._WORK", -1.0)
    answer = tumble("check", scene_file(STIFF))
    assert answer.code == 0
    assert "cannot be judged" in answer.out and "not judged (main): tumble run" in answer.out
    assert "fine" not in answer.out and "stable" not in answer.out.split("verdict")[1].splitlines()[0]


def test_check_steps_until_it_breaks(tumble: Command, scene_file: SceneFile) -> None:
    dust = {"name": "dust", "from": {"sphere": {"radius": 1}}, "rate": 500}
    pull = {"kind": "attraction", "gm": 5}
    verlet = {"integrator": "velocity_verlet"}
    scene = emitting(dust, world={"gravity": [0, 0, 0]}, system=[verlet], force=[pull])
    answer = tumble("check", scene_file(scene))
    assert (answer.code, "will break down in frame 5" in answer.out) == (1, True)
    assert "fine" not in answer.out


def test_check_tells_tracers_from_particles(tumble: Command, scene_file: SceneFile) -> None:
    words = {
        "field": [{"kind": "uniform", "velocity": [1, 0, 0]}],
        "system": [{"method": "tracers", "integrator": "rk4"}],
    }
    drops = {"name": "q", "position": [[0, 0, 0]]}
    answer = tumble("check", scene_file(emitting({**POINT, "rate": 10}, particles=[drops], **words)))
    assert answer.code == 0
    assert '"p" (tracers): 20 born in 2 s' in answer.out
    assert '"q": 1 tracer' in answer.out


def test_check_names_the_system_that_moves_an_emitter(tumble: Command, scene_file: SceneFile) -> None:
    flow = {"name": "flow", "method": "tracers", "integrator": "rk4"}
    first = {"name": "soft", "method": "position_based"}
    for systems, tracers in (([first, flow], False), ([flow, first], True)):
        scene = emitting({**POINT, "rate": 10}, system=systems, field=[{"kind": "uniform", "velocity": [1, 0, 0]}])
        # Something for the other system, which would be idle.
        scene["rope"] = [{"name": "r", "from": [5, 0, 0], "to": [6, 0, 0], "segments": 2}]
        answer = tumble("check", scene_file(scene))
        assert f'"p"{" (tracers)" if tracers else ""}: 20 born in 2 s' in answer.out, answer


def test_check_says_who_is_never_born(tumble: Command, scene_file: SceneFile) -> None:
    late = {**POINT, "burst": [{"time": 50, "count": 9}]}
    answer = tumble("check", scene_file(emitting(late)))
    assert '"p": 0 born in 2 s, the first after 50 s' in answer.out
    assert "no particle is born within the duration of the scene" in answer.out
    assert answer.code == 0 and "fine" not in answer.out and "stable\n" not in answer.out


@pytest.mark.parametrize("verb", ["check", "run"])
def test_too_much_memory_is_laid_at_an_emitter(tumble: Command, scene_file: SceneFile, verb: str) -> None:
    few = {**POINT, "name": "few", "rate": 10}
    answer = tumble(verb, scene_file(emitting(few, {**POINT, "rate": 1e12})))
    assert answer.code == 2
    assert "memory_limit" in answer.err and 'emitter "p" alone asks for 2e+12 particles' in answer.err


def test_a_run_ends_with_how_many_there_were(tumble: Command, scene_file: SceneFile) -> None:
    fading = {**POINT, "rate": 24, "lifetime": 0.25}
    answer = tumble("run", scene_file(emitting(fading, {**POINT, "name": "q", "burst": [{"count": 7}]})), "--no-plot")
    assert answer.code == 0
    # One a frame for two seconds, each there for six frames.
    assert 'particles: "p" 48 born, 6 alive; "q" 7 born, 7 alive at the end' in answer.out
    many = [{**fading, "name": f"p{i}", "start": 9 if i == 3 else 0} for i in range(5)]
    answer = tumble("run", scene_file(emitting(*many)), "--no-plot", "--force")
    assert 'particles: of 5 emitters 192 born, "p3" never, 24 alive at the end' in answer.out


def test_the_lab_refuses_emitters_and_says_what_to_do(tumble: Command, scene_file: SceneFile) -> None:
    still = {"name": "q", "position": [[0, 0, 0]], "velocity": [[1, 0, 0]]}
    answer = tumble("lab", "integrators", scene_file(emitting({**POINT, "rate": 10}, particles=[still])))
    assert answer.code == 2
    assert 'emitter "p": the lab compares' in answer.err and "[[particles]]" in answer.err
    assert not list(Path("out").glob("lab/*"))


def test_speed_and_cone_are_those_of_the_time_of_birth() -> None:
    tree = {
        "version": 1,
        "world": {"gravity": [0, 0, 0]},
        "time": {"fps": 24, "frames": 24},
        "emitter": [
            {
                "name": "jet",
                "from": {"point": {"at": [0, 0, 0]}},
                "rate": 500,
                "direction": [1, 0, 0],
                "speed": {"keys": [[0, 1], [1, 3]]},
                "cone": "60*t",
            }
        ],
    }
    world = World(Scene(tree))
    world.step(24)
    jet = world.frame["jet"]
    born = 1.0 - jet["age"]
    speed = np.linalg.norm(jet["velocity"], axis=1)
    assert len(speed) > 400
    assert np.allclose(speed, 1 + 2 * born, atol=1e-4)
    angle = np.degrees(np.arccos(np.clip(jet["velocity"][:, 0] / speed, -1, 1)))
    assert (angle <= 60 * born + 0.05).all()
    # Late ones fill their cone.
    assert angle[born > 0.9].max() > 50
    with pytest.raises(SceneError, match=r"cone: .* at t = .*, expected 0 to 180"):
        World(Scene({**tree, "emitter": [{**tree["emitter"][0], "cone": {"keys": [[0, 0], [0.5, 200]]}}]}))  # type: ignore[index,dict-item]


def test_check_has_the_words_of_each_method(tumble: Command) -> None:
    for scene, words in (
        ("crowd/office", '"floor": 98 corners'),
        ("grains/hopper", '"gravel": 2280 grains'),
        ("liquid/dam", '"water": 14080 particles'),
        ("vicsek", '"walkers": 300 particles'),
    ):
        assert words in tumble("check", scene).out
