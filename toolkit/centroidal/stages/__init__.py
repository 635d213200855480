"""The stage-structured solver of centroidal problems: pieces, the Newton step, and the interior-point method."""
