"""Each command is a function of the package by its name."""

import json

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.program.commands import SUMMARIES
from support.tree import SOURCE

DEVELOPERS = {"reproduce", "test", "dev"}


def test_every_command_of_users_is_a_function():
    assert all(callable(getattr(bi, name)) for name in SUMMARIES.keys() - DEVELOPERS)
    assert {*SUMMARIES} - DEVELOPERS <= {*dir(bi)} and "import_module" not in dir(bi)


def test_a_function_gives_the_document_of_its_command(bayesindent, tmp_path):
    source = SOURCE / "inputs" / "zinc.nml"
    document = bi.theory(source, output=tmp_path / "python")
    told = bayesindent("theory", source, "--output", tmp_path / "command", "--json")
    expected = [row["indentation_modulus_gpa"] for row in json.loads(told.stdout)["results"]]
    found = [row["indentation_modulus_gpa"] for row in document["results"]]
    assert np.allclose(found, expected, rtol=1e-12)
    assert bi.theory.__doc__.startswith("Exact theory of the same crystals.")


def test_wrong_words_are_an_error_of_the_input(tmp_path, capsys):
    with pytest.raises(bi.InputError, match="bi.theory: see bayesindent theory --help"):
        bi.theory()
    with pytest.raises(bi.InputError, match="none.nml"):
        bi.theory(tmp_path / "none.nml")
