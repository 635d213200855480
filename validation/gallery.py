"""Pictures of runs in the shipped worlds: `python -m validation.gallery`."""

from __future__ import annotations

import argparse
import datetime
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import imageio.v3 as iio

from toolkit import cli, validate
from toolkit.contacts.sequence import ContactSequence
from toolkit.drafts import write_whole
from toolkit.errors import InputError
from toolkit.report.console import make_console
from toolkit.report.files import PLAN, REPORT
from toolkit.report.offscreen import Patches, require_rendering
from toolkit.report.plan_file import read_plan
from toolkit.report.saved_run import SavedRun, read_run
from toolkit.report.stroboscope import SPACING, stroboscope
from validation.cases import WORLDS
from validation.gallery_pictures import moving_picture
from validation.machine import ROOT, environment
from validation.tables import in_unit, markdown_table, number

DESCRIPTION = """\
Run worlds with python -m toolkit.validate and draw each run: the world and the robot in several moments of its way. One
run becomes a picture that moves. A Markdown page shows all of them.

A world whose run lies in --out already is drawn without being run again.
"""

NAMES = tuple(sorted(path.stem for path in WORLDS.glob("*.xml")))
SIZE, QUALITY = (960, 540), 90
PAGE = "README.md"


def arguments() -> argparse.ArgumentParser:
    """The options of this program."""
    made = argparse.ArgumentParser(
        prog="python -m validation.gallery",
        description=DESCRIPTION,
        epilog="exit codes: 0 every run passed, 1 one did not (its picture says so), 2 bad input",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    cli.add_robot_options(made)
    made.add_argument("--worlds", nargs="+", choices=NAMES, default=NAMES, metavar="WORLD", help=", ".join(NAMES))
    made.add_argument("--moving", choices=NAMES, metavar="WORLD", help="the run that moves (default: the first one)")
    made.add_argument("--seed", type=cli.seed, default=0, help="seed of every run (default: 0)")
    made.add_argument("--out", type=Path, default=Path("runs") / "gallery", metavar="DIR", help="where the runs go")
    made.add_argument(
        "--results",
        type=Path,
        default=ROOT / "validation" / "results" / "gallery",
        metavar="DIR",
        help="where the page and its pictures go (default: validation/results/gallery)",
    )
    return made


def run_of(args: argparse.Namespace, world: str) -> SavedRun:
    """The run of a world; made where there is none yet."""
    folder = args.out / world
    if not (folder / REPORT).is_file():
        words = [str(WORLDS / f"{world}.xml"), "--seed", str(args.seed), "--no-recording", "--out", str(folder)]
        for name in ("robot", "robots"):
            if getattr(args, name) is not None:
                words += [f"--{name}", str(getattr(args, name))]
        validate.main(words)
    return read_run(folder)


def draw(results: Path, run: SavedRun, sequence: ContactSequence, *, moving: bool) -> list[str]:
    """Write the pictures of an executed run; returns their names.

    Raises:
        InputError: This machine cannot render, or a picture cannot be written.
    """
    execution = run.execution
    assert execution is not None
    qpos, times = execution.samples.qpos, execution.samples.tick_times
    patches = Patches(sequence.contacts, execution.standard.robot.half_sizes)
    content = io.BytesIO()
    picture = stroboscope(execution.scene, qpos, size=SIZE, patches=patches)
    iio.imwrite(content, picture, extension=".jpg", quality=QUALITY)
    files = {f"{run.report.world}.jpg": content.getvalue()}
    if moving:
        files[f"{run.report.world}.gif"] = moving_picture(execution.scene, qpos, times, patches=patches)
    for name, data in files.items():
        write_whole(results / name, data, "--results")
    return list(files)


def entry(run: SavedRun, pictures: Sequence[str]) -> str:
    """What the page says of a run."""
    report = run.report
    verdict = "passed" if report.verdict == "PASS" else f"failed: {report.reason}"
    lines = [f"## {report.world}", "", f"{report.robot}, seed {report.seed}: {verdict}.", ""]
    lines += [f"![{report.world}]({name})" for name in pictures]
    return "\n".join(lines)


def figures(run: SavedRun) -> tuple[str, ...]:
    """A row of the page's table."""
    planning, execution = run.report.stages["planning"], run.report.stages["execution"]
    return (
        run.report.world,
        run.report.verdict,
        _count(planning["contacts"]),
        _count(planning["palm_contacts"]),
        number(execution["simulated_seconds"], ".1f"),
        number(in_unit(execution["max_slip"], 1e3), ".1f"),
        number(in_unit(execution["com_rms_error"], 1e3), ".1f"),
        number(execution["max_torque_ratio"], ".2f"),
    )


def page(runs: Sequence[SavedRun], pictures: Sequence[Sequence[str]], command: str) -> str:
    """The text of the page."""
    taken = environment()
    header = (
        "world",
        "verdict",
        "transitions",
        "by palms",
        "motion [s]",
        "slip [mm]",
        "CoM RMS [mm]",
        "torque / limit",
    )
    versions = ", ".join(f"{package} {version}" for package, version in taken["versions"].items())
    parts = [
        "# Gallery",
        f"Runs of the shipped worlds, drawn by `{command}`: what moved in the simulation, in moments {SPACING:g} m "
        "apart. Plates are the planned contacts, coloured by limb.",
        markdown_table(header, [figures(run) for run in runs]),
        *(entry(run, names) for run, names in zip(runs, pictures, strict=True)),
        f"Taken on {datetime.datetime.now(datetime.UTC):%Y-%m-%d}, code {taken['code']}; {versions}.",
    ]
    return "\n\n".join(parts) + "\n"


def _count(value: Any) -> str:
    """A number of things, "-" where it is unknown."""
    return "-" if value is None else str(value)


def main(argv: list[str] | None = None) -> int:
    """Run and draw; returns the exit code.

    Raises:
        InputError: A world, the robot or a folder cannot be used, or this machine cannot render.
    """
    args = arguments().parse_args(argv)
    require_rendering()
    console = make_console()
    worlds = list(dict.fromkeys(args.worlds))
    moving = args.moving or worlds[0]
    if moving not in worlds:
        raise InputError(f"--moving {moving}: is none of --worlds; name one of {', '.join(worlds)}")
    runs, pictures = [], []
    for number_, world in enumerate(worlds, 1):
        console.print(f"{world} ({number_} of {len(worlds)})")
        run = run_of(args, world)
        runs.append(run)
        drawn = run.execution is not None
        names = draw(args.results, run, read_plan(run.folder / PLAN), moving=world == moving) if drawn else []
        pictures.append(names)
    command = "python -m validation.gallery"
    if args.robot is not None:
        command += f" --robot {args.robot}"
    if worlds != list(NAMES):
        command += f" --worlds {' '.join(worlds)}"
    if args.moving is not None:
        command += f" --moving {args.moving}"
    write_whole(args.results / PAGE, page(runs, pictures, command).encode(), "--results")
    console.print(f"written to {args.results}", soft_wrap=True, markup=False)
    return 0 if all(run.report.verdict == "PASS" for run in runs) else 1


if __name__ == "__main__":
    cli.run(main)
