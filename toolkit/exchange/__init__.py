"""Runs in the formats of other software: motions, contacts and terrain."""
