"""Multi-contact planning for humanoids, validated in simulation."""

__version__ = "0.1.0"
