"""Diagnostics are data: docs/diagnostics.md has a row for each code, the core fills its sentences,
and nothing depends on their words.

Modules: diagnostics.f90, diagnostics.py, page_rows.py.
"""

import ast
import importlib.util
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

import bayesindent as bi
from bayesindent import core
from bayesindent.common import diagnostics
from bayesindent.program.cli import main
from bayesindent.report.results import Results
from bayesindent.report.summary import CONSEQUENCES, advice
from support.diagnostics import ROWS, codes, rows_of
from support.programs import BATCH, SANITIZED
from support.testing_core import inside
from support.tree import BUILD, SOURCE
from support.warning_cases import CASES, measured, write_case

PAGE = SOURCE / "docs" / "diagnostics.md"
COLUMNS = ["code", "severity", "consequence", "numbers", "sentence", "remedy"]
KEYS = ["code", "severity", "consequence", "subject", "numbers", "text", "remedy"]
#: Subjects that could be taken for places, for JSON, or for a row of a table.
SUBJECTS = ["", "{subject}", "{percent:.1f} {}", "a 'b' \"c\" \\ | é µ", "}{", "two\tblanks"]


def names_of(row) -> list[str]:
    """The names of the numbers of a row."""
    return [name.strip() for name in row["numbers"].split(",") if name.strip()]


def places_of(text) -> list[tuple[str, str]]:
    """Name and format of the places of a sentence or a remedy."""
    return [(name, form) for _, name, form, _ in Formatter().parse(text) if name is not None]


def in_document(code: str, subject: str = "", numbers=()) -> dict:
    """A diagnostic as the core writes it into a document."""
    with inside():
        page = core.call(
            "test.diagnostic", code=code, subject=subject, numbers=np.array(numbers, float)
        )
    (found,) = json.loads(page["text"])
    return found


def test_a_code_has_one_row_and_every_row_the_same_columns():
    rows = rows_of(PAGE.read_text())
    assert len(rows) == len(ROWS) > 50
    assert all(list(row) == COLUMNS for row in rows)
    assert all(re.fullmatch("[a-z]+(_[a-z]+)*", code) for code in ROWS)


def test_the_page_lists_the_consequences_of_the_report_in_its_order():
    assert re.findall(r"^- `(\w+)`: ", PAGE.read_text(), re.MULTILINE) == list(CONSEQUENCES)


@pytest.mark.parametrize("code", ROWS)
def test_a_row_is_right(code):
    row = ROWS[code]
    names = names_of(row)
    assert row["severity"] in ("unusable", "warning", "note")
    assert row["consequence"] in CONSEQUENCES
    assert len(set(names)) == len(names) and "subject" not in names
    assert all(re.fullmatch("[a-z_]+", name) for name in names)
    for cell in (row["sentence"], row["remedy"]):
        for name, form in places_of(cell):
            assert (form == "") if name == "subject" else (name in names)
            # One digit of decimals or of significant digits is what the core reads.
            assert name == "subject" or re.fullmatch(r"\.\d[fg]", form), form
        # The console and the report put the full stop.
        assert not cell.endswith(".")
    assert row["sentence"]


def literals_of_fortran(path):
    """Texts of a source; comments are left out."""
    lines = [line for line in path.read_text().splitlines() if not line.lstrip().startswith("!")]
    return [text.strip() for text in re.findall(r"'((?:[^'\n]|'')*)'", "\n".join(lines))]


def literals_of_python(path):
    """Texts of a source, those of f-strings as they begin."""
    tree = ast.parse(path.read_text())
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]


FORTRAN = sorted((SOURCE / "fortran").rglob("*.f90"))
PYTHON = sorted((SOURCE / "python").rglob("*.py"))


def test_every_row_is_used():
    found = {text for path in FORTRAN for text in literals_of_fortran(path)}
    # Tables and maps of Python hand a code and its subject to the core in one line.
    found |= {text.split(" ")[0] for path in PYTHON for text in literals_of_python(path)}
    assert sorted(set(ROWS) - found) == []


