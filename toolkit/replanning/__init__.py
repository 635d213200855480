"""Replanning: the motion over the next contacts, optimised again from the measured state."""
