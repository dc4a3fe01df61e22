"""Numbers of the paper (Castillo & Kalidindi), each with its place. Moduli and errors in GPa."""

__all__ = ["CUBIC", "HEXAGONAL", "LITERATURE", "PLACES", "STUDIES", "ZINC"]

#: Where each number of the dictionaries below is in the paper.
PLACES = {
    "pool": "3.1; 4.2",
    "crystals": "3.1",
    "directions": "3.1",
    "initial": "3.2; 4.2",
    "chosen": "3.2; 4.2",
    "unseen": "3.2; 4.2",
    "loocv": "3.2, Fig. 1; 4.2, Figs. 6 and 7",
    "unseen_error": "3.2, Fig. 3; 4.2, Fig. 8",
    "terms": "4.2",
    "anisotropy": "4.2, after Eq. 14",
    "samples": "3.3; 4.3",
    "acceptance": "2.2, after step 5",
    "mean": "3.3, Fig. 4; 4.3",
    "sd": "3.3, Fig. 4",
    "table_1": "3.3, Table 1",
    "grains": "3.3; 4.3",
}

CUBIC = {
    "pool": 2286,
    "crystals": 300,
    "directions": 9,
    "initial": 123,
    "chosen": 300,
    "unseen": 1986,
    "loocv": 2.22,
    "unseen_error": 2.16,
    "degree": 2,
    "bandlimit": 10,
    "anisotropy": 7.2,
    "samples": 50000,
    "acceptance": 0.23,
    "grains": 11,
    "mean": (222.88, 130.88, 114.13),
    "sd": (4.15, 4.55, 4.11),
    "table_1": (223, 132, 114),
    "earlier": (216, 132, 122),
}

HEXAGONAL = {
    "pool": 3200,
    "initial": 760,
    "chosen": 2200,
    "unseen": 600,
    "loocv": 1.3,
    "unseen_error": 1.2,
    "terms": 729,
    "degree": 2,
    "bandlimit": 4,
    "anisotropy": 66.2,
    "samples": 50000,
    "acceptance": 0.23,
    "grains": 50,
    "mean": (155, 89, 49, 174, 55),
    "sd": None,
}

STUDIES = {"cubic": CUBIC, "hexagonal": HEXAGONAL}

#: Table 1 for iron, and section 4.3 for titanium.
LITERATURE = {"cubic": (225, 135, 124), "hexagonal": (162, 92, 47, 180, 69)}

#: Zinc of section 4.1 in the order C11, C12, C44, C33, C13; elements of the mesh, edges of the
#: block and the radius of the tip in um.
ZINC = {
    "constants": (161.1, 34.2, 38.3, 61.1, 50.3),
    "elements": 12610,
    "width_um": 9.6,
    "height_um": 4.8,
    "radius_um": 16.0,
}
