"""Identification of friction models: steady points, presliding, the joint search and confidence intervals."""
