"""Write MJCF worlds as text."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

THICKNESS = 0.04  # m; generated tiles and platforms are too thin for their edges to count as surfaces for palms
_LEAST_TOP, _BASE = 1e-3, 0.3  # m; height that a height field has at least, and its depth below its lowest point

_HEAD = """<mujoco model="{model}">
  <!-- {comment} -->
  <statistic center="{centre}" extent="{extent}"/>
  <visual>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.45 0.45 0.45" specular="0.1 0.1 0.1"/>
    <rgba haze="0.93 0.95 0.97 1"/>
    <quality shadowsize="4096"/>
    <global azimuth="120" elevation="-25"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.55 0.65 0.75" rgb2="0.95 0.96 0.98" \
width="64" height="384"/>
    <texture name="grid" type="2d" builtin="checker" rgb1="0.42 0.44 0.46" rgb2="0.37 0.39 0.41" width="256" \
height="256"/>
    <material name="abyss" texture="grid" texrepeat="1 1" texuniform="true"/>
    <material name="platform" rgba="0.62 0.65 0.68 1"/>
    <material name="stone" rgba="0.72 0.62 0.50 1"/>
    <material name="slope" rgba="0.76 0.55 0.42 1"/>
    <material name="panel" rgba="0.52 0.62 0.70 1"/>
{assets}  </asset>
{timing}  <default>
    <geom friction="{friction}"/>
    <default class="visual"><geom contype="0" conaffinity="0" group="2"/></default>
  </default>
  <worldbody>
    <light pos="{light}" dir="0.3 0.2 -1" directional="true" diffuse="0.55 0.55 0.55"/>
"""

_TIMING = """  <custom>
    <numeric name="transition_timing" data="{}"/>
  </custom>
"""

_TAIL = """    <site name="start" pos="{start}" euler="0 0 {heading}" size="0.02" rgba="0.2 0.7 0.3 1"/>
    <site name="goal" type="cylinder" pos="{goal}" size="0.2 0.005" rgba="0.95 0.65 0.1 0.5"/>
  </worldbody>
</mujoco>
"""


def numbers(values) -> str:
    """Numbers separated by blanks, rounded to six decimals."""
    rounded = np.round(np.ravel(values), 6) + 0.0  # no -0
    return " ".join(f"{value:.6f}".rstrip("0").rstrip(".") for value in rounded)


@dataclass
class WorldText:
    """A world being written.

    Attributes:
        model: Name of the model in the file.
        comment: What the world is, for a reader of the file.
        friction: Sliding coefficient of all geoms.
        timing: Times of shift and swing, s; None: the planner chooses.
        goal, start: Positions (3,) of the two sites, m.
        abyss: Height of a floor that is only drawn, m; None for no such floor.
        heading: Yaw of the start, deg.
    """

    model: str
    comment: str
    friction: float
    timing: tuple[float, float] | None
    goal: tuple[float, float, float]
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    abyss: float | None = -1.0
    heading: float = 0.0
    _lines: list[str] = field(default_factory=list, repr=False)
    _assets: list[str] = field(default_factory=list, repr=False)

    def box(self, name: str, size, pos, *, material: str = "platform", rotation: Rotation | None = None) -> None:
        """Add a box by its whole extents (3,) m and its centre (3,) m."""
        self._geom(name, "box", size, pos, material, rotation)

    def ellipsoid(self, name: str, size, pos, *, material: str = "stone", rotation: Rotation | None = None) -> None:
        """Add an ellipsoid, which is an obstacle and never a surface, by its diameters (3,) m and its centre (3,) m."""
        self._geom(name, "ellipsoid", size, pos, material, rotation)

    def tile(self, name: str, size, top, *, material: str = "stone", rotation: Rotation | None = None) -> None:
        """Add a thin box by the extents (2,) m and the centre (3,) m of its top; `rotation` is about that centre."""
        turn = rotation or Rotation.identity()
        centre = np.asarray(top, float) - turn.as_matrix()[:, 2] * THICKNESS / 2
        self.box(name, (*size, THICKNESS), centre, material=material, rotation=rotation)

    def platform(self, name: str, x: tuple[float, float], width: float, height: float = 0.0) -> None:
        """Add a level platform between two x, centred on y = 0, its top at `height`, m."""
        self.tile(name, (x[1] - x[0], width), ((x[0] + x[1]) / 2, 0.0, height), material="platform")

    def mesh(
        self, name: str, vertices: np.ndarray, triangles: np.ndarray | None = None, *, material: str = "stone"
    ) -> None:
        """Add a mesh with its vertices (n, 3) m and triangles (k, 3), or their convex hull, written into the file."""
        faces = "" if triangles is None else f'\n      face="{" ".join(str(index) for index in np.ravel(triangles))}"'
        self._assets.append(f'    <mesh name="{name}" vertex="{numbers(vertices)}"{faces}/>\n')
        self._lines.append(f'    <geom name="{name}" type="mesh" mesh="{name}" material="{material}"/>\n')

    def height_field(self, name: str, heights: np.ndarray, spacing: float, corner, *, material: str = "stone") -> None:
        """Add a height field by its heights (nx, ny) m at points `spacing` m apart, the first at `corner` (2,) m."""
        low, top = float(heights.min()), max(float(np.ptp(heights)), _LEAST_TOP)
        half = (np.array(heights.shape) - 1) * spacing / 2
        pos = numbers([*(np.asarray(corner) + half), low])
        elevation = numbers((heights.T[::-1] - low) / top)  # MJCF has the row of the largest y first
        self._assets.append(
            f'    <hfield name="{name}" nrow="{heights.shape[1]}" ncol="{heights.shape[0]}" '
            f'size="{numbers([*half, top, _BASE])}"\n      elevation="{elevation}"/>\n'
        )
        self._lines.append(
            f'    <geom name="{name}" type="hfield" hfield="{name}" pos="{pos}" material="{material}"/>\n'
        )

    def _geom(self, name: str, kind: str, size, pos, material: str, rotation: Rotation | None) -> None:
        """Add a geom by its whole extents (3,) m and its centre (3,) m."""
        turn = ""
        if rotation is not None:
            x, y, z, w = rotation.as_quat()
            turn = f' quat="{numbers([w, x, y, z])}"'
        self._lines.append(
            f'    <geom name="{name}" type="{kind}" size="{numbers(np.asarray(size) / 2)}" pos="{numbers(pos)}"{turn} '
            f'material="{material}"/>\n'
        )

    def render(self) -> str:
        """The MJCF text."""
        start, goal = np.array(self.start), np.array(self.goal)
        middle = (start + goal) / 2
        head = _HEAD.format(
            model=self.model,
            comment=self.comment,
            centre=numbers(middle + [0, 0, 0.6]),
            light=numbers(middle - 4.0 * np.array([0.3, 0.2, -1.0])),
            extent=numbers([0.6 * np.linalg.norm(goal - start) + 1.0]),
            assets="".join(self._assets),
            timing="" if self.timing is None else _TIMING.format(numbers(self.timing)),
            friction=numbers([self.friction]),
        )
        if self.abyss is not None:
            pos = f"0 0 {numbers([self.abyss])}"
            head += f'    <geom class="visual" type="plane" size="0 0 1" pos="{pos}" material="abyss"/>\n'
        return (
            head
            + "".join(self._lines)
            + _TAIL.format(start=numbers(start), goal=numbers(goal), heading=numbers([self.heading]))
        )
