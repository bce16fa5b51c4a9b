# SPDX-License-Identifier: Apache-2.0
"""Small models without cameras for tests, as PLY files."""
import math
import random
import struct

FIELDS = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
          "rot_2", "rot_3"]
SIGMA = 0.04
COUNT = 301  # odd: the median is one of them, also where an axis is turned round


def write(path, far_every=0, far=1.0, sigma=SIGMA):
    """Round Gaussians in a box of 1.6 x 0.8 x 0.8. Every far_every-th lies `far` times as far from the middle, with
    another standard deviation."""
    numbers = random.Random(3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {COUNT}",
              *(f"property float {f}" for f in FIELDS), "end_header", ""]
    rows = []
    for i in range(COUNT):
        is_far = far_every > 0 and i % far_every == 0
        at = [(far if is_far else 1) * reach * numbers.uniform(-1, 1) for reach in (0.8, 0.4, 0.4)]
        color = [numbers.uniform(0, 1.5) for _ in range(3)]
        rows.append([*at, *color, 2.0, *[math.log(sigma if is_far else SIGMA)] * 3, 1, 0, 0, 0])
    path.write_bytes("\n".join(header).encode() + b"".join(struct.pack("<14f", *row) for row in rows))
