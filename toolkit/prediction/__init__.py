"""Networks that predict what the centroidal optimiser would say: features, inference, data, training."""
