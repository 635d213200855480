"""Learning what the centroidal optimiser says: data sets, collection, training, evaluation."""