def test_every_code_that_is_used_is_a_row():
    used = set()
    for path in FORTRAN:
        text = re.sub(r"&\s*\n\s*&", "", path.read_text())
        # The first argument, a text or the choice between two; or the variable that holds one.
        for start in re.findall(r"(?:\bdiagnostic\(|%warn\(|\bcode = )([^\n]*)", text):
            first = re.match(r"(?:trim\(merge\()?'(\w+) *'(?:, *'(\w+) *')?", start)
            if first and (start.startswith("trim(merge(") or not first[2]):
                used |= {code for code in first.groups() if code}
            elif first:
                used.add(first[1])
    assert len(used) > 40
    for path in PYTHON:
        for node in ast.walk(ast.parse(path.read_text())):
            called = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "diagnostic"
            if called and isinstance(node.args[0], ast.Constant):
                used.add(node.args[0].value)
    assert sorted(used - set(ROWS)) == []


@pytest.mark.parametrize("code", [code for code in ROWS if names_of(ROWS[code])])
def test_numbers_are_written_as_python_does(code):
    """All digits are those of Python's format. Fortran writes 16. or 16.0 where Python writes 16,
    and an exponent of three digits.
    """
    row = ROWS[code]
    sentence, names = row["sentence"], names_of(row)
    places = places_of(sentence)
    cut = re.split(r"\{[^}]*\}", sentence)
    pattern = re.compile("(.*)".join(map(re.escape, cut)))
    rng = np.random.default_rng(len(sentence))
    for _ in range(40):
        numbers = rng.choice([-1, 1], len(names)) * 10 ** rng.uniform(-7, 7, len(names))
        numbers = np.where(rng.uniform(size=len(names)) < 0.3, numbers.round(), numbers)
        found = in_document(code, "§", numbers)
        assert list(found) == KEYS
        assert found["numbers"] == dict(zip(names, numbers, strict=True))
        values = {"subject": "§"} | found["numbers"]
        texts = pattern.fullmatch(found["text"]).groups()
        for (name, form), text in zip(places, texts, strict=True):
            expected = format(values[name], form)
            if form.endswith("g") and ("." not in expected or "e" in expected):
                assert float(text) == float(expected), (form, values[name])
            else:
                assert text == expected, (form, values[name])


@pytest.mark.parametrize("value", [0.0, 0.5, 1.5, 2.5, 0.05, 0.15, 9.995, 99.95, 1e-4, 123456.5])
def test_ties_and_limits_are_rounded_as_python_does(value):
    found = in_document("plastic_contact", "", [value, value, 1.0])
    assert f"{value:.3g} GPa" in re.sub(r"(\d)\.0?(?= GPa)", r"\1", found["text"]) or value >= 1000
    found = in_document("tests_disagree", "a", [value, value, value, value])
    assert (
        f"its {value:.0f} tests" in found["text"] and f"other, {value:.1f} times" in found["text"]
    )


@pytest.mark.parametrize("subject", SUBJECTS)
def test_a_subject_is_taken_as_it_is(subject):
    alone = diagnostics.diagnostic("table_changed", subject)
    assert (alone["subject"], alone["text"], alone["numbers"]) == (subject, subject, {})
    assert alone == in_document("table_changed", subject)
    with_numbers = in_document("small_sds", subject, [0.0095, 0.3])
    assert with_numbers["subject"] == subject
    assert with_numbers["text"].startswith(f"{subject}: the sds are 0.0095 % of")
    assert json.loads(json.dumps(with_numbers)) == with_numbers


def test_a_code_without_subject_and_numbers():
    found = diagnostics.diagnostic("compared_classes")
    row = ROWS["compared_classes"]
    assert list(found) == KEYS
    assert found["text"] == row["sentence"] == diagnostics.message(found)
    assert (found["subject"], found["numbers"], found["remedy"]) == ("", {}, "")
    assert diagnostics.labelled(found) == f"warning: {row['sentence']}"


def test_severities_and_repetitions():
    grave = in_document("not_mixed", "C12", [1.2, 1.05])
    helpful = in_document("knowledge_helps", "a", [31.25, 2.75])
    assert [diagnostics.is_unusable(found) for found in (grave, helpful)] == [True, False]
    row = ROWS["not_mixed"]
    sentence = row["sentence"].format(subject="C12", r_hat=1.2, allowed=1.05)
    assert diagnostics.message(grave) == f"{sentence}. {row['remedy']}"
    assert diagnostics.labelled(grave).startswith(f"the result cannot be used: {sentence}")
    assert diagnostics.labelled(helpful).startswith("note: a from 31.2 to 2.75 GPa")
    other = in_document("not_mixed", "C11", [1.2, 1.05])
    table = in_document("table_changed", "a.csv: read as UTF-16", [])
    found = [table, grave, helpful, grave, other]
    assert diagnostics.distinct(found) == [grave, other, table, helpful]


