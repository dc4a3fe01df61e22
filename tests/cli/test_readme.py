"""What README.md shows is what the program prints."""

import re

import pytest

import bayesindent as bi
from conftest import SOURCE

pytestmark = pytest.mark.long

README = (SOURCE / "README.md").read_text()

#: How far a printed number may be from another machine's: by the first word of its line, or else for a row of `next`. The first share
#: is relative. Errors of Monte Carlo are a tenth of these; a most probable point on a long ridge is worth little.
TOLERANCES = {
    "Surrogate:": [(0, 0), (0, 0), (0, 0), (0, 0), (0.5, 0), (0.5, 0), (0.5, 0), (1, 0), (1, 0)],
    "Theory": [(0, 3.0), (0, 1.5), (0, 3.0), (0, 1.5), (0, 3.0), (0, 1.5)],
    **{key: [(0, 1.0), (0, 1.0), (0, 25.0), (0, 3.0), (0, 3.0), (0, 0.03), (0, 0.01), (0.5, 0), (0.5, 0)] for key in ("C11", "C12", "C44")},
}
#: The first grain to be measured; those after it are near each other in gain, so that their order may be another.
FIRST = [(0, 15.0), (0, 15.0), (0, 15.0), (0, 9.0), (0, 9.0), (0, 9.0), (0.2, 0)]
OTHER = [(0, 0), (0, 90.0), (0, 90.0), (0, 9.0), (0, 9.0), (0, 9.0), (0.2, 0.004)]
NUMBER = r"(?<![\w-])\d+(?:\.\d+)?(?![\w%-])"


def block(start):
    """The block of code of README.md that holds `start`."""
    return next(text for text in README.split("```")[1::2] if start in text).partition("\n")[2]


def words(line):
    """A line without its numbers and checksums; columns may be wider elsewhere."""
    return re.sub(r"\s+", " ", re.sub(NUMBER, "#", re.sub(r"\b[0-9A-F]{16}\b", "#", line)))


def test_the_quickstart_prints_this(process):
    done = process("run", SOURCE / "inputs" / "quickstart.nml")
    assert done.returncode == 0, done.stderr
    shown, printed = block("Elastic constants (GPa)").strip().splitlines(), done.stdout.strip().splitlines()
    assert printed[-1] == "Report: runs/quickstart/report.html"
    assert len(shown) == len(printed) - 1
    for previous, expected, line in zip(["", *shown], shown, printed, strict=False):
        assert words(line) == words(expected)
        values = [[float(number) for number in re.findall(NUMBER, text)] for text in (line, expected)]
        others = FIRST if "phi1" in previous else OTHER
        tolerances = TOLERANCES.get(expected.split()[0], others)
        if len(tolerances) > len(values[0]):  # no most probable value
            tolerances = tolerances[:2] + tolerances[3:]
        for value, wanted, (relative, absolute) in zip(*values, tolerances, strict=False):
            assert value == pytest.approx(wanted, rel=relative, abs=absolute), line


def test_the_example_in_python_says_so(monkeypatch):
    code = block("import bayesindent as bi")
    monkeypatch.chdir(SOURCE)
    names = {}
    exec(code, names)
    posterior = names["posterior"].posterior
    for name, mean, sd in re.findall(r"(C\d\d) = (\d+) ± (\d+)", code.split("GPa\n")[0]):
        assert posterior[name].values.mean() == pytest.approx(float(mean), abs=1.5)
        assert posterior[name].values.std() == pytest.approx(float(sd), abs=1.0)
    modulus = float(re.search(r"exact theory, ([\d.]+) GPa", code)[1])
    assert bi.halfspace_modulus(names["c"], [0, 45, 0]) == pytest.approx(modulus, abs=0.005)
