"""Progress goes to standard error, and only where it is wanted."""

from bayesindent.common.progress import Progress


def test_silent_by_default(capsys):
    with Progress().bar("simulations", 3) as advance:
        advance(1)
        advance()
    assert capsys.readouterr() == ("", "")


def test_lines_where_there_is_no_terminal(capsys):
    with Progress(True).bar("simulations", 3) as advance:
        for _ in range(3):
            advance(1)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[-1].startswith("simulations: 3/3 in ")
