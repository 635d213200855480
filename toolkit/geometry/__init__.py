"""Rigid transforms and planar convex polygons; NumPy only."""
