"""What a recording is, how files become one, how it is checked, stored and split."""
