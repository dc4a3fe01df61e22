"""Files of results are whole or not there."""

import numpy as np
import pytest

from bayesindent.common.result_files import (
    as_csv,
    plain,
    read_json,
    whole_file,
    write_csv,
    write_json,
)


def test_a_file_that_was_not_finished_leaves_what_was_there(tmp_path):
    file = tmp_path / "new" / "a.json"
    write_json(file, {"a": 1})
    with pytest.raises(KeyboardInterrupt), whole_file(file) as beside:
        beside.write_text('{"a": ')
        raise KeyboardInterrupt
    assert read_json(file) == {"a": 1}
    assert list(file.parent.iterdir()) == [file]


def test_a_document_that_json_cannot_hold_is_not_written(tmp_path):
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"a": object()})
    assert list(tmp_path.iterdir()) == []


def test_numbers(tmp_path):
    assert plain({"a": (np.float64(1.5), np.nan), "b": np.arange(2), "c": tmp_path}) == {
        "a": [1.5, None],
        "b": [0, 1],
        "c": str(tmp_path),
    }
    assert as_csv(["a", "b"], [[0.1 + 0.2, np.float64(1 / 3)]]) == f"a,b\n{0.1 + 0.2!r},{1 / 3!r}\n"
    write_csv(tmp_path / "a.csv", ["a"], [["1"]], comment="why")
    assert (tmp_path / "a.csv").read_text() == "# why\na\n1\n"
