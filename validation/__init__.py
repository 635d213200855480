"""The experiments that hold the toolkit's plans and runs against the paper and against its goals."""
