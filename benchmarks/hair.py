"""Hair on a ball that turns: 1,000 to 10,000 strands of 32 points, a frame of 1/24 s in 16 sub-steps, with contact and with
what the strands do to each other. There is no peer in it: what is shown is that the cost grows with the count of strands and no
faster."""

from common import THREADS, median, show

SEGMENTS = 31
SUBSTEPS = 16
COUNTS = (1000, 3000, 10_000)


def scene(strands):
    return {
        "version": 1,
        "time": {"fps": 24},
        "system": [{"method": "position_based", "substeps": SUBSTEPS}],
        "force": [{"kind": "drag", "rate": 1.0}],
        "collider": [
            {
                "name": "head",
                "thickness": 0.002,
                "friction": 0.3,
                "shape": {"sphere": {"radius": 0.1}},
                "motion": {"spin": [0.0, 0.0, 3.0]},
            }
        ],
        "hair": [
            {
                "name": "hair",
                "on": "head",
                "count": strands,
                "length": 0.25,
                "segments": SEGMENTS,
                "curl": {"radius": 0.01, "pitch": 0.05},
                "damping": 0.002,
                "collisions": {"cell": 0.01, "friction": 5.0, "pressure": 0.2},
            }
        ],
    }


def main():
    import tumble

    costs = []
    for strands in COUNTS:
        world = tumble.World(scene(strands), threads=THREADS)
        seconds = median(world.step, repeats=7)
        costs.append(seconds / (strands * SEGMENTS * SUBSTEPS))
        stretch = world.ledger["stretch"]
        check = f"a frame of {SUBSTEPS} sub-steps; stretch at most {stretch:.4f}"
        show(f"hair {strands} x {SEGMENTS + 1}", "tumble", seconds, "s", check)
    show("hair, a segment", "tumble", costs[-1], "s", f"and sub-step, with {COUNTS[-1]} strands")
    show("hair, a segment", "the smallest", costs[0], "s", f"{COUNTS[0]} strands")


main()
