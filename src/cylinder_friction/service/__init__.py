"""Everything asked over a network: HTTP scoring, live sessions, links, access, metrics."""
