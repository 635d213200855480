"""A small robot on line feet: its legs have no ankle roll."""

from tests.robot.samples import TOML, biped_mjcf

SOLE = '<geom type="box" size="0.1 0.05 0.01" pos="0.02 0 -0.07" mass="1"/>'
LINE_TOML = TOML.replace("[limbs.left_foot]", '[model.locked_joints]\n"*_ankle_roll" = 0.0\n\n[limbs.left_foot]')


def line_biped_mjcf() -> str:
    """The biped of the other tests on capsules along its feet."""
    line = '<geom type="capsule" size="0.02" fromto="-0.08 0 -0.06 0.12 0 -0.06" mass="1"/>'
    return biped_mjcf().replace(SOLE, line)
