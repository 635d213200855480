"""Small robots written for the tests."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from toolkit.robot.loader import robots_folder

LEG = (  # joint, axis, lower, upper, N m, offset of its body
    ("hip_pitch", "0 1 0", -2.0, 1.0, 200, "0 {y} -0.05"),
    ("hip_roll", "1 0 0", -0.5, 0.5, 150, "0 0 0"),
    ("hip_yaw", "0 0 1", -0.5, 1.0, 100, "0 0 0"),
    ("knee", "0 1 0", 0.0, 2.4, 250, "0 0 -0.35"),
    ("ankle_roll", "1 0 0", -0.4, 0.4, 80, "0 0 -0.30"),
    ("ankle_pitch", "0 1 0", -1.0, 0.8, 120, "0 0 0"),
)

ARM = (  # joint, axis, lower, upper, N m, offset of its body
    ("shoulder_yaw", "0 0 1", -1.5, 0.8, 100, "0 {y} 0.36"),
    ("shoulder_roll", "1 0 0", 0.0, 2.8, 100, "0 0 0"),
    ("upper_arm_yaw", "0 0 1", -2.4, 2.4, 70, "0 0 0"),
    ("elbow", "0 1 0", -2.2, 0.0, 70, "0 0 -0.28"),
    ("forearm_yaw", "0 0 1", -2.5, 2.5, 20, "0 0 -0.26"),
    ("wrist_roll", "1 0 0", -1.3, 1.3, 20, "0 0 0"),
    ("wrist_pitch", "0 1 0", -0.6, 0.6, 20, "0 0 0"),
)

TOML = """
licence = "CC0-1.0"
source = "tests"

[model]
file = "{file}"
base = "pelvis"

[limbs.left_foot]
body = "left_foot_link"
position = [0.02, 0.0, -0.08]
patch = [0.20, 0.10]

[limbs.right_foot]
body = "right_foot_link"
position = [0.02, 0.0, -0.08]
patch = [0.20, 0.10]

[home]
"*_hip_pitch" = -0.35
"*_knee" = 0.7
"*_ankle_pitch" = -0.35

[limits.velocity]
"*" = 10.0
"""


def arm_toml(side: str) -> str:
    """What the robot file says besides of the arm of one side."""
    roll = 0.4 if side == "left" else -0.4
    return TOML.replace(
        "[home]",
        f"""[limbs.{side}_palm]
body = "{side}_hand"
position = [0.0, 0.0, -0.09]
patch = [0.08, 0.08]
max_force = 200.0

[home]
"{side}_shoulder_roll" = {roll}
"{side}_elbow" = -1.0""",
    )


def biped_mjcf(arm: str | None = None) -> str:
    """Legs and a trunk; hips pitch first, ankles roll first, no actuators but limits at the joints.

    With the arm of one side ("left" or "right") where that is given.
    """
    legs = "".join(_mjcf_leg(side, sign) for side, sign in (("left", 1), ("right", -1)))
    legs += "" if arm is None else _mjcf_arm(arm)
    return f"""<mujoco model="biped">
  <compiler angle="radian"/>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="pelvis" pos="0 0 0.8">
      <freejoint/>
      <geom type="box" size="0.08 0.12 0.05" mass="8"/>
      <geom type="box" size="0.08 0.12 0.15" pos="0.02 0 0.25" mass="20"/>
      {legs}
    </body>
  </worldbody>
