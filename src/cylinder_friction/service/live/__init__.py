"""Friction of many cylinders in real time: sessions by sample index, the compiled step, a journal, links and a page."""
