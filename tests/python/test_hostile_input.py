"""Files and arguments that nobody means: refused in words, or right; never slow, never a crash."""

import os
import signal
import time

import numpy as np
import pytest

import bayesindent as bi
from bayesindent.settings.problem import Problem

COPPER = bi.stiffness("cubic", C11=168.4, C12=121.4, C44=75.4)
HEADER = "phi1_deg,Phi_deg,phi2_deg,modulus_gpa,sd_gpa\n"
START = "&problem symmetry = 'cubic' /\n"


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (
            b"&problem\n title = 'Kr\xfcmmung' /\n",
            "line 2: byte 13 is not UTF-8 (save the file as UTF-8)",
        ),
        (
            b"! ok\nx \xed\xa0\x80 is half a pair\n",
            "line 2: byte 3 is not UTF-8 (save the file as UTF-8)",
        ),
        (b"&problem\n title = '\xc3", "line 2: byte 11 is not UTF-8 (save the file as UTF-8)"),
        ("&problem /".encode("utf-16"), "the file is not plain text (save it as UTF-8)"),
        (b"\x89PNG\r\n\x1a\n\x00", "the file is not plain text (save it as UTF-8)"),
    ],
)
def test_what_is_not_utf8(tmp_path, content, cause):
    path = tmp_path / "a.nml"
    path.write_bytes(content)
    with pytest.raises(bi.InputError) as error:
        Problem(path, "run")
    assert str(error.value) == f"{path}: {cause}"


def test_every_character_of_utf8_is_read(tmp_path):
    title = "µ €  \u07ff \u0800 \ud7ff \ue000 \uffff \U00010000 \U0010ffff"
    path = tmp_path / "a.nml"
    path.write_text(f"\ufeff&problem symmetry = 'cubic', title = '{title}' /\n", encoding="utf-8")
    with pytest.raises(bi.InputError, match="group is missing|nothing to do"):
        Problem(path, "extract")
    path.write_text(
        f"{START[:-2]}, title = '{title}' /\n"
        "&measurements file = 'a.csv', modulus_kind = 'indentation_modulus' /\n"
    )
    (tmp_path / "a.csv").write_text(HEADER + "1,2,3,200,4\n", encoding="utf-8")
    assert Problem(path, "extract").settings.problem.title == title


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        START + " " * 1000000,
        "! " + "a" * 1000000 + "\n" + START,
        "&problem title = '" + "a" * 1000000 + "' /",
        "&problem title = '" + "''" * 500000 + "' /",
        "&problem title = '" + "a" * 1000000,
        "&problem " + " ".join(f"a{i} = 1" for i in range(100000)) + " /",
        "\n".join(f"&a{i} /" for i in range(100000)),
        START + "&domain c_min = " + "1.0, " * 200000 + "1 /",
    ],
    ids=["blanks", "comment", "text", "quotes", "open text", "variables", "groups", "values"],
)
def test_long_texts_are_read_in_a_time_that_is_their_length(tmp_path, text):
    path = tmp_path / "a.nml"
    taken = []
    for length in (4, 1):
        # Shorter ones are cut, which is as wrong.
        path.write_text(text[: len(text) // length])
        start = time.process_time()
        with pytest.raises(bi.InputError, match=f"^{path}: ") as error:
            Problem(path, "extract")
        taken.append(time.process_time() - start)
        assert len(str(error.value)) < 500
    # Four times as long a text takes four times as long; sixteen times where each part is compared
    # with each.
    assert taken[1] < 10 * taken[0] + 0.5


@pytest.mark.parametrize("threads", [-1, 0, 3, 100000, 2**31 - 1])
def test_any_number_of_threads_gives_the_same(threads):
    angles = np.random.default_rng(1).uniform(0, 90, (50, 3))
    assert np.array_equal(
        bi.halfspace_modulus(COPPER, angles, threads=threads), bi.halfspace_modulus(COPPER, angles)
    )


def test_a_forked_process_works_alone():
    # A child has none of its parent's threads, for which OpenMP would wait for ever.
    angles = np.random.default_rng(1).uniform(0, 90, (50, 3))
    expected = bi.halfspace_modulus(COPPER, angles, threads=2)
    child = os.fork()
    if child == 0:
        signal.alarm(600)
        os._exit(
            0 if np.array_equal(bi.halfspace_modulus(COPPER, angles, threads=2), expected) else 1
        )
    assert os.waitpid(child, 0)[1] == 0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bi.stiffness("cubic", C11=float("nan"), C12=1, C44=1), "not finite"),
        (lambda: bi.stiffness("cubic", C11=[1.0, np.inf], C12=1, C44=1), "not finite"),
        (lambda: bi.halfspace_modulus(COPPER * np.nan, [0, 0, 0]), "not finite"),
        (lambda: bi.halfspace_modulus(COPPER, [0, np.nan, 0]), "not finite"),
        (
            lambda: bi.halfspace_modulus(np.zeros((0, 6, 6)), np.zeros((0, 3))),
            "there are no crystals",
        ),
        (
            lambda: bi.Surrogate.load("block").predict(np.zeros((0, 6, 6)), np.zeros((0, 3))),
            "there are no crystals",
        ),
        (lambda: bi.halfspace_modulus(np.zeros((6, 6)), [0, 0, 0]), "unstable"),
        (lambda: bi.halfspace_modulus(np.eye(5), [0, 0, 0]), "shape"),
        (lambda: bi.halfspace_modulus([COPPER] * 2, [[0, 0, 0]] * 3), "broadcast"),
    ],
)
def test_arrays_that_are_none(call, words):
    with pytest.raises(bi.InputError, match=words):
        call()


def test_a_table_does_not_control_the_terminal(bayesindent, batch, tmp_path):
    head = "phi1_deg,Phi_deg,phi2_deg"
    (tmp_path / "a.csv").write_text(
        f"{head},Er,sd,\x1b]0;a\x07\u009bm\n1,2,3,180,2,a\n4,50,6,181,2,b\n"
    )
    (tmp_path / "b.csv").write_text(f"{head},C11,C12,C44\n1,2,3,168,121,\x1b\u009bm\n")
    (tmp_path / "b.nml").write_text("&problem symmetry = 'cubic' /\n&crystals points = 'b.csv' /\n")
    runs = [bayesindent("table", "a.csv"), bayesindent("theory", "b.nml"), batch("b.nml")]
    for run, shown in zip(runs, ("?]0;a??m", "'???m' is not", "'???m' is not")):
        assert shown in run.stdout + run.stderr
        assert not {*"\x1b\x07\x9b"} & {*(run.stdout + run.stderr)}
