"""Rigid transforms, triangles and the limbs; NumPy only."""
