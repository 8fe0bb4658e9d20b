"""The benchmark as one self-contained HTML page: every figure is SVG in the page, nothing is loaded."""
