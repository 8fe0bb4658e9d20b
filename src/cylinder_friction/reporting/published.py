"""The published figures of the hybrid that this project implements, from other data, to compare with its own."""

PERCENT_BY_TEST = {
    "1": {"lugre": 9.04, "hybrid": 5.76},
    "2": {"lugre": 11.86, "hybrid": 6.35},
    "3": {"lugre": 19.86, "hybrid": 8.84},
    "4": {"lugre": 28.5, "hybrid": 5.57},
}
"""Table II: mean absolute error [%] by test; the paper does not state what 100 % is."""

STEP_SECONDS = {"lugre": 8.71e-5, "hybrid": 1.51e-3}  # Table III: time of one estimate [s]

HYPERPARAMETERS = {
    "layers": ("LSTM layers", "3, 4, 5", "4"),
    "nodes": ("LSTM nodes per layer", "16, 32, 64", "64, 64, 64"),
    "dropout": ("Dropout", "0.1, 0.2, 0.3, 0.4, 0.5", "0.3"),
    "learning_rate": ("Learning rate", "1e-05 to 0.001", "0.001"),
    "forest_trees": ("Forest: trees", "32 to 100", "64"),
    "forest_depth": ("Forest: greatest depth", "10 to 50", "10"),
}
"""Table I as printed: name, searched range and final value, with three numbers of nodes for four layers."""
