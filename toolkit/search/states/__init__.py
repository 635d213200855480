"""What a state of the contact search is: contacts by number, CoM, velocity; where it starts."""
