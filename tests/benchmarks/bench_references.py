"""Step 2 beside every reference posterior of tests/reference: the largest differences, how well its
chains mixed, and what it took.
"""

import argparse
import json
import time
import warnings

import numpy as np

import bayesindent as bi
from bayesindent.crystal.elasticity import constant_names
from support.theory_cases import REFERENCE

COLUMNS = (
    "reference | grains | samples | s | CPU s | R-hat | bulk ESS | means, sd | quantiles, half "
    "90 % | sds, % | correlations | predicted means, GPa"
)


def main(argv=None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="bench references", description=__doc__)
    known = sorted(
        path.stem for path in REFERENCE.glob("*.json") if "mean" in json.loads(path.read_text())
    )
    parser.add_argument(
        "names", nargs="*", choices=[*known, []], metavar="NAME", help=f"{', '.join(known)} (all)"
    )
    parser.add_argument("--samples", type=int, default=50000, help="of each of four chains (50000)")
    parser.add_argument("--seed", type=int, default=1, help="of the chains (1)")
    arguments = parser.parse_args(argv)
    warnings.simplefilter("ignore", bi.BayesindentWarning)
    print(f"| {COLUMNS} |\n|{'---|' * len(COLUMNS.split('|'))}")
    for name in arguments.names or known:
        print(
            f"| {name} | {' | '.join(row(name, arguments.samples, arguments.seed))} |", flush=True
        )
    return 0


def row(name: str, samples: int, seed: int) -> list[str]:
    """What is found, beside the document of the reference, which lists its constants in the order
    of their class.
    """
    expected = json.loads((REFERENCE / f"{name}.json").read_text())
    symmetry = expected["symmetry"]
    settings = {
        "symmetry": symmetry,
        "modulus_kind": "indentation_modulus",
        "samples": samples,
        "seed": seed,
    }
    if "bounds" in expected:
        bounds = zip(*expected["bounds"], strict=True)
        settings |= {
            "bounds": dict(zip(constant_names(symmetry), bounds, strict=True)),
            "anisotropy_cap": expected["anisotropy_cap"],
        }
    start, used = time.monotonic(), time.process_time()
    result = bi.extract(REFERENCE / f"{name}.csv", **settings)
    seconds, cpu = time.monotonic() - start, time.process_time() - used
    draws = np.stack(
        [result.posterior[constant].values.ravel() for constant in constant_names(symmetry)]
    )
    parameters = bi.summary(result)["parameters"].values()
    predicted = (
        result.predictions["modulus"]
        .values.reshape(-1, len(expected["predicted_mean"]))
        .mean(axis=0)
    )
    quantiles = "-"
    if "quantiles" in expected:
        wanted = np.array(expected["quantiles"])
        apart = np.quantile(draws, expected["quantile_shares"], axis=1) - wanted
        quantiles = f"{np.abs(2 * apart / (wanted[-1] - wanted[0])).max():.3f}"
    return [
        str(len(predicted)),
        f"4 × {samples:,}",
        f"{seconds:.0f}",
        f"{cpu:.0f}",
        f"{max(values['r_hat'] for values in parameters):.3f}",
        f"{min(values['ess_bulk'] for values in parameters):,.0f}",
        f"{np.abs((draws.mean(axis=1) - expected['mean']) / expected['sd']).max():.3f}",
        quantiles,
        f"{100 * np.abs(draws.std(axis=1) / expected['sd'] - 1).max():.1f}",
        f"{np.abs(np.corrcoef(draws) - expected['corr']).max():.3f}",
        f"{np.abs(predicted - expected['predicted_mean']).max():.3f}",
    ]
