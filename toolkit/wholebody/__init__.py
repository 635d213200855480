"""Whole-body trajectories: swing paths, inverse kinematics, limit checks."""
