"""The launcher where something is missing: it says what a person must run, and stops."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from support.tree import SOURCE

TOOLS = (
    "bash",
    "cat",
    "date",
    "dirname",
    "env",
    "find",
    "flock",
    "grep",
    "mkdir",
    "mv",
    "readlink",
    "rm",
    "tr",
    "sed",
    "sh",
    "tail",
    "touch",
)


@pytest.fixture
def bare_machine(tmp_path):
    """Run a copy of the launcher on a machine with the programs of TOOLS alone, and those written
    here.
    """
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in TOOLS:
        (folder / tool).symlink_to(shutil.which(tool))
    shutil.copy(SOURCE / "bayesindent", tmp_path)
    shutil.copy(SOURCE / "pyproject.toml", tmp_path)

    def run(
        environment: dict | None = None, arguments: tuple = ("theory",), **programs: str
    ) -> subprocess.CompletedProcess:
        for name, script in programs.items():
            file = folder / name.replace("_", "-")
            file.write_text(f"#!{folder}/sh\n{script}\n")
            file.chmod(0o755)
        launcher = [str(folder / "bash"), str(tmp_path / "bayesindent"), *arguments]
        return subprocess.run(
            launcher,
            env={"PATH": str(folder)} | (environment or {}),
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )

    return run


def test_prints_the_command_where_apt_get_may_not_be_used(bare_machine):
    done = bare_machine(id="echo 1000", apt_get="exit 1", sudo="exit 1")
    assert done.returncode == 1
    assert done.stdout == ""
    assert (
        "\n  sudo sh -c 'apt-get update && apt-get install --yes --no-install-recommends "
        "gfortran g++ " in done.stderr
    )


def test_names_the_packages_where_there_is_no_apt_get(bare_machine):
    done = bare_machine(id="echo 0")
    assert done.returncode == 1
    assert "gfortran" in done.stderr
    assert "there is no apt-get here" in done.stderr


def test_shows_the_log_of_a_failed_step(bare_machine):
    done = bare_machine(id="echo 0", apt_get="echo E: no network; exit 100")
    assert done.returncode == 1
    assert "E: no network" in done.stderr
    assert "failed: installing Debian packages: gfortran" in done.stderr
    # What will be installed is said before.
    said = done.stderr.splitlines()
    assert said[0] == "bayesindent: set-up of the core and of what theory needs [xlsx]"
    assert said[1].startswith(
        "bayesindent: these Debian packages will be installed as root: gfortran g++ "
    )


def test_installs_no_package_where_the_user_forbids_it(bare_machine):
    done = bare_machine({"BAYESINDENT_APT": "no"}, id="echo 0", apt_get="echo apt-get ran >&2")
    assert done.returncode == 1
    assert "apt-get ran" not in done.stderr
    assert (
        "BAYESINDENT_APT=no" in done.stderr
        and "\n  apt-get update && apt-get install --yes " in done.stderr
    )


def test_is_a_program():
    assert os.access(Path(SOURCE) / "bayesindent", os.X_OK)


@pytest.fixture
def environment(tmp_path):
    """An environment that is not current, whose program prints its arguments."""
    folder = tmp_path / ".venv"
    (folder / "bin").mkdir(parents=True)
    program = folder / "bin" / "bayesindent"
    program.write_text(f"#!{shutil.which('sh')}\necho program $*\n")
    program.chmod(0o755)
    return folder


@pytest.mark.parametrize("apt_get", ["exit 100", "kill -9 $PPID"])
def test_an_environment_stays_if_no_other_can_be_made(bare_machine, environment, apt_get):
    assert bare_machine({"PYTHONHOME": "/none"}, id="echo 0", apt_get=apt_get).returncode
    assert bare_machine(id="echo 0", apt_get="exit 100").returncode == 1
    assert (environment / "bin" / "bayesindent").exists()
    assert not environment.with_name(".venv.old").exists()


@pytest.mark.parametrize("words", [(), ("--help",), ("dev", "bench", "--help"), ("--version",)])
def test_help_changes_no_installation(bare_machine, environment, words):
    done = bare_machine(arguments=words, id="echo 0", apt_get="exit 100")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{' '.join(['program', *words])}\n"


@pytest.mark.parametrize("words", [("--with", "cake"), ("--without", "dask"), ("--with",)])
def test_a_wrong_extra_is_refused_before_anything_is_done(bare_machine, environment, words):
    done = bare_machine(arguments=("setup", *words), id="echo 0", apt_get="exit 100")
    assert done.returncode == 2
    assert "bench curves dask dev docs ebsd test wheel xlsx" in done.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder to another user")
def test_an_environment_of_another_user_is_left_alone(bare_machine, environment):
    os.chown(environment, 65534, 65534)
    done = bare_machine(id="echo 0", apt_get="exit 100")
    assert done.returncode == 1
    assert "belongs to another user" in done.stderr
    assert (environment / "bin" / "bayesindent").exists()
