"""contacts.json: the planned contact sequence for optimisers that take contacts as given.

No standard file for this exists that is read without a library of its own: multicontact-api's files are boost archives
of its C++ classes, and OCS2, TOWR and Crocoddyl build theirs in code. This one is JSON with the field names of
multicontact-api's classes `ContactSequence`, `ContactPhase`, `ContactPatch` and `ContactModel`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.contacts.stance import Contact
from toolkit.exchange.record import RunRecord
from toolkit.robot.model import RobotModel

SCHEMA = 1


def contact_sequence(record: RunRecord, robot: RobotModel) -> dict[str, Any]:
    """The planned contact sequence of a run as JSON holds it.

    Each entry of `contactPhases` has the times `timeInitial` and `timeFinal` (s), the `contactPatches` by effector, the
    planned CoM `c_init`, `c_final` (m), its velocity `dc_init`, `dc_final` (m/s) and the angular momentum about it
    `L_init`, `L_final` (kg m^2/s), and the effector that is in `swing`. A patch has its `placement` in the world
    (`translation` in m, `quaternion_xyzw`; z is the surface's outward normal), its `friction`, the index of its
    `surface` in the world, and a `contact_model` with its corners in the frame of the placement.
    """
    motion = record.motion
    mass = float(motion["centroidal_problem_mass"])
    knots = motion["centroidal_times"]
    curves = {
        "c": motion["centroidal_com"],
        "dc": motion["centroidal_linear_momentum"] / mass,
        "L": motion["centroidal_angular_momentum"],
    }
    phases = []
    for phase in record.schedule.phases:
        entry: dict[str, Any] = {"timeInitial": phase.start, "timeFinal": phase.end}
        entry["swing"] = None if phase.swing is None else phase.swing.label
        entry["contactPatches"] = {c.limb.label: _patch(c, robot) for c in phase.contacts}
        for end, time in (("init", phase.start), ("final", phase.end)):
            for name, values in curves.items():
                entry[f"{name}_{end}"] = [float(np.interp(time, knots, values[:, axis])) for axis in range(3)]
        phases.append(entry)
    trajectory = motion["wholebody_qpos"]
    return {
        "schema": SCHEMA,
        "robot": robot.name,
        "world": record.report["world"],
        "mass": mass,
        "q_init": trajectory[0],
        "q_final": trajectory[-1],
        "effectors": {
            limb.label: {"site": model.site, "body": model.body, "half_size": model.half_size}
            for limb, model in sorted(robot.limbs.items())
        },
        "contactPhases": phases,
    }


def _patch(contact: Contact, robot: RobotModel) -> dict[str, Any]:
    """A contact patch as JSON holds it."""
    x, y = robot.limbs[contact.limb].borne(contact.bearing)
    w, *vector = contact.pose.quaternion_wxyz
    return {
        "placement": {"translation": contact.pose.position, "quaternion_xyzw": [*vector, w]},
        "friction": contact.friction,
        "surface": contact.surface,
        "contact_model": {
            "mu": contact.friction,
            "contact_type": "CONTACT_PLANAR",
            "num_contact_points": 4,
            "contact_points_positions": [[x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0], [x, -y, 0.0]],
        },
    }
