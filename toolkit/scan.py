"""Command line: meshes, point clouds and height maps into a world."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from toolkit import cli

DESCRIPTION = """\
Turn what a scanner, a survey or a CAD program gives into a world.

Flat patches are found, whatever the noise (up to 2 cm) and small holes; they become plates that feet and palms can use.
What is rough becomes obstacles. Meshes without noise are taken as they are. The other commands take the world from
there; look at it first: the recording shows the surfaces that were found under the input.
"""

EPILOG = """\
examples:
  python -m toolkit.scan rubble.ply --start 0,0 --goal 3.4,0 --friction 0.6
  python -m toolkit.scan hall.glb stairs.obj --scale 0.001 --out worlds/hall
  python -m toolkit.scan terrain.png --cell 0.02 --scale 0.0001
  python -m toolkit.validate scans/rubble/rubble.xml

files: meshes (obj, stl, ply, glb, gltf, off), point clouds (ply, pcd) and height maps (png, tif, npy). PCD and GeoTIFF
need more packages: pip install 'humanoid-contact-toolkit[scan]'. Several files are parts of one scene. In height maps
the lower left corner is at x = y = 0 and the first row has the largest y; in arrays NaN stands for a hole.

written into the output folder, under the name of the first file: NAME.xml, the world; NAME.rrd, for the rerun viewer
"""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("scan", DESCRIPTION, EPILOG)
    parser.add_argument("files", type=cli.path, nargs="+", metavar="FILE", help="mesh, point cloud or height map")
    parser.add_argument(
        "--start",
        type=_place(2, 3),
        metavar="X,Y[,YAW]",
        help="start in m, and heading in degrees; --start=-1,0 where it begins with a minus (default: one end of the "
        "longest way between places on level ground, facing the goal)",
    )
    parser.add_argument(
        "--goal", type=_place(2, 2), metavar="X,Y", help="goal in m (default: as far from the start as can be)"
    )
    parser.add_argument(
        "--friction", type=cli.positive(float, 10.0), default=0.5, metavar="MU", help="friction (default: %(default)s)"
    )
    parser.add_argument(
        "--timing",
        type=_timing,
        metavar="SHIFT,SWING",
        help="seconds of shifting the CoM and of moving the limb (default: the planner chooses)",
    )
    parser.add_argument(
        "--scale",
        type=cli.positive(float, 1e6),
        metavar="M",
        help="metres per unit of length, or of height in height maps (default: 1; needed for png)",
    )
    parser.add_argument("--up", choices=("z", "y"), help="axis that points up (default: y for glb and gltf, else z)")
    parser.add_argument(
        "--cell",
        type=cli.positive(float, 1e3),
        metavar="M",
        help="metres between the heights of a map (needed for png and npy)",
    )
    parser.add_argument(
        "--origin",
        type=_place(3, 3),
        default=(0.0, 0.0, 0.0),
        metavar="X,Y,Z",
        help="point in m that becomes the origin",
    )
    parser.add_argument("--out", type=cli.path, metavar="DIR", help="folder to write into (default: scans/NAME)")
    return parser


_FARTHEST = 1e9  # m or degrees; farther than any coordinate of a survey


def _place(least: int, most: int):
    """An argparse type: numbers with commas between them."""

    def place(text: str) -> tuple[float, ...]:
        try:
            values = tuple(float(part) for part in text.split(","))
        except ValueError:
            values = ()
        if not least <= len(values) <= most or not all(abs(value) <= _FARTHEST for value in values):
            raise argparse.ArgumentTypeError(
                f"{text!r} is not {least}{f' or {most}' * (most > least)} numbers with commas, "
                f"each at most {_FARTHEST:g}"
            )
        return values

    return place


def _timing(text: str) -> tuple[float, float] | None:
    """An argparse type: times of shift and swing in s; None for auto."""
    found = cli.timing(text)
    return None if isinstance(found, str) else (found[0].shift, found[0].swing)


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: a file cannot be read or used, or the folder cannot be written.
        WorldError: what was found makes no world.
    """
    args = arguments().parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from rich.progress import Progress

    from toolkit.drafts import write_whole
    from toolkit.report.console import make_console
    from toolkit.scanning.building import read_scene
    from toolkit.scanning.files import ReadOptions, read_scan
    from toolkit.scanning.world import ScanConfig, make_world

    console = make_console()
    name = args.files[0].stem
    folder = args.out or Path("scans") / name
    start = args.start if args.start is None else (*args.start[:2], *(math.radians(yaw) for yaw in args.start[2:]))
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("scan", total=1.0)
        options = ReadOptions(args.scale, args.up, args.cell, args.origin)
        scans = [read_scan(path, options) for path in args.files]
        bar.update(task, completed=0.1)
        scene = read_scene(scans, progress=lambda share: bar.update(task, completed=0.1 + 0.5 * share))
        config = ScanConfig(args.friction, args.timing, start, args.goal)
        made = make_world(scene, folder / f"{name}.xml", "made of a scan by python -m toolkit.scan", config)
    from toolkit.report.scan import scan_table, write_scan_recording

    console.print(scan_table(made))
    write_whole(folder / f"{name}.xml", made.text.encode())
    write_scan_recording(folder / f"{name}.rrd", made)
    console.print(f"written to {folder}: {name}.xml, {name}.rrd", soft_wrap=True, markup=False)
    return 0


if __name__ == "__main__":
    cli.run(main)
