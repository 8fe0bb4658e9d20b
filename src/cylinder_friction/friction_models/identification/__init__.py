"""Identification of friction models: steady points, presliding, the joint search, and how sure it is."""
