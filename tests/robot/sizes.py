"""Robots of other sizes that move like the usual one."""

from tests.robot.samples import write_scaled
from tests.shipped_robots import OWN
from toolkit.robot.loader import load_robot

SIZES = (  # factors on length and mass: a robot of 3 kg, and a giant of 544 kg
    (0.5, 3.0 / 68.0),
    (2.0, 8.0),
)


def label(size):
    """A name of a size for tests."""
    return f"length {size[0]:g}"


def sized_robot(folder, size):
    """The usual robot made larger or smaller; the folder is a place for its files."""
    return load_robot(str(write_scaled(folder / "robot", OWN[0], *size)))
