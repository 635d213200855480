"""Robot descriptions: one compiled model for MuJoCo, Pinocchio and placo."""
