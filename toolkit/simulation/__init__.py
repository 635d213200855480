"""Execution in MuJoCo: controller, run, measurements, verdict."""
