"""The domains of the paper's two studies: bounds of the constants (GPa) and the largest anisotropy
index.
"""

__all__ = ["DOMAIN", "DOMAINS"]

#: Variables of &domain.
DOMAINS = {
    "cubic": {"c_min": (50, 40, 15), "c_max": (250, 150, 120), "anisotropy_cap": 7.2},
    "hexagonal": {
        "c_min": (80, 40, 30, 70, 40),
        "c_max": (240, 120, 90, 210, 90),
        "anisotropy_cap": 66.2,
    },
}


def namelist_group(c_min: tuple, c_max: tuple, anisotropy_cap: float) -> str:
    """The group &domain with these variables."""
    lowest, largest = (", ".join(map(str, bounds)) for bounds in (c_min, c_max))
    return f"&domain c_min = {lowest}, c_max = {largest}, anisotropy_cap = {anisotropy_cap} /\n"


#: The same as groups of a namelist.
DOMAIN = {symmetry: namelist_group(**variables) for symmetry, variables in DOMAINS.items()}
