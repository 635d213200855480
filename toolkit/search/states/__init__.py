"""States of the contact search: contacts by number, CoM and velocity; and the stance at the start."""
