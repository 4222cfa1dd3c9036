"""10,000 people in a hall of 100 m x 100 m who leave by a gate of 20 m, by the collision-free speed model: seconds of a step.

jupedsim runs the third version of the same model from the same places, with the same speeds, radii and step. The check
compares how far people have come towards the gate, and how many have left."""

import sys

import numpy as np
from common import THREADS, median, show

SIDE, GATE = 100.0, 20.0
COUNT = 10_000
SPEED, RADIUS, GAP = 1.2, 0.2, 1.0
STEP = 0.05
STEPS = 20


def places():
    """A lattice, shaken a little."""
    i = np.arange(round(COUNT**0.5))
    x = np.stack(np.meshgrid(i, i, indexing="ij"), -1).reshape(-1, 2) + 0.5
    return 0.98 * x + 1.0 + np.random.default_rng(3).uniform(-0.25, 0.25, x.shape)


def bench_tumble(x):
    import tumble

    low, high = 0.5 * (SIDE - GATE), 0.5 * (SIDE + GATE)
    scene = {
        "version": 1,
        "dimension": 2,
        "plane": "xy",
        "time": {"fps": 1 / (STEPS * STEP)},
        "system": [{"method": "crowd", "step": STEP, "crowd": {"time_gap": GAP}}],
        "plan": [
            {
                "name": "hall",
                "walls": [[[SIDE, high], [SIDE, SIDE], [0, SIDE], [0, 0], [SIDE, 0], [SIDE, low]],
                          [[SIDE, low], [SIDE + 6, low]], [[SIDE, high], [SIDE + 6, high]]],
                "exit": [{"name": "out", "from": [SIDE + 5, low], "to": [SIDE + 5, high]}],
            }
        ],
        "crowd": [
            {
                "name": "people", "position": x.tolist(), "speed": SPEED, "speed_deviation": 0.0, "radius": RADIUS,
                "exit": ["out"],
            }
        ],
    }  # fmt: skip
    world = tumble.World(scene, threads=THREADS)
    seconds = median(lambda: world.step()) / STEPS
    after = world.columns("position")["people"]["position"].astype(float)
    return seconds, after


def bench_jupedsim(x):
    import jupedsim as jps
    from shapely import Polygon

    low, high = 0.5 * (SIDE - GATE), 0.5 * (SIDE + GATE)
    hall = Polygon(
        [(0, 0), (SIDE, 0), (SIDE, low), (SIDE + 6, low), (SIDE + 6, high), (SIDE, high), (SIDE, SIDE), (0, SIDE)]
    )
    simulation = jps.Simulation(model=jps.CollisionFreeSpeedModelV3(), geometry=hall, dt=STEP)
    out = simulation.add_exit_stage([(SIDE + 5, low), (SIDE + 6, low), (SIDE + 6, high), (SIDE + 5, high)])
    journey = simulation.add_journey(jps.JourneyDescription([out]))
    for place in x:
        simulation.add_agent(
            jps.CollisionFreeSpeedModelV3AgentParameters(
                position=tuple(place),
                desired_speed=SPEED,
                radius=RADIUS,
                time_gap=GAP,
                journey_id=journey,
                stage_id=out,
            )
        )
    seconds = median(lambda: simulation.iterate(STEPS)) / STEPS
    return seconds, np.array([agent.position for agent in simulation.agents()])


def check(after):
    return (
        f"{len(after)} left in it, {np.hypot(SIDE - after[:, 0], 0.5 * SIDE - after[:, 1]).mean():.2f} m from the gate"
    )


def main():
    x = places()
    seconds, after = bench_tumble(x)
    show("crowd of 10,000", "tumble", seconds, "s", check(after))
    try:
        seconds, after = bench_jupedsim(x)
    except ImportError:
        print("jupedsim left out", file=sys.stderr)
        return
    show("crowd of 10,000", "jupedsim", seconds, "s", check(after))


main()
