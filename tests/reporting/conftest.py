from made_comparison import compared, curves, strokes

__all__ = ["compared", "curves", "strokes"]
