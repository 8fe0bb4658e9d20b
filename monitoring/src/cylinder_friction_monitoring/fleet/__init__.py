"""A fleet's nightly run: whose log is whose, sessions kept, entries, page, database."""
