"""A fleet's nightly run: assignment of logs, sessions, entries, page, database."""
