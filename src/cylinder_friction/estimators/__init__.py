"""Everything that estimates friction from a recording, behind one protocol."""
