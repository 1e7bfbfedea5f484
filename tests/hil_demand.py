"""What the test controllers ask for at a step.  Imports nothing of usv_gym: control processes use it too."""

import random


def demand(step):
    """rpm of starboard, port, bow; nozzle and bucket of starboard, port; each in [-1, 1]."""
    draw = random.Random(step)
    return [round(draw.uniform(-1, 1), 4) for _ in range(7)]
