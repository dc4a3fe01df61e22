"""The domains of the paper's two studies: bounds of the constants (GPa), and the largest anisotropy index that it met."""

from bayesindent.surrogate.domain import Domain

__all__ = ["DOMAINS"]

DOMAINS = {
    "cubic": Domain("cubic", (50, 40, 15), (250, 150, 120), 7.2),
    "hexagonal": Domain("hexagonal", (80, 40, 30, 70, 40), (240, 120, 90, 210, 90), 66.2),
}
