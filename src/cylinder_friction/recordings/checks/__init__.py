"""What a recording must be: range, motion, plausibility, and that it is not another recording again."""
