"""Colours that every drawing shares, in 0..255."""

from __future__ import annotations

from toolkit.geometry.limb import Limb

Color = tuple[int, int, int]

LIMB_COLORS: dict[Limb, Color] = {
    Limb.LEFT_FOOT: (228, 62, 62),
    Limb.RIGHT_FOOT: (72, 184, 72),
    Limb.LEFT_PALM: (40, 196, 208),
    Limb.RIGHT_PALM: (214, 74, 206),
}
FOOT_SURFACE: Color = (70, 150, 230)
PALM_SURFACE: Color = (206, 158, 96)
OTHER_SURFACE: Color = (130, 130, 130)
GOAL: Color = (250, 204, 60)
START: Color = (60, 160, 90)
PREDICTED: Color = (164, 92, 232)
OPTIMISED: Color = (48, 122, 246)
EXECUTED: Color = (255, 136, 0)
LIMIT: Color = (228, 62, 62)
AXES: tuple[Color, Color, Color] = ((228, 80, 80), (90, 190, 90), (90, 140, 240))
RUNS: tuple[Color, ...] = (
    *((255, 136, 0), (48, 122, 246), (72, 184, 72), (214, 74, 206), (40, 196, 208), (228, 62, 62), (250, 204, 60)),
    *((164, 92, 232), (150, 110, 70), (150, 150, 150)),
)
"""Colours of runs that are compared, in turn."""


def unit(color: Color) -> tuple[float, float, float]:
    """The colour in 0..1, as matplotlib needs it."""
    return (color[0] / 255, color[1] / 255, color[2] / 255)
