"""Numbers and other programs' words as messages and pages state them."""


def four_digits(value: float) -> str:
    """Return a number with four digits and no power of ten in between."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def in_brief(error: object, longest: int = 200) -> str:
    """Return what an error states, on one line of at most this many characters."""
    return " ".join(str(error).split())[:longest]


def printable(text: str) -> str:
    """Return text on one line without a terminal's commands: line ends and other controls are written out."""
    return "".join(each if each.isprintable() else f"\\u{ord(each):04x}" for each in text)