</mujoco>"""


def _mjcf_leg(side: str, sign: int) -> str:
    shapes = {
        "knee": '<geom type="capsule" size="0.04" fromto="0 0 -0.08 0 0 -0.24" mass="2"/>',
        "hip_yaw": '<geom type="capsule" size="0.05" fromto="0 0 -0.08 0 0 -0.28" mass="3"/>',
        "ankle_pitch": '<geom type="box" size="0.1 0.05 0.01" pos="0.02 0 -0.07" mass="1"/>',
    }
    return _mjcf_chain(LEG, side, 0.1 * sign, shapes, {"ankle_pitch": f"{side}_foot_link"})


def _mjcf_arm(side: str) -> str:
    shapes = {
        "upper_arm_yaw": '<geom type="capsule" size="0.04" fromto="0 0 -0.10 0 0 -0.22" mass="1.5"/>',
        "elbow": '<geom type="capsule" size="0.035" fromto="0 0 -0.06 0 0 -0.2" mass="1"/>',
        "wrist_pitch": '<geom type="box" size="0.04 0.04 0.009" pos="0 0 -0.081" mass="0.4"/>',
    }
    return _mjcf_chain(ARM, side, 0.25 if side == "left" else -0.25, shapes, {"wrist_pitch": f"{side}_hand"})


def _mjcf_chain(chain, side: str, y: float, shapes: dict[str, str], names: dict[str, str]) -> str:
    """Bodies one in the other, mirrored on the right; joints without a shape of their own carry a small sphere."""
    text, end = "", ""
    for joint, axis, lower, upper, torque, offset in chain:
        body = names.get(joint, f"{side}_{joint}_link")
        if side == "right" and ("yaw" in joint or joint == "shoulder_roll"):
            lower, upper = -upper, -lower
        shape = shapes.get(joint, '<geom size="0.02" mass="0.2" contype="0" conaffinity="0"/>')
        text += (
            f'<body name="{body}" pos="{offset.format(y=y)}"><joint name="{side}_{joint}" axis="{axis}" '
            f'range="{lower} {upper}" actuatorfrcrange="-{torque} {torque}" armature="0.01"/>{shape}'
        )
        end += "</body>"
    return text + end


def biped_urdf() -> str:
    """The same legs as a URDF: fixed soles, a mesh that cannot be drawn, velocity limits, massless links."""
    inertial = (
        '<inertial><mass value="{0}"/><inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    heavy = '<inertial><origin xyz="0.012 0 0.15"/>' + inertial.format(28, 0.5).removeprefix("<inertial>")
    mesh = '<visual><geometry><mesh filename="package://biped/meshes/trunk.dae"/></geometry></visual>'
    parts = [f'<link name="pelvis">{heavy}{mesh}</link>']
    for side, sign in (("left", 1), ("right", -1)):
        parent = "pelvis"
        for joint, axis, lower, upper, torque, offset in LEG:
            child = f"{side}_foot_link" if joint == "ankle_pitch" else f"{side}_{joint}_link"
            if sign < 0 and "yaw" in joint:
                lower, upper = -upper, -lower
            parts.append(f'<link name="{child}">{inertial.format(1.5, 0.01)}</link>')
            parts.append(
                f'<joint name="{side}_{joint}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
                f'<origin xyz="{offset.format(y=0.1 * sign)}"/><axis xyz="{axis}"/>'
                f'<limit lower="{lower}" upper="{upper}" effort="{torque}" velocity="7.5"/></joint>'
            )
            parent = child
        box = '<collision><origin xyz="0 0 0.01"/><geometry><box size="0.2 0.1 0.02"/></geometry></collision>'
        parts.append(f'<link name="{side}_sole">{box}</link>')
        parts.append(
            f'<joint name="{side}_sole_fixed" type="fixed"><parent link="{parent}"/><child link="{side}_sole"/>'
            '<origin xyz="0.02 0 -0.08"/></joint>'
        )
    return "<robot name='biped'>" + "".join(parts) + "</robot>"


URDF_TOML = (
    TOML.replace('body = "left_foot_link"\nposition = [0.02, 0.0, -0.08]', 'body = "left_sole"')
    .replace('body = "right_foot_link"\nposition = [0.02, 0.0, -0.08]', 'body = "right_sole"')
    .replace('[limits.velocity]\n"*" = 10.0', '[armature]\n"*_knee" = 0.05')
)


def write_robot(folder: Path, model: str | None = None, toml: str | None = None, file: str = "robot.xml") -> Path:
    """Write a robot folder; the biped where nothing is given."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / file).write_text(biped_mjcf() if model is None else model)
    (folder / "robot.toml").write_text((TOML if toml is None else toml).replace("{file}", file))
    return folder


def write_scaled(folder: Path, name: str, length: float, mass: float) -> Path:
    """Write a robot of `robots/` with lengths and masses multiplied by factors, and all else so that it moves alike.

    Under the same gravity times go with the root of the lengths, torques with mass times length, armature with mass
    times length squared.
    """
    folder.mkdir(parents=True, exist_ok=True)
    root = ElementTree.parse(robots_folder() / name / "robot.xml").getroot()
    torque, pace = mass * length, length**0.5
    factors = {"pos": length, "size": length, "fromto": length, "mass": mass, "armature": torque * length}
    for element in root.iter():
        motor = {"ctrlrange": torque, "forcerange": torque}
        for key, factor in (factors | motor).items():
            if key in element.attrib:
                element.set(key, " ".join(f"{factor * float(each):.9g}" for each in element.get(key, "").split()))
    (folder / "robot.xml").write_text(ElementTree.tostring(root, encoding="unicode"))
    toml = (robots_folder() / name / "robot.toml").read_text().partition("[declared]")[0]
    kinds = {
        "patch": (length, length),
        "max_force": (mass,),
        "[gains]": (torque, torque * pace),
        "[limits.velocity]": (1 / pace,),
    }
    lines, table = [], ""
    for line in toml.splitlines():
        key, equals, value = line.partition(" = ")
        table = line if line.startswith("[") else table
        by = kinds.get(key, kinds.get(table, ())) if equals else ()
        lines.append(f"{key}{equals}{_multiplied(value, by)}")
    (folder / "robot.toml").write_text("\n".join(lines) + "\n")
    return folder


def _multiplied(text: str, factors: tuple[float, ...]) -> str:
    """A text whose numbers are multiplied by factors in turn; as it is where there are none."""
    left = iter(factors)
    return re.sub(r"[0-9.]+", lambda found: f"{next(left) * float(found[0]):.9g}", text) if factors else text
