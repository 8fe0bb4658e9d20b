"""Everything asked over a network: live sessions, links, access, metrics."""
