"""Execution in MuJoCo: the run, its disturbances, measurements and verdict."""
