"""Command line: a run's files in, its verdict out once more."""

from __future__ import annotations

import argparse

from toolkit import cli

DESCRIPTION = """\
Replay a run in plain MuJoCo from its files alone, and say its verdict again.

The scene, the initial state and the controls are read from the folder; no planner and no controller takes part. The
states must be those of the recorded run, bit for bit, and every check is measured anew: torques, slip, falls, contacts,
the goal. A run that was pushed is pushed again.
"""

EPILOG = """\
examples:
  python -m toolkit.replay runs/stairs-humanoid-20250101-120000
  python -m toolkit.replay runs/first --video first.mp4 --rerun first.rrd
  python -m toolkit.replay runs/first --viewer

A replay ends with PASS, with FAIL and the reason, or with DIFFERS where it is not the recorded run. Another version of
MuJoCo, or another kind of processor, may differ; report.json names the versions."""


def arguments() -> argparse.ArgumentParser:
    """The options of this command."""
    parser = cli.parser("replay", DESCRIPTION, EPILOG)
    parser.add_argument("run", type=cli.path, metavar="RUN", help="folder that python -m toolkit.validate has written")
    parser.add_argument("--video", type=cli.path, metavar="FILE.mp4", help="also render a video of the replay")
    parser.add_argument("--rerun", type=cli.path, metavar="FILE.rrd", help="also write a recording of the replay")
    parser.add_argument("--viewer", action="store_true", help="then show the replay in MuJoCo's viewer")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code.

    Raises:
        InputError: The folder is no whole run, or something that was asked for cannot be written or shown.
    """
    args = arguments().parse_args(argv)
    # Heavy imports come after the options, so that --help and mistakes in them answer at once.
    from toolkit.errors import InputError
    from toolkit.execution.replay import checks_difference, difference, replay_run
    from toolkit.report.console import StageConsole, show_replay
    from toolkit.report.files import PLAN
    from toolkit.report.plan_file import read_plan
    from toolkit.report.saved_run import read_run

    for option, ending in ((args.video, ".mp4"), (args.rerun, ".rrd")):
        if option is not None and option.suffix.lower() != ending:
            raise InputError(f"{option}: the name must end in {ending}")
    if args.viewer:
        from toolkit.report.viewer import require_display

        require_display()
    saved = read_run(args.run)
    if saved.execution is None:
        why = f" ({saved.report.reason})" if saved.report.reason else ""
        raise InputError(f"{args.run}: this run was never executed{why}; there is nothing to replay")
    sequence = read_plan(args.run / PLAN) if args.video or args.rerun else None
    display = StageConsole()
    display.started("replay")
    again = replay_run(saved.execution, observer=lambda share: display.progress("replay", share))
    differs = difference(saved.execution, again) or checks_difference(saved.report.checks, again.checks)
    display.finished("replay", not differs, again.simulated_seconds / again.real_time_factor, differs)
    if args.video and sequence:
        from toolkit.report.replay_video import write_replay_video

        display.started("video")
        write_replay_video(args.video, again, sequence)
    if args.rerun and sequence:
        from toolkit.report.replay_recording import write_replay_recording

        display.started("recording")
        write_replay_recording(args.rerun, saved.report, again, sequence)
    show_replay(display, saved.report, again, differs, [path for path in (args.video, args.rerun) if path])
    if args.viewer:
        from toolkit.report.viewer import show

        show(again)
    return 1 if differs or again.failure is not None else 0


if __name__ == "__main__":
    cli.run(main)
