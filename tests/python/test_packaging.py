"""What describes the package elsewhere agrees with the package."""

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bayesindent.version import __version__

import bayesindent
from bayesindent import core
from support.tree import BUILD, SOURCE

tomllib = pytest.importorskip("tomllib")
yaml = pytest.importorskip("yaml")


def test_the_version_is_that_of_meson():
    stated = re.search(r"version: '([\d.]+)'", (SOURCE / "meson.build").read_text())[1]
    assert __version__ == stated
    assert f"## {stated}\n" in (SOURCE / "CHANGELOG.md").read_text()


def test_the_metadata_for_software_indexes_agree():
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text())["project"]
    stated = json.loads((SOURCE / "codemeta.json").read_text())
    assert (stated["name"], stated["description"], stated["keywords"]) == (
        project["name"],
        project["description"],
        project["keywords"],
    )
    assert (
        stated["license"].endswith(f"/{project['license']}")
        and project["urls"]["Method"] == stated["referencePublication"][0]["@id"]
    )


def test_conda_asks_for_what_pip_asks_for():
    project = tomllib.loads((SOURCE / "pyproject.toml").read_text())
    text = (SOURCE / "conda" / "meta.yaml").read_text()
    # Without what conda alone understands.
    recipe = yaml.safe_load(
        re.sub(r"\{\{ *(.*?) *\}\}", r"\1", re.sub(r"\{%.*?%\}", "", text))
        .replace("compiler('", "")
        .replace("')", "")
    )
    asked = {
        line.replace(" ", "").replace("matplotlib-base", "matplotlib")
        for line in recipe["requirements"]["run"]
    }
    assert asked == {
        *project["project"]["dependencies"],
        "python" + project["project"]["requires-python"],
    }
    assert {line.replace(" ", "") for line in recipe["requirements"]["host"]} >= set(
        project["build-system"]["requires"]
    ) - {"ninja>=1.10"}


def test_hosted_tests_run_what_is_there():
    jobs = yaml.safe_load((SOURCE / ".github" / "workflows" / "ci.yml").read_text())["jobs"]
    assert {"test", "versions", "wheel", "bare", "docs", "others"} == set(jobs)
    matrix = jobs["test"]["strategy"]["matrix"]["python"]
    classifiers = tomllib.loads((SOURCE / "pyproject.toml").read_text())["project"]["classifiers"]
    assert [f"Programming Language :: Python :: {version}" for version in matrix] == [
        text for text in classifiers if ":: 3." in text
    ]


@pytest.mark.parametrize("workflow", ["ci", "docs", "release"])
def test_hosted_jobs_end_and_their_actions_are_pinned(workflow):
    text = (SOURCE / ".github" / "workflows" / f"{workflow}.yml").read_text()
    assert yaml.safe_load(text)["permissions"] == {"contents": "read"}
    for job in yaml.safe_load(text)["jobs"].values():
        assert "timeout-minutes" in job
        for step in job["steps"]:
            assert re.fullmatch(
                r"actions/[\w-]+@[0-9a-f]{40}", step.get("uses", "actions/a@" + 40 * "0")
            )
            for tool in re.findall(r"\./bayesindent (?!run)(?:dev )?(\w+)", step.get("run", "")):
                assert (SOURCE / "tests" / "tools" / f"{tool}.py").exists()


def test_types_are_for_others_too():
    assert (Path(bayesindent.__file__).parent / "py.typed").exists()
    assert importlib.util.find_spec("bayesindent")


@pytest.mark.skipif(not BUILD, reason="the package is installed already, and was not built here")
def test_the_installed_batch_program_finds_the_shipped_surrogates(tmp_path):
    """Whichever Python it was built for: Debian's says lib/python3/dist-packages when it builds,
    and pip installs into other folders.
    """
    meson = Path(sys.executable).with_name("meson")
    subprocess.run(
        [meson, "install", "-C", BUILD, "--no-rebuild", "--quiet", "--destdir", tmp_path],
        check=True,
        capture_output=True,
    )
    (packages,) = {path.parents[2] for path in tmp_path.rglob("bayesindent/data/block.txt")}
    folder = (
        packages.parents[1]
        / "python3.12"
        / ("dist-packages" if packages.name == "site-packages" else "site-packages")
    )
    folder.parent.mkdir(exist_ok=True)
    packages.rename(folder)
    (program,) = tmp_path.rglob("bin/bayesindent-batch")
    (tmp_path / "a.nml").write_text(
        "&problem symmetry = 'cubic' /\n"
        "&surrogate file = 'block' /\n"
        f"&measurements file = '{SOURCE}/inputs/data/fe3si.csv' /\n"
    )
    done = subprocess.run(
        [program, "a.nml", "--check"], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr


@pytest.mark.skipif(
    shutil.which("nm") is None, reason="nm, which reads the symbols, comes with the compiler"
)
def test_other_libraries_see_none_of_our_symbols():
    file = core.native.__file__
    shown = subprocess.run(
        ["nm", "--dynamic", "--defined-only", file], capture_output=True, text=True, check=True
    ).stdout
    assert [line.split()[-1] for line in shown.splitlines()] == ["PyInit__core"]


def test_a_version_of_the_changelog_fits_a_screen():
    text = (SOURCE / "CHANGELOG.md").read_text(encoding="utf-8")
    for section in text.split("\n## ")[1:]:
        lines = section.strip().splitlines()
        assert len(lines) <= 55, f"{lines[0]}: {len(lines)} lines; merge some"
        assert max(map(len, lines)) <= 100
