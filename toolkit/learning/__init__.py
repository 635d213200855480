"""Learning to predict the centroidal optimiser: data sets, collection, training, evaluation."""
