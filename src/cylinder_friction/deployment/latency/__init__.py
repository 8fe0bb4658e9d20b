"""The cost of one estimate, sample by sample on one core, in every runtime and in one run."""
