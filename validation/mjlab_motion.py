"""Load an exported motion with mjlab's own loader, in an environment of its own.

mjlab wants another MuJoCo than the toolkit, so this program makes a virtual environment and installs mjlab there. The
packages of the environment that runs it are seen from there too (torch, above all, which is large), as far as mjlab
accepts their versions. Then mjlab's `MotionLoader` reads the motion, mjlab's `Entity` reads the robot, and mjlab's
MuJoCo says where the bodies are.

    python -m toolkit.export RUN --to mjlab --out motion
    python -m validation.mjlab_motion motion
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import subprocess
import sys
import sysconfig
import tempfile
import venv
from importlib import import_module
from pathlib import Path

MJLAB = "1.6.0"
CLOSE = 2e-6  # the loader keeps single precision, and robot.xml six digits


def main(argv: list[str] | None = None) -> int:
    """Make the environment and check the motion there; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.mjlab_motion",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("export", type=Path, help="folder that python -m toolkit.export wrote with --to mjlab")
    parser.add_argument("--venv", type=Path, help="environment to make, or to use again (default: one for this run)")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args(argv)
    if args.inside:
        return _check(args.export)
    with tempfile.TemporaryDirectory() as scratch:
        python = _environment(args.venv or Path(scratch) / "mjlab")
        command = [python, str(Path(__file__).resolve()), str(args.export.resolve()), "--inside"]
        return subprocess.run(command, cwd=scratch, check=False).returncode


def _environment(folder: Path) -> str:
    """Python of an environment with mjlab, which is made where it is missing."""
    python = str(folder.resolve() / "bin" / "python")
    if not Path(python).exists():
        venv.create(folder, with_pip=True)
        packages = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})["purelib"]
        Path(packages, "shared.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    wanted = [f"mjlab=={MJLAB}", *_torch()]
    subprocess.run([python, "-m", "pip", "install", "--quiet", *wanted], check=True)
    return python


def _torch() -> list[str]:
    """The release of torch that is here already, since the newest one brings gigabytes along."""
    try:
        return [f"torch=={importlib.metadata.version('torch').partition('+')[0]}"]
    except importlib.metadata.PackageNotFoundError:
        return []


def _check(export: Path) -> int:
    """Compare what mjlab reads with what the export says; runs where mjlab is installed."""
    np, torch, mujoco = (import_module(name) for name in ("numpy", "torch", "mujoco"))
    entity = import_module("mjlab.entity")
    loader = import_module("mjlab.tasks.tracking.mdp.commands").MotionLoader
    metadata = json.loads((export / "metadata.json").read_text())
    bodies, joints = metadata["body_names"], metadata["joint_names"]
    motion = loader(str(export / "motion.npz"), torch.arange(len(bodies)))
    path = str(export / "robot.xml")
    robot = entity.Entity(entity.EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_file(path)))
    model = robot.spec.compile()
    data, worst = mujoco.MjData(model), 0.0
    with np.load(export / "motion.npz") as arrays:
        joint_pos, body_pos, body_quat = (arrays[name] for name in ("joint_pos", "body_pos_w", "body_quat_w"))
    for row in range(motion.time_step_total):
        data.qpos[:] = np.concatenate([body_pos[row, 0], body_quat[row, 0], joint_pos[row]])
        mujoco.mj_kinematics(model, data)
        worst = max(worst, float(np.abs(data.xpos[1:] - motion.body_pos_w[row].numpy()).max()))
    checks = {
        f"mjlab {MJLAB} with MuJoCo {mujoco.__version__} reads {metadata['frames']} frames": (
            motion.time_step_total == metadata["frames"]
        ),
        "its robot has the bodies of the export, in order": list(robot.body_names) == bodies,
        "its robot has the joints of the export, in order": list(robot.joint_names) == joints,
        "shapes are those of the loader": (
            tuple(motion.joint_pos.shape) == tuple(motion.joint_vel.shape) == (len(joint_pos), len(joints))
            and tuple(motion.body_quat_w.shape) == (len(joint_pos), len(bodies), 4)
            and motion.body_lin_vel_w.shape == motion.body_ang_vel_w.shape == motion.body_pos_w.shape
        ),
        f"bodies are where its MuJoCo has them, within {worst:.1e} m": worst < CLOSE,
    }
    for text, passed in checks.items():
        sys.stdout.write(f"{'PASS' if passed else 'FAIL'}  {text}\n")
    return 0 if all(checks.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
