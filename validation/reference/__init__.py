"""The centroidal program in CasADi, solved by Ipopt: what the toolkit's own solver is held against."""
