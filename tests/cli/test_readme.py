"""What README.md shows is what the program prints."""

import re

import numpy as np
import pytest

import bayesindent as bi
from conftest import SOURCE

pytestmark = pytest.mark.long

README = (SOURCE / "README.md").read_text()

NUMBER = r"(?<![\w-])\d+(?:\.\d+)?(?![\w%-])"


def block(start):
    """The block of code of README.md that holds `start`."""
    return next(text for text in README.split("```")[1::2] if start in text).partition("\n")[2]


def words(line):
    """A line without its numbers and checksums; columns may be wider elsewhere."""
    return re.sub(r"\s+", " ", re.sub(NUMBER, "#", re.sub(r"\b[0-9A-F]{16}\b", "#", line)))


def numbers(line):
    return [float(number) for number in re.findall(NUMBER, line)]


def check_constant(value, wanted):
    """One row of the constants: a fourth of its sd for another order of simulations, which another processor may choose."""
    quarter = wanted[1] / 4
    assert value[:2] == pytest.approx(wanted[:2], abs=quarter)
    assert value[2:4] == pytest.approx(wanted[2:4], abs=3 * quarter)
    # Shares of the measurements, of what is known and of the prior, in per cent.
    assert value[4:] == pytest.approx(wanted[4:], abs=10)
    assert sum(value[4:]) == pytest.approx(100, abs=2)


def off_deg(row):
    """Between the direction of the angles of a row of `next` and that of its indices, degrees."""
    phi, phi2 = np.radians(row[1:3])
    along = np.array([np.sin(phi) * np.sin(phi2), np.sin(phi) * np.cos(phi2), np.cos(phi)])
    return np.degrees(np.arccos(along @ row[3:6] / np.linalg.norm(row[3:6])))


def check_suggestions(values, wanted):
    """Rows of `next`: indices are those of the angles, gains fall and are as large as shown; who is second may depend on the processor."""
    assert max(map(off_deg, values)) < 2.05
    gains = [row[-1] for row in values]
    assert gains == sorted(gains, reverse=True)
    assert gains == pytest.approx([row[-1] for row in wanted], rel=0.1)
    # The best one is known to some degrees.
    first, shown = (np.radians(rows[0][1]) for rows in (values, wanted))
    assert abs(np.degrees(first - shown)) < 8


def test_the_quickstart_prints_this(process):
    done = process("run", SOURCE / "inputs" / "quickstart.nml")
    assert done.returncode == 0, done.stderr
    shown, printed = block("Elastic constants (GPa)").strip().splitlines(), done.stdout.strip().splitlines()
    assert printed[-1] == "Report: runs/quickstart/report.html"
    assert [words(line) for line in printed[:-1]] == [words(line) for line in shown]
    values, wanted = ({line.split()[0]: numbers(line) for line in lines} for lines in (printed, shown))
    for name in ("C11", "C12", "C44"):
        check_constant(values[name], wanted[name])
    # Chains of the theory alone, whose sd is some 4 GPa, with thousands of effective samples.
    assert values["Theory"] == pytest.approx(wanted["Theory"], abs=0.3)
    *counts, loocv, mean, largest, anisotropy, poisson, scale = values["Surrogate:"]
    # Another processor's rounding leads to other draws, so that the loop may end one round earlier or later: within the budget of 25.
    assert counts[0] == counts[1] and 15 < counts[0] <= 25 and counts[2:] == [0, 176]
    assert 0.5 < loocv < 2 and mean < 0.3 and mean < largest < 1.5
    # The crystal of that largest sd is one of the posterior's: copper's log-anisotropy is 1.17.
    assert 0.5 < anisotropy < 2.5 and 0.25 < poisson < 0.45 and 40 < scale < 460
    begin = next(number for number, line in enumerate(shown) if line.startswith("phi1")) + 1
    check_suggestions(*([numbers(line) for line in lines[begin : len(shown)]] for lines in (printed, shown)))


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
