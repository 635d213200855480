"""The stage-structured solver of centroidal problems: what steps and rows say, Newton steps, and the method."""
