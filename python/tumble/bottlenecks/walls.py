"""Plans with an opening made wider."""

from collections.abc import Mapping
from typing import Any

import numpy as np

NEAR = 0.02
"""A wall that ends so near to a jamb ends there [m]."""


def widened(plan: Mapping[str, Any], name: str, by: float) -> dict[str, Any] | None:
    """The plan with a gate wider by so much [m], half of it at each jamb; None where no wall ends at a jamb."""
    key, k = next((key, k) for key in ("door", "exit") for k, gate in enumerate(plan[key]) if gate["name"] == name)
    gate, scale = plan[key][k], float(plan["scale"])
    jambs = np.array([gate["from"], gate["to"]], float)
    along = (jambs[1] - jambs[0]) / np.hypot(*(jambs[1] - jambs[0]))
    new = jambs + np.array([-0.5, 0.5])[:, None] * (by / scale) * along
    walls, moved = [], set()
    for wall in plan["walls"]:
        points = []
        for point in wall:
            far = np.hypot(*(jambs - np.array(point, float)).T) * scale
            side = int(far.argmin())
            if far[side] <= NEAR:
                moved.add(side)
                points.append(list(map(float, np.array(point) + new[side] - jambs[side])))
            else:
                points.append(point)
        walls.append(points)
    if moved != {0, 1}:
        return None
    # Other gates that share a jamb keep it.
    changed = [dict(each) for each in plan[key]]
    changed[k] = {**gate, "from": list(map(float, new[0])), "to": list(map(float, new[1]))}
    return {**plan, "walls": walls, key: changed}
