"""Control: the plan as a reference, and the joint torques that carry it out."""
