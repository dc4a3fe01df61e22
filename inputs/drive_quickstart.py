"""The quickstart step by step through the library: replace `simulate` by a simulation of your own
(Abaqus, CalculiX, measurements, ..).

    .venv/bin/python inputs/drive_quickstart.py

The numbers are those of `./bayesindent run inputs/quickstart.nml`.
"""

from pathlib import Path

import bayesindent as bi

HERE = Path(__file__).parent
GRAIN = {
    "geometry": "grain",
    "grain_radius_um": 2.5,
    "estimator": "curve",
    "matrix": "isotropic",
    "matrix_young_gpa": 411,
    "matrix_nu": 0.28,
}
GRAINS = HERE / "data" / "copper_grains.csv"
KNOWN = {"bulk_modulus": (137, 3)}  # mean and sd, GPa


def simulator(**settings):
    """A function that simulates one indentation. Yours may do so in any way."""
    grain = bi.Indentation(**GRAIN, **settings)

    def simulate(stiffness, euler_deg) -> float:
        """The indentation modulus in GPa of a crystal of this stiffness (6, 6), GPa, crystal axes,
        at these Bunge-Euler angles, degrees.
        """
        return grain.run(stiffness, euler_deg).indentation_modulus_gpa

    return simulate


def main(output="runs/drive_quickstart", simulate=None, budget=25, samples=10000):
    """Both steps, the next grain and the report of Step 1; returns what was found."""
    # Step 1: simulations of the grain, the first for crystals of every kind, the others where the
    # measurements say that the crystal is. Call it again, and it continues.
    problem = bi.Problem.from_keywords(
        "drive_quickstart.py",
        problem={"symmetry": "cubic", "seed": 1, "synthetic": True},
        specimen=GRAIN,
        simulation={"simulator": "import"},
        design={"budget": budget},
        measurements={"file": str(GRAINS), "modulus_kind": "indentation_modulus"},
        knowledge={
            "quantity": "bulk_modulus",
            "mean": KNOWN["bulk_modulus"][0],
            "sd": KNOWN["bulk_modulus"][1],
        },
    )
    surrogate = bi.build(problem, output, simulate=simulate or simulator())
    print(surrogate)

    # Step 2: the constants behind the measured moduli; warnings are Python's own.
    asked = {
        "symmetry": "cubic",
        "modulus_kind": "indentation_modulus",
        "technique": "exact",  # these moduli are computed, not measured
        "knowledge": KNOWN,
        "samples": samples,
        "chains": 4,
    }
    posterior = bi.extract(GRAINS, surrogate=surrogate, **asked)
    for name, item in bi.summary(posterior)["parameters"].items():
        print(f"{name} = {item['mean']:.1f} ± {item['sd']:.1f} GPa")

    # What to measure next.
    suggestions = bi.next_grain(GRAINS, surrogate=surrogate, result=posterior, count=5, **asked)[
        "suggestions"
    ]
    for item in suggestions:
        print(
            "next grain, Bunge-Euler angles in degrees:",
            [round(angle, 1) for angle in item["euler_deg"]],
        )

    print(bi.report(output))
    return surrogate, posterior, suggestions


if __name__ == "__main__":
    main()
