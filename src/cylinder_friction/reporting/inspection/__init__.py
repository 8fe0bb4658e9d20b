"""Looking at recordings: the checks as text, the signals and friction as a page, and a first mapping of a new file."""
