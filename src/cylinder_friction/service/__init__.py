"""Everything that is asked over a network: tables scored over HTTP, live sessions, their links, access, logs."""
