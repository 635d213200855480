"""Judges of transitions: by networks (features and inference), by the centroidal optimiser, or without dynamics."""
