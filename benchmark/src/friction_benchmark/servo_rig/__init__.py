"""A second simulated rig, of another structure than the default one, on which estimators are compared."""
