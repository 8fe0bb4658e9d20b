"""What a bad sample is marked as, and which of its neighbours show that it is a spike."""

OUT_OF_RANGE, AT_ITS_END, SPIKE, INFINITE = 1, 2, 3, 4  # What a sample is marked as; 0 is valid

BESIDE = 5
"""Samples on either side of a sample that it is compared with; a spike is the odd one out among all of them."""

MOST_ODD = 3  # Of those 11 samples, this many may be odd: the longest spike. Four in a row are an event, not a spike
QUIET = 0.1  # The others lie within this share of a spike's height; after a pressure surge they settle elsewhere
