"""`bi.analysis`: Step 2 as an object gives what the functions give."""

import numpy as np
import pytest

import bayesindent as bi
from support.tree import REFERENCE

pytestmark = pytest.mark.filterwarnings("ignore::bayesindent.BayesindentWarning")
TABLE = REFERENCE / "cubic_fe3si.csv"
KEYWORDS = {
    "modulus_kind": "indentation_modulus",
    "knowledge": {"bulk_modulus": (180.0, 5.0)},
    "samples": 500,
    "burn_in": 1500,
    "chains": 2,
}


@pytest.fixture(scope="module")
def analysis():
    return bi.analysis(TABLE, "cubic", **KEYWORDS)


def test_the_posterior_is_that_of_extract(analysis):
    result = bi.extract(TABLE, "cubic", **KEYWORDS)
    for name in bi.constants("cubic"):
        assert np.array_equal(analysis.posterior.posterior[name], result.posterior[name])
    assert analysis.summary()["parameters"] == bi.summary(result)["parameters"]


def test_moduli_are_predicted_as_those_of_the_grains(analysis):
    grains = analysis.summary()["predicted"]
    mean, sd = analysis.predict([grain["euler_deg"] for grain in grains])
    expected = np.array([[grain["mean"], grain["sd"]] for grain in grains]).T
    # Both are over a part of the draws.
    assert np.all(np.abs(mean - expected[0]) < 0.2 * expected[1])
    assert np.allclose(sd, expected[1], rtol=0.15)


def test_next_and_plan_are_those_of_the_functions(analysis):
    suggested = analysis.next(count=2)
    assert suggested["suggestions"] == bi.next_grain(analysis.posterior, count=2)["suggestions"]
    parameters = analysis.summary()["parameters"]
    constants = [parameters[name]["mean"] for name in bi.constants("cubic")]
    planned = analysis.plan([5, 20], 0.02)["results"]
    expected = bi.plan("cubic", constants, [5, 20], 0.02, knowledge=KEYWORDS["knowledge"])
    for row, other in zip(planned, expected["results"], strict=True):
        assert row["sd"] == pytest.approx(other["sd"], rel=1e-6)


def test_the_report_is_written(analysis, tmp_path, few_figures):
    assert "<!doctype html>" in analysis.report(tmp_path).read_text()


def test_wrong_keywords_are_refused_by_name():
    with pytest.raises(bi.InputError, match=r"bi\.analysis: keyword 'sample' is unknown"):
        bi.analysis(TABLE, "cubic", sample=3)
