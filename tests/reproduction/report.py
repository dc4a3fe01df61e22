"""The page of the reproduction."""

from reproduction.chapters import choices, degree_3, on_block, step_1
from reproduction.constants import step_2
from reproduction.overview import overview
from reproduction.page import Page
from reproduction.run import Results

__all__ = ["make_page"]


def make_page(results: Results, commit: str) -> Page:
    """All chapters."""
    page, plan = Page("The paper, reproduced"), results.plan
    option = " --quick" if plan.is_quick else ""
    page.code(f"./bayesindent reproduce{option}")
    page.text(
        "Castillo and Kalidindi, A Bayesian Framework for the Estimation of the Single Crystal "
        "Elastic Parameters from Spherical Indentation Stress-Strain Measurements: both case "
        "studies from finite elements to posteriors. An interrupted command resumes.",
    )
    if plan.is_quick:
        page.text(
            f"**Quick:** {results.simulations} simulations and few seeds; in the hexagonal case "
            "theory in place of simulations. Errors are not comparable with the paper's."
        )
    page.heading("The paper beside ours")
    overview(page, results)
    on_block(page, results)
    for symmetry in ("cubic", "hexagonal"):
        step_1(page, results, symmetry)
    choices(page, results)
    degree_3(page, results)
    for symmetry in results.studies:
        step_2(page, results, symmetry)
    cost(page, results, commit)
    return page


def cost(page: Page, results: Results, commit: str) -> None:
    """What the run took, against its simulations alone."""
    one = results.zinc["C3D8, default"]["cpu_s"]
    many = results.simulations
    allowed = 1.15 * many * one / 60 + 15
    page.heading("How this page was made")
    page.text(
        f"Commit {commit or 'unknown'}. {many} simulations of the two case studies and of the "
        f"independent crystals, none of which may fail; {results.cpu_s / 60:.1f} CPU minutes in "
        f"all, with what killed runs took. One curve took {one:.2f} CPU seconds in the same run; "
        f"1.15 times the simulations and 15 minutes are {allowed:.1f} minutes."
    )
    page.numbers = {
        "simulations": many,
        "failed": sum(document["failed"] for document in results.documents.values()),
        "cpu_s": results.cpu_s,
        "curve_cpu_s": one,
        "loocv_gpa": {name: doc["loocv_gpa"] for name, doc in results.documents.items()},
        "unseen_gpa": {
            name: doc["validation"]["mean_absolute_gpa"] for name, doc in results.documents.items()
        },
    }
