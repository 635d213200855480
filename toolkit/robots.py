"""Command line: list the robots, or picture one.

python -m toolkit.robots                               all robots in a table
python -m toolkit.robots NAME                          one robot: limbs, legs, arms, joints
python -m toolkit.robots NAME --picture OUT.png        its home posture, rendered off screen
python -m toolkit.robots --inspect FILE --out FOLDER   a model that is no robot yet: its tree, and a draft robot.toml
"""

from __future__ import annotations

import typing
from pathlib import Path

from toolkit import cli

EPILOG = """\
examples:
  python -m toolkit.robots --inspect my_robot.urdf --out robots/my_robot
  python -m toolkit.robots --inspect example-robot-data:g1_description/urdf/g1_29dof_rev_1_0.urdf
"""

if typing.TYPE_CHECKING:
    from rich.console import Console

    from toolkit.robot.model import RobotModel


def main(argv: list[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: words after the program's name; those of the process where None.

    Returns:
        Exit code: 0; 1 where a draft cannot be loaded yet; 2 where a listed robot cannot be loaded.

    Raises:
        ToolkitError: bad input, or no way to render.
    """
    parser = cli.parser("robots", "List the robots, describe one, picture one, or draft a new one.", EPILOG)
    parser.add_argument("name", nargs="?", help="a robot's name or folder; all robots where left out")
    parser.add_argument("--picture", type=cli.path, metavar="OUT.png", help="render the home posture into this file")
    parser.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")
    parser.add_argument(
        "--inspect",
        metavar="MODEL",
        help="print the tree of a model and draft a robot.toml: an MJCF or URDF file, PACKAGE, PACKAGE:FILE, or "
        "robot_descriptions:MODULE",
    )
    parser.add_argument("--out", type=cli.path, metavar="FOLDER", help="with --inspect: write robot.toml into a folder")
    options = parser.parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.errors import InputError
    from toolkit.report.console import make_console
    from toolkit.robot.loader import find_robots, load_robot

    console = make_console()
    if options.out and not options.inspect:
        raise InputError("--out is the folder of a draft; it needs --inspect")
    if options.inspect:
        if options.name or options.picture:
            raise InputError("--inspect takes a model; leave NAME and --picture out")
        return _inspect(console, options.inspect, options.out)
    if options.name is None:
        if options.picture:
            raise InputError("--picture needs the name of a robot: one of " + ", ".join(find_robots(options.robots)))
        return _list(console, options.robots)
    if options.picture and options.picture.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise InputError(f"--picture {options.picture}: a picture ends in .png or .jpg")
    robot = load_robot(options.name, options.robots)
    if options.picture:
        _picture(robot, options.picture)
        console.print(f"{options.picture}: {robot.name} in its home posture", soft_wrap=True, markup=False)
    else:
        _describe(console, robot)
    return 0


def _list(console: Console, robots_dir: Path | None) -> int:
    from rich.table import Table

    from toolkit.errors import PackageError, RobotError
    from toolkit.robot.description import FILE_NAME, read_description
    from toolkit.robot.loader import find_robots, load_robot, robots_folder

    names = find_robots(robots_dir)
    if not names:
        raise RobotError(f"no robot in {robots_folder(robots_dir)}: a robot is a folder with a {FILE_NAME}")
    table = Table("robot", "mass, kg", "CoM, m", "joints", "limbs", "licence", show_lines=True)
    for column in table.columns:
        column.no_wrap = column.header != "limbs"
    broken: dict[str, RobotError] = {}
    missing: dict[str, PackageError] = {}
    for name in names:
        try:
            robot = load_robot(name, robots_dir)
            facts = read_description(robot.folder / FILE_NAME)
            limbs = ", ".join(limb.label for limb in robot.limbs)
            numbers = (f"{robot.mass:.1f}", f"{robot.com_height:.2f}", str(len(robot.joint_names)))
            table.add_row(name, *numbers, limbs, facts.licence)
        except PackageError as error:
            missing[name] = error
            table.add_row(name, "", "", "", "package missing", "", style="yellow")
        except RobotError as error:
            broken[name] = error
            table.add_row(name, "", "", "", "cannot be loaded", "", style="red")
    console.print(table)
    for name, error in missing.items():
        console.print(f"{name}: {error}", style="yellow", soft_wrap=True, markup=False)
    for name, error in broken.items():
        console.print(f"{name}: {error}", style="red", soft_wrap=True, markup=False)
    return next(iter(broken.values())).exit_code if broken else 0


def _inspect(console: Console, what: str, out: Path | None) -> int:
    """Print a model, write its draft, and try it; returns the exit code."""
    import tempfile

    from toolkit.drafts import write_whole
    from toolkit.errors import InputError, RobotError
    from toolkit.mjcf import one_line
    from toolkit.report.console import print_warnings
    from toolkit.report.inspection import print_inspection
    from toolkit.robot.description import FILE_NAME
    from toolkit.robot.draft import draft
    from toolkit.robot.loader import load_robot
    from toolkit.robot.located import locate
    from toolkit.robot.upright import read_upright

    located = locate(what)
    if out is not None and (out / FILE_NAME).exists():
        raise InputError(f"--out {out}: has a {FILE_NAME} already; choose another folder")
    try:
        source = read_upright(located.path)
        found = draft(source, located.lines(out))
        tried = draft(source, located.lines(None)).text
    except ValueError as error:
        raise InputError(f"{located.path}: MuJoCo cannot compile it: {one_line(error)}") from None
    print_inspection(console, found, source)
    if out is None:
        console.print(found.text, markup=False, soft_wrap=True)
    else:
        write_whole(out / FILE_NAME, found.text.encode())
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "draft")
        place.mkdir()
        (place / FILE_NAME).write_text(tried, encoding="utf-8")
        try:
            robot = load_robot(str(place))
            print_warnings(console, robot)
            guessed = f", but look up {'; '.join(found.missing)}" if found.missing else ""
            verdict = f"the draft loads: {len(robot.joint_names)} joints, CoM at {robot.com_height:.3f} m{guessed}"
        except RobotError as error:
            robot, said = None, str(error).replace(f"{place.resolve()}/", "")
            wanted = f"look up {'; '.join(found.missing)}. " if found.missing else ""
            verdict = f"the draft does not load yet: {wanted}{said}"
    good = robot is not None and not found.missing
    console.print(verdict, style="green" if good else "red", soft_wrap=True, markup=False)
    if out is not None:
        console.print(f"written to {out / FILE_NAME}", soft_wrap=True, markup=False)
    return 0 if good else 1


def _describe(console: Console, robot: RobotModel) -> None:
    from rich.table import Table

    from toolkit.report.console import print_warnings
    from toolkit.robot.description import FILE_NAME, read_description
    from toolkit.search.moves.occupancy import BodyBox

    facts = read_description(robot.folder / FILE_NAME)
    console.print(f"{robot.name}: {facts.description}\nlicence {facts.licence}; source: {facts.source}", markup=False)
    console.print(f"{robot.mass:.2f} kg, CoM at {robot.com_height:.3f} m, {len(robot.joint_names)} joints")
    body = BodyBox.of(robot)
    size = f"{2 * body.half_depth:.2f} m deep and {2 * body.half_width:.2f} m wide"
    console.print(f"at home its body is {size} from the knees up: doors and corridors have to be wider")
    limbs = Table("limb", "patch, m", "max N", "segments, m", "reach, m")
    for limb, model in robot.limbs.items():
        if limb in robot.legs:
            leg = robot.legs[limb]
            segments, low, high = f"{leg.thigh:.3f} + {leg.shin:.3f}", leg.min_length, leg.max_length
        else:
            segments, low, high = "", robot.arms[limb].min_reach, robot.arms[limb].max_reach
        patch = " x ".join(f"{2 * half:.3f}" for half in model.half_size)
        limbs.add_row(limb.label, patch, f"{model.max_normal_force:g}", segments, f"{low:.3f}…{high:.3f}")
    console.print(limbs)
    joints = Table("joint", "range, rad", "N m", "rad/s", "armature", "home, rad")
    for i, name in enumerate(robot.joint_names):
        numbers = (robot.torque_limit[i], robot.velocity_limit[i], robot.armature[i], robot.home[7 + i])
        joints.add_row(name, f"{robot.lower[i]:.3f}…{robot.upper[i]:.3f}", *(f"{value:g}" for value in numbers))
    console.print(joints)
    print_warnings(console, robot)


def _picture(robot: RobotModel, path: Path) -> None:
    import imageio.v3 as imageio

    from toolkit.drafts import write_whole
    from toolkit.robot.picture import render_home

    picture = imageio.imwrite("<bytes>", render_home(robot), extension=path.suffix.lower())
    write_whole(path, typing.cast(bytes, picture), "--picture")


if __name__ == "__main__":
    cli.run(main)
