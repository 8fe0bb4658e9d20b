"""Numbers as messages and pages state them."""


def four_digits(value: float) -> str:
    """Return a number with four digits and no power of ten in between."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
