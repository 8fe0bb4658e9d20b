"""Pages, figures and tables. This package draws, and computes nothing."""
