"""How many RSM samples clustered disc lights are made of, and how near they count."""

SAMPLES = 4096
"""Samples at least. A choice: every one is as strong as one of 4,096 points, far below a disc's own noise."""
SAMPLES_OF_DISC = 4
"""Samples for each disc, at least. A choice."""
NORMAL_REACH = 0.7
"""Distance, in L, that counts as much as normals that differ by 1. The best of 0.3, 0.7 and 1.5."""
OFF_PLANE_FACTOR = 8.0
"""How much more an offset from a surface's plane counts than one along it. A choice of 0, 2.8, 8 and 23: the
greatest that made no generated scene worse."""
SAMPLE_REACH = 64.0
"""Footprints of a sample that stand for L where L is longer. A choice of 32, 64 and 128: the least error, by
1 %, in the courtyards of eight generated scenes; in rooms, L is shorter."""

DEFINES = {
    "NORMAL_REACH": NORMAL_REACH,
    "OFF_PLANE_FACTOR": OFF_PLANE_FACTOR,
    "SAMPLE_REACH": SAMPLE_REACH,
}
"""What a shader that includes `common/clustered_discs.glsl` is compiled with."""


def sample_count(vpl_count: int) -> int:
    """RSM samples that `vpl_count` clustered discs are made of."""
    return max(SAMPLES, SAMPLES_OF_DISC * vpl_count)
