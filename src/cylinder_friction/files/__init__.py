"""Files that appear whole, their hashes and locks, for all three projects."""
