"""Networks with random weights, written as files."""

import numpy as np
from safetensors.numpy import save_file

from toolkit.contacts.category import Category
from toolkit.prediction.features import AHEAD, TARGETS, feature_size
from toolkit.prediction.network import HIDDEN, SCHEMA, network_path


def random_tensors(rng, category):
    """Tensors of one file."""
    size = feature_size(category)
    result = {"features.lower": -np.ones(size, np.float32), "features.upper": np.ones(size, np.float32)}
    for name, inputs, outputs in (("classifier", size, 1), ("regressor", size + AHEAD, TARGETS)):
        widths = [inputs, HIDDEN, HIDDEN, HIDDEN, outputs]
        for layer in range(4):
            weight = rng.normal(size=(widths[layer], widths[layer + 1])) / np.sqrt(widths[layer])
            result[f"{name}.{layer}.weight"] = weight.astype(np.float32)
            result[f"{name}.{layer}.bias"] = rng.normal(size=widths[layer + 1]).astype(np.float32)
    return result


def metadata(category, fingerprint):
    """What a file says of itself."""
    return {"schema": SCHEMA, "category": str(int(category)), "robot": fingerprint}


def write_random_networks(folder, fingerprint):
    """A file for every category."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    for category in Category:
        save_file(random_tensors(rng, category), network_path(folder, category), metadata(category, fingerprint))
