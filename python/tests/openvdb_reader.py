"""Content of a file as read by OpenVDB, for tests; run by the system's python3, which has Debian's python3-openvdb.

`openvdb_reader.py FILE.vdb OUT.npz INDEX...` writes for each grid the values in the box of voxels that starts at the
first three indices and is as long as the last three say.
"""

import sys

import numpy as np

try:
    import pyopenvdb as vdb
except ImportError:
    import openvdb as vdb

if __name__ == "__main__":
    source, goal, *numbers = sys.argv[1:]
    box = [int(n) for n in numbers]
    low, size = box[:3], box[3:]
    out = {}
    for grid in vdb.readAll(source)[0]:
        vector = isinstance(grid, vdb.Vec3SGrid)
        values = np.zeros((*size, 3) if vector else size, dtype=np.float32)
        grid.copyToArray(values, ijk=tuple(low))
        active = np.zeros(size, dtype=bool)
        for run in grid.citerOnValues():
            first, last = (np.array(c) - low for c in (run.min, run.max))
            active[tuple(slice(a, b + 1) for a, b in zip(first, last))] = True  # noqa: B905
        name = grid.name
        out[f"{name}/values"] = values
        out[f"{name}/active"] = active
        out[f"{name}/background"] = np.array(grid.background, dtype=np.float32)
        out[f"{name}/places"] = np.array([grid.transform.indexToWorld(p) for p in ((0, 0, 0), (1, 0, 0), (-5, 7, 11))])
        out[f"{name}/counts"] = np.array([grid.activeVoxelCount(), grid.leafCount(), len(list(grid.citerOnValues()))])
        box = grid.evalActiveVoxelBoundingBox()
        out[f"{name}/extent"] = np.array(box)
        bounds = [grid.metadata.get(k, ((0, 0, 0))) for k in ("file_bbox_min", "file_bbox_max")]
        out[f"{name}/noted_extent"] = np.array(bounds)
        words = [grid.gridClass, grid.valueTypeName, grid.metadata["unit"], grid.vectorType, str(grid.saveFloatAsHalf)]
        out[f"{name}/words"] = np.array([*words, grid.metadata["file_compression"]])
    np.savez(goal, **out)
