"""Standard errors of means, from standard deviations of tests or from repeated tests."""

import re

import numpy as np
import pandas as pd

from ..core import InputError
from .cells import plain_numbers, value_of
from .columns import DEVIATIONS, MODULI, split_deviation
from .table import LaboratoryTable, lines_in_words

#: Headers of a number of tests, such as "No. of indents".
COUNT = re.compile(
    r"n|count|((n|#|number of|no\. of)[ _]?)?\(?(tests|indents|indentations|measurements)\)?", re.I
)
#: Grains with fewer tests get the sd pooled over all grains: with 9 degrees of freedom an own sd is
#: known to a quarter.
FEW_TESTS = 10


def standard_errors(table: LaboratoryTable) -> None:
    """Make the sds those of the values. Tests without sds get the standard deviation of the tests
    of their grain, or the pooled one if these are few; the core combines the tests of a grain.
    """
    modulus, sd, grain = (table.column(*names) for names in (MODULI, ("sd_gpa",), ("grain",)))
    if sd >= 0:
        divide_by_root_of_tests(table, sd)
    elif grain >= 0 and modulus >= 0 and plain_numbers(table.cells[modulus].tolist()):
        pool_tests(table, modulus, grain)


def is_deviation(header: str) -> bool:
    """Whether a header is that of a standard deviation of single tests, in GPa or in per cent."""
    word = re.sub(r"^rel\w*?_|_percent$", "", split_deviation(header)[0])
    return header != "sd_gpa" and (word in DEVIATIONS or bool(re.fullmatch(r"%_?|rsd|co?v", word)))


def divide_by_root_of_tests(table: LaboratoryTable, sd: int) -> None:
    """Divide standard deviations of tests by the root of the number of tests."""
    number = next((j for j, name in enumerate(table.names) if COUNT.fullmatch(name)), -1)
    if number < 0 or table.meanings[number]:
        return
    cells, name, sds = table.cells[number], table.names[sd], table.cells[sd]
    if len(cells) > 2 and cells.tolist() == list(map(str, range(1, len(cells) + 1))):
        table.note(
            f"column {table.names[number]}: numbers the rows; not taken for numbers of tests"
        )
        return
    if name in table.stated or not is_deviation(name) or not plain_numbers(sds.tolist()):
        return
    counts = pd.to_numeric(cells, errors="coerce")
    wrong = cells.index[~counts.between(1, 1e9) | (counts % 1 > 0)]
    if len(wrong):
        raise InputError(
            f"column {table.names[number]}, {lines_in_words(wrong)}: a number "
            f"of tests is needed; if {name} is a standard error, name it sd_gpa"
        )
    table.cells[sd] = (sds.map(value_of) / np.sqrt(counts)).map(repr)
    table.meanings[number] = "number of tests"
    table.note(
        f"column {name}: divided by the root of {table.names[number]} tests: the standard error "
        "of the mean"
    )


def pool_tests(table: LaboratoryTable, modulus: int, grain: int) -> None:
    """Add the column of the sds of repeated tests."""
    values = table.cells[modulus].map(value_of)
    tests = values.groupby(table.cells[grain], sort=False)
    freedom = len(values) - tests.ngroups
    squares = (values - tests.transform("mean")) ** 2
    pooled = float(np.sqrt(squares.sum() / max(1, freedom)))
    if not pooled > 0:
        return
    sds = tests.transform("std").where(tests.transform("count") >= FEW_TESTS, pooled)
    table.add_column("sd_gpa", list(map(repr, sds.tolist())))
    table.note(
        f"{len(values)} tests of {tests.ngroups} grains became means with standard errors; the "
        f"sd of a test is {pooled:.3g} GPa, pooled over grains with fewer than {FEW_TESTS} "
        f"tests ({freedom} degrees of freedom)"
    )
