"""The models of the literature, and what they share."""
