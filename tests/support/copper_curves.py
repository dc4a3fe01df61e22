"""Makes the data of inputs/copper_curves.nml: synthetic curves of grains of copper and of fused
quartz (see tests/support/synthetic_curves.py).

PYTHONPATH=tests .venv/bin/python -m support.copper_curves
"""

import numpy as np

import bayesindent as bi
from support.synthetic_curves import Truth
from support.tree import SOURCE

DATA = SOURCE / "inputs" / "data"
COPPER = bi.stiffness("cubic", 168.4, 121.4, 75.4)
GRAINS, POINTS = 14, 140


def main() -> None:
    """Write copper_curves.csv and copper_tests.csv."""
    rng = np.random.default_rng(11)
    angles = np.degrees(
        [
            rng.uniform(0, 2 * np.pi, GRAINS),
            np.arccos(rng.uniform(0, 1, GRAINS)),
            rng.uniform(0, 2 * np.pi, GRAINS),
        ]
    ).T.round(1)
    moduli = bi.halfspace_modulus(np.repeat(COPPER[None], GRAINS, axis=0), angles)
    truth = Truth(
        rng, grains=GRAINS, repeats=2, references=8, points=POINTS, moduli=np.asarray(moduli)
    )
    curves, tests = truth.draw()
    note = "# Synthetic: made by tests/support/copper_curves.py.\n"
    rows = [f"{name},{time:.3f},{depth:.2f},{load:.4f}\n" for name, time, depth, load in curves]
    (DATA / "copper_curves.csv").write_text(f"{note}test,time_s,depth_nm,load_mn\n{''.join(rows)}")
    of_grain = {f"g{number}": "{:g},{:g},{:g}".format(*row) for number, row in enumerate(angles, 1)}
    rows = [
        f"{name},{reference},{grain},{session},{of_grain.get(grain, ',,')}\n"
        for name, reference, grain, session in tests
    ]
    (DATA / "copper_tests.csv").write_text(
        f"{note}test,reference,grain,session,phi1_deg,Phi_deg,phi2_deg\n{''.join(rows)}"
    )
    print(
        f"radius {truth.radius:.3f} um, beta {truth.shape:.2f}, compliance "
        f"{truth.compliance:.4f} nm/mN"
    )


if __name__ == "__main__":
    main()
