"""Worlds written on the spot."""

from pathlib import Path

import numpy as np

from toolkit.world.loader import load_world


def box(centre, half, euler=(0, 0, 0), friction=0.7):
    """A box geom as MJCF."""
    centre, half, euler = (" ".join(f"{v:.6g}" for v in values) for values in (centre, half, euler))
    return f'<geom type="box" pos="{centre}" size="{half}" euler="{euler}" friction="{friction}"/>'


def make_world(*geoms, start=(0, 0, 0), goal=(1.5, 0, 0), radius=0.2, timing="1 1", heading=0.0):
    """A world of geoms (MJCF); the heading is in degrees, and no timing leaves that to the planner."""
    custom = "" if timing is None else f'<custom><numeric name="transition_timing" data="{timing}"/></custom>'
    mjcf = f"""<mujoco>{custom}<worldbody>
      <site name="start" pos="{start[0]} {start[1]} {start[2]}" euler="0 0 {heading}"/>
      <site name="goal" type="cylinder" pos="{goal[0]} {goal[1]} {goal[2]}" size="{radius} 0.01"/>
      {"".join(geoms)}</worldbody></mujoco>"""
    return load_world(Path("made.xml"), mjcf=mjcf)


FLOOR = '<geom type="plane" size="0 0 1" friction="0.7"/>'


def corridor(seed, mirrored=False):
    """Tilted tiles between walls of tilted panels; the mirror image swaps left and right."""
    rng = np.random.default_rng(seed)
    sign = -1 if mirrored else 1
    geoms = [box([0, 0, -0.05], [0.5, 0.5, 0.05]), box([2.5, 0, -0.05], [0.7, 0.5, 0.05])]
    for x in (0.7, 1.1, 1.5):
        for y in (-0.3, 0.0, 0.3):
            roll, pitch = rng.uniform(-12, 12, 2)
            z = rng.uniform(-0.03, 0.03)
            geoms.append(box([x, sign * y, z - 0.05], [0.195, 0.145, 0.05], [sign * roll, pitch, 0]))
    for x in np.arange(-0.4, 3.0, 0.5):
        for y in (-0.65, 0.65):
            pitch, yaw = rng.uniform(-8, 8, 2)
            geoms.append(box([x, sign * y, 1.2], [0.2, 0.02, 0.35], [sign * pitch, 0, sign * yaw]))
    return make_world(*geoms, goal=(2.3, 0, 0))
