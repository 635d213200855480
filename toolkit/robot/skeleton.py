"""A model without some of its meshes, which take most of the time to compile."""

from __future__ import annotations

import mujoco

_LEAST = 1e-6  # kg and kg m^2 of bodies without any


def skeleton(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy of a spec with the same bodies, joints, sites and actuators, without meshes.

    Where a body takes its inertia from its meshes, the copy has them all.
    """
    copy = spec.copy()
    meshes = [geom for geom in copy.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
    if not meshes or any(not geom.parent.explicitinertial for geom in meshes if geom.parent.name != "world"):
        return copy
    return _without(copy, [*copy.pairs, *copy.sensors, *meshes, *copy.meshes])


def colliding_only(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """A copy of a spec with the shapes that collide and no others; masses are not those of the spec."""
    copy = spec.copy()
    drawn = [geom for geom in copy.geoms if not geom.contype | geom.conaffinity]
    used = {geom.meshname for geom in copy.geoms if geom.contype | geom.conaffinity}
    return _without(copy, [*copy.pairs, *drawn, *(mesh for mesh in copy.meshes if mesh.name not in used)])


def _without(spec: mujoco.MjSpec, items: list) -> mujoco.MjSpec:
    """A spec after some of its elements are deleted, whose bodies all have some inertia."""
    for item in items:
        spec.delete(item)
    compiler = spec.compiler
    compiler.boundmass, compiler.boundinertia = max(compiler.boundmass, _LEAST), max(compiler.boundinertia, _LEAST)
    return spec
