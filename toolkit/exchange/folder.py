"""The folder of an export: the motion in one format, and beside it what every reader needs."""

from __future__ import annotations

import importlib.metadata
import textwrap
from pathlib import Path
from typing import Any

from toolkit.exchange.columns import csv_text, label_columns
from toolkit.exchange.contact_file import contact_sequence
from toolkit.exchange.formats import FORMATS, Format
from toolkit.exchange.frames import TOUCH, MotionFrames
from toolkit.exchange.record import RunRecord, robot_bodies
from toolkit.exchange.terrain import terrain_friction, terrain_mesh, terrain_mjcf
from toolkit.report.files import REPORT, write_json
from toolkit.robot.description import FILE_NAME, read_description
from toolkit.robot.model import RobotModel

SCHEMA = 1
METADATA, README, CONTACTS, LABELS = "metadata.json", "README.txt", "contacts.json", "labels.csv"
TERRAIN, TERRAIN_MESH, ROBOT = "terrain.xml", "terrain.obj", "robot.xml"
COMMON = {
    README: "this text",
    METADATA: "names, orders, limits, gains, friction, verdict, versions",
    REPORT: "the run's own report",
    CONTACTS: "the planned contacts: times, poses, friction, limbs, surfaces, CoM",
    LABELS: "for each frame of the motion: contact labels, joint torques, joint targets",
    TERRAIN: "what the robot collided with, as MJCF",
    TERRAIN_MESH: "the same as one mesh (m, z up)",
    ROBOT: "the robot, as MJCF; files that it names lie beside it",
}
FILES = frozenset(COMMON) | {name for item in FORMATS.values() for name in item.files}
"""Every file that an export writes, but for the meshes of its robot."""

_UNITS = {
    "length": "m",
    "angle": "rad",
    "time": "s",
    "mass": "kg",
    "force": "N",
    "torque": "N m",
    "world frame": "x, y horizontal, z up",
    "quaternions": "scalar first (w, x, y, z) where the name does not end in xyzw",
}
_EXPLAINED = {
    "Frames and units": "SI units and radians. The world frame has z up. Quaternions are scalar first unless said "
    "otherwise. A limb's patch has its frame at the site of the limb's name in robot.xml: z is the outward normal of "
    "the surface that it rests on. Frames between two samples of the run are interpolated, orientations by slerp.",
    "Contacts": f"LIMB_contact is 1 while the patch bears more than {TOUCH:g} N (planned states: while the plan holds "
    "it), and LIMB_planned_contact while the plan holds it. contacts.json spells ContactSequence, ContactPhase, "
    "ContactPatch and ContactModel of multicontact-api (loco-3d) as JSON, with its field names; `surface` and `swing` "
    "are added. The friction of each contact is in contacts.json, that of each geom of the terrain in metadata.json.",
    "Torques and targets": "torque_JOINT acts on the joint. target_JOINT is the joint position from which the "
    "controller torque = kp (target - position) - kd velocity, with kp and kd of metadata.json, makes that torque. A "
    "controller with feed-forward tracks the joint positions of the motion instead and adds the torques.",
}


def write_export(
    folder: Path,
    name: str,
    record: RunRecord,
    robot: RobotModel,
    frames: MotionFrames,
    *,
    planned: bool = False,
    robot_folder: str = "",
) -> None:
    """Write every file of an export.

    Args:
        folder: Existing folder to write into (`RunFolder.path`).
        name: Name of the format, one of `FORMATS`.
        record: The run.
        robot: Its robot.
        frames: The motion.
        planned: Whether the frames are those of the plan.
        robot_folder: Where `write_robot` has put the robot that many exports share, as seen from `folder`; "" to write
            it into `folder`.
    """
    form = FORMATS[name]
    for file, encode in form.files.items():
        (folder / file).write_bytes(encode(frames, robot))
    (folder / LABELS).write_text(csv_text(label_columns(frames, robot)), encoding="utf-8")
    write_json(folder / CONTACTS, contact_sequence(record, robot))
    (folder / TERRAIN).write_text(terrain_mjcf(record.scene, record.report["world"]), encoding="utf-8")
    terrain_mesh(record.scene, frames.qpos[:, :3]).export(folder / TERRAIN_MESH, digits=9)
    if not robot_folder:
        write_robot(folder, robot)
    common = {f"{robot_folder}/{ROBOT}" if robot_folder and file == ROBOT else file: COMMON[file] for file in COMMON}
    files = [*form.files, *common, *(f"{robot_folder}/{file}".lstrip("/") for file in robot.assets)]
    metadata = _metadata(name, record, robot, frames, planned) | {"files": files}
    write_json(folder / METADATA, metadata)
    (folder / README).write_text(_readme(form, common, metadata), encoding="utf-8")
    write_json(folder / REPORT, record.report)


def write_robot(folder: Path, robot: RobotModel) -> None:
    """Write the robot as MJCF with the files that it names into an existing folder."""
    (folder / ROBOT).write_text(robot.mjcf, encoding="utf-8")
    for file, content in robot.assets.items():
        (folder / file).write_bytes(content)


def _metadata(name: str, record: RunRecord, robot: RobotModel, frames: MotionFrames, planned: bool) -> dict[str, Any]:
    """Content of metadata.json, but for the names of the files."""
    scene, report = record.scene, record.report
    description = read_description(robot.folder / FILE_NAME)
    return {
        "schema": SCHEMA,
        "format": name,
        "states": "planned" if planned else "simulated",
        "world": report["world"],
        "robot": robot.name,
        "robot_licence": description.licence,
        "robot_source": description.source,
        "seed": report["seed"],
        "verdict": report["verdict"],
        "reason": report["reason"],
        "fps": frames.fps,
        "frames": len(frames.times),
        "duration": frames.times[-1] - frames.times[0],
        "units": _UNITS,
        "joint_names": robot.joint_names,
        "body_names": [scene.body(body).name for body in robot_bodies(scene)],
        "limbs": [limb.label for limb in sorted(robot.limbs)],
        "joint_lower": robot.lower,
        "joint_upper": robot.upper,
        "velocity_limit": robot.velocity_limit,
        "torque_limit": robot.torque_limit,
        "kp": robot.kp,
        "kd": robot.kd,
        "mass": scene.body_subtreemass[robot_bodies(scene)[0]],
        "friction": terrain_friction(scene),
        "toolkit_version": importlib.metadata.version("humanoid-contact-toolkit"),
        "run_versions": report["versions"],
    }


def _readme(form: Format, common: dict[str, str], metadata: dict[str, Any]) -> str:
    """The text of README.txt; `common` says of each file what it is."""
    verdict = f"{metadata['verdict']} ({metadata['reason']})" if metadata["reason"] else metadata["verdict"]
    files = dict.fromkeys(form.files, "the motion") | common
    width = max(map(len, files))
    head = [
        f"{metadata['robot']} in {metadata['world']}: {form.about}",
        f"States: {metadata['states']}. Verdict of the run: {verdict}.",
        f"{metadata['frames']} frames at {metadata['fps']:g} per second, {metadata['duration']:.3f} s.",
        "",
        *[f"{file:<{width}}  {about}" for file, about in files.items()],
    ]
    parts = {"Motion": form.layout} | _EXPLAINED
    text = [line for title, part in parts.items() for line in ("", title, *textwrap.wrap(part, 100))]
    return "\n".join([*head, *text]) + "\n"