def test_a_warning_of_python_keeps_its_diagnostic():
    found = diagnostics.diagnostic("compared_classes")
    warning = bi.BayesindentWarning("why")
    warning.diagnostic = found
    warning = pickle.loads(pickle.dumps(warning))
    assert (str(warning), warning.diagnostic) == ("why", found)
    assert bi.BayesindentWarning("why").diagnostic == {}


def test_no_page_is_read_at_run_time():
    """The pages make modules when the program is built; the package has none of them, and no text
    of its code names one.
    """
    folder = Path(bi.__file__).parent
    assert not [*folder.rglob("*.md")]
    for file in folder.rglob("*.py"):
        nodes = [*ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
        prose = {node.value for node in nodes if isinstance(node, ast.Expr)}
        texts = {node for node in nodes if isinstance(node, ast.Constant)} - prose
        assert not [node.value for node in texts if str(node.value).endswith(".md")], file


def test_the_module_of_a_page_has_its_cells():
    place = SOURCE / "fortran" / "common" / "page_rows.py"
    specification = importlib.util.spec_from_file_location("page_rows", place)
    page_rows = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(page_rows)
    cells = ["it's 'so'", "", "µ" * 30 + " Poisson's", "a long one, 'quoted' " * 20 + "."]
    table = "\n".join(f"| code_{i} | {cell} |" for i, cell in enumerate(cells[:2]))
    other = "\n".join(f"| code_{i + 2} | {cell} |" for i, cell in enumerate(cells[2:]))
    head = "| code | words |\n|---|---|\n"
    made = page_rows.module(f"# A page\n\n{head}{table}\n\n## More\n\n{head}{other}\n", "a_page")
    assert "module a_page_rows" in made and "public :: words_column(4)" in made
    assert max(map(len, made.splitlines())) <= 132
    joined = re.sub(r"' &\n +& //'", "", made.split("words_column")[1])
    found = [text.replace("''", "'") for text in re.findall(r"'((?:[^'\n]|'')*)'", joined)]
    assert found == cells
    longest = max(len(cell.encode()) for cell in cells)
    assert f"character(len={longest}), parameter, public :: words_column" in made


def test_what_makes_a_result_unusable_comes_first(batch, tmp_path):
    """Knowledge beyond the stated limits: the model without the one or the other; the rest follows
    from it.
    """
    table, stated = CASES["wrong"]
    done = batch(write_case(tmp_path, "wrong", table(), **stated), "--output", "out")
    document = json.loads((tmp_path / "out" / "summary.json").read_text())
    first, *others = document["warnings"]
    assert (done.returncode, first["code"], document["usable"]) == (3, "other_model", False)
    without = ("bulk_modulus = 300.0 of another crystal", "crystals beyond the limits of the prior")
    assert first["subject"].startswith(without)
    assert document["reasons"][0] == diagnostics.message(first)
    assert "truncated" in codes(others)


#: What depends on the clock, the folder, or on texts of diagnostics.
LEFT_OUT = {"text", "reasons", "seconds", "checksum", "inputs", "namelist", "resolved"}


def without_texts(page):
    """A document without what is left out."""
    if isinstance(page, dict):
        return {key: without_texts(page[key]) for key in page if key not in LEFT_OUT}
    return [without_texts(item) for item in page] if isinstance(page, list) else page


def documents_of(folder: Path) -> dict:
    """All documents of a folder of results by name, without what is left out."""
    return {
        path.name: without_texts(json.loads(path.read_text()))
        for path in sorted(folder.glob("*.json"))
    }


@pytest.mark.filterwarnings("ignore")
def test_the_name_of_a_table_changes_no_verdict(tmp_path, few_figures, monkeypatch, capsys):
    """A name such as high_pressure.csv once led a warning under another heading."""
    pages, headings, counsels = [], [], []
    for name in ("high_pressure", "ok"):
        folder = tmp_path / name
        folder.mkdir()
        monkeypatch.chdir(folder)
        write_case(folder, name, measured(sd=0.0001), measurements=", scale = 'inferred'").rename(
            "a.nml"
        )
        assert main(["run", "a.nml", "--output", "out"]) in (0, 3)
        text = json.dumps(documents_of(folder / "out")).replace(f"{name}.csv", "NAME.csv")
        pages.append(json.loads(text))
        page = (folder / "out" / "report.html").read_text()
        headings.append(re.findall(r"<h[1-6][^>]*>.*?</h[1-6]>", page, re.DOTALL))
        found = json.dumps(advice(Results(folder / "out")))
        counsels.append(json.loads(found.replace(f"{name}.csv", "NAME.csv")))
    assert pages[0] == pages[1]
    assert "small_sds" in codes(pages[0]["summary.json"]["warnings"])
    assert headings[0] == headings[1] and len(headings[0]) > 5
    assert counsels[0] == counsels[1] and CONSEQUENCES["inputs"] in counsels[0]


def build_without_sentences(folder: Path) -> Path:
    """The batch program that is tested, linked anew with codes in place of all sentences."""
    text = (SOURCE / "docs" / "diagnostics.md").read_text()
    for code, row in ROWS.items():
        line = next(line for line in text.splitlines() if line.startswith(f"| {code} |"))
        text = text.replace(line, line.replace(f"| {row['sentence']} |", f"| {code} |"))
    assert {row["sentence"] for row in rows_of(text)} == set(ROWS)
    page = folder / "diagnostics.md"
    page.write_text(text)
    copy = folder / "build"
    for name in ("fortran", "cpp", "python/bayesindent/data"):
        shutil.copytree(BUILD / name, copy / name)

    program = "fortran/bayesindent-batch"
    # Ninja may stand beside this Python.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ninja = shutil.which("ninja", path=path)
    listed = subprocess.run(
        [ninja, "-C", BUILD, "-t", "commands", program], capture_output=True, text=True, check=True
    )
    *steps, link = [line for line in listed.stdout.splitlines() if "ninja: " not in line]
    steps = [step for step in steps if re.search(r"\bdiagnostics(_rows)?\.f90\b", step)]
    for step in [*steps, link]:
        words = step.split()
        outside = {word for word in words if word.startswith("..")}
        words = [str((BUILD / word).resolve()) if word in outside else word for word in words]
        words = [str(page) if word.endswith("docs/diagnostics.md") else word for word in words]
        subprocess.run(" ".join(words), shell=True, cwd=copy, check=True)
    return copy / program


#: Cases whose diagnostics others give as well.
WITHOUT_OWN_CODE = {"misread", "outlier", "contradicting", "sds_below", "sds_above"}


@pytest.mark.long
@pytest.mark.skipif(not BUILD or SANITIZED, reason="the objects of a build are needed")
def test_nothing_but_texts_depends_on_the_sentences(tmp_path):
    """A program that has codes for sentences: the same status, verdicts and documents, for cases
    that give most of the warnings of Step 2, and for the checks of all namelists of inputs/.
    """
    programs = {"words": BATCH, "codes": build_without_sentences(tmp_path)}
    ended, documents, texts = {}, {}, {}
    for kind, program in programs.items():
        folder = tmp_path / kind
        shutil.copytree(SOURCE / "inputs", folder)
        names = []
        for name in CASES.keys() - WITHOUT_OWN_CODE:
            table, stated = CASES[name]
            names.append(write_case(folder, name, table(), **stated).name)
        checked = [path.relative_to(folder) for path in sorted(folder.rglob("*.nml"))]
        runs = [(name, "--output", f"out/{name}") for name in names]
        runs += [(path, "--check") for path in checked if path.name not in names]
        for words in runs:
            done = subprocess.run(
                [program, *words], cwd=folder, capture_output=True, text=True, check=False
            )
            # A refusal is no diagnostic: its words stay, but for the memory of that moment.
            said = re.sub(r"[\d.]+ GB", "", done.stderr) if done.returncode == 2 else ""
            ended.setdefault(kind, {})[str(words[0])] = done.returncode, said
        results = sorted((folder / "out").iterdir())
        documents[kind] = {path.name: documents_of(path) for path in results}
        texts[kind] = {
            (found["code"], found["text"])
            for path in sorted((folder / "out").rglob("*.json"))
            for found in json.loads(path.read_text()).get("warnings", [])
        }
    assert ended["words"] == ended["codes"]
    assert {status for status, _ in ended["words"].values()} == {0, 2, 3}
    assert documents["words"] == documents["codes"]
    # The copy knows no sentence, and most codes of measurements and posteriors are there.
    assert all(code == text for code, text in texts["codes"])
    given = {code for code, _ in texts["words"]}
    assert given == {code for code, _ in texts["codes"]}
    assert len(given) >= 25, sorted(given)
