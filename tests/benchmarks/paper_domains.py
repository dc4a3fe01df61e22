"""The domains of the paper's two studies as variables of &domain: bounds of the constants (GPa), the largest anisotropy index that it met."""

__all__ = ["DOMAINS"]

DOMAINS = {
    "cubic": {"c_min": (50, 40, 15), "c_max": (250, 150, 120), "anisotropy_cap": 7.2},
    "hexagonal": {"c_min": (80, 40, 30, 70, 40), "c_max": (240, 120, 90, 210, 90), "anisotropy_cap": 66.2},
}
