"""Every model of the literature, on tasks where learning is worth something, beside the baseline of each."""
