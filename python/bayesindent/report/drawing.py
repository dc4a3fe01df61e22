"""Figures as files of images, on two cores where there are two."""

import base64
import io
import os
import signal
import threading
from collections.abc import Callable, Sequence
from multiprocessing import Pipe

from ..common.result_files import whole_file, write_csv
from .figure_data import figure_table
from .figures import FIGURES
from .figures.style import Picture, house_style, stamp_synthetic, text_size
from .results import Results

__all__ = ["draw_figures"]


#: Kinds of files of figures that papers take, and dots per inch of what is no line.
FOR_PAPERS = {"svg": 300, "pdf": 300, "png": 600}

#: Dots per inch of other files.
SCREEN = 160

#: The same results make the same files.
UNDATED = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}


def draw_figures(results: Results, kind_of_files: str, paper: bool = False) -> dict[str, list[dict]]:
    """Of each section the figures that the results can make: PNG in base 64 and their words.

    As files too, of one kind in the folder `figures`, and for a paper in `paper/figures` with the numbers behind each as CSV.
    """
    files = [(results.folder / "figures", kind_of_files, SCREEN)] if kind_of_files else []
    files += [(results.folder / "paper" / "figures", kind, dots) for kind, dots in FOR_PAPERS.items() if paper]
    with house_style():
        made = [(section, function.__name__, function(results)) for section, function in FIGURES]
        pictures = [(name, picture) for _, name, picture in made if picture is not None]

        def draw(item: tuple[str, Picture]) -> dict:
            name, picture = item
            if results.synthetic:
                stamp_synthetic(picture.figure)
            for folder, kind, dots in files:
                with whole_file(folder / f"{name}.{kind}") as file:
                    picture.figure.savefig(file, dpi=dots, metadata=UNDATED.get(kind))
            if paper:
                write_csv(results.folder / "paper" / "figures" / f"{name}.csv", *figure_table(picture), picture.caption)
            buffer = io.BytesIO()
            picture.figure.savefig(buffer, format="png", pil_kwargs={"compress_level": 3})
            width, height = (72 * inches for inches in picture.figure.get_size_inches())
            return {
                "name": name, "data": base64.b64encode(buffer.getvalue()).decode(), "alt": picture.alt, "caption": picture.caption,
                "width": width, "height": height, "text": text_size(picture.figure),
            }  # fmt: skip

        drawn = {figure["name"]: figure for figure in halved(draw, pictures)}
    for folder, kind, _ in [*files, *([(results.folder / "paper" / "figures", "csv", 0)] if paper else [])]:
        for _, name, picture in made:
            if picture is None:
                # Of other inputs.
                (folder / f"{name}.{kind}").unlink(missing_ok=True)
    return {section: [drawn[name] for other, name, _ in made if other == section and name in drawn] for section, _ in FIGURES}


def halved(function: Callable, items: Sequence) -> list:
    """function(item) of all items, every second one in a forked process where there is a second core.

    The function must not call the core: a forked process has none of the threads of OpenMP that its parent may have started.
    """
    if len(items) < 2 or len(os.sched_getaffinity(0)) < 2 or threading.active_count() > 1:
        return [function(item) for item in items]
    receive, send = Pipe(duplex=False)
    child = os.fork()
    if child == 0:
        try:
            receive.close()
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                if signal.getsignal(number) != signal.SIG_IGN:
                    signal.signal(number, signal.SIG_DFL)
            send.send([function(item) for item in items[1::2]])
        except BaseException:
            # The parent draws what is missing, and says what is wrong.
            os._exit(1)
        os._exit(0)
    send.close()
    try:
        own = [function(item) for item in items[0::2]]
        try:
            others = receive.recv()
        except EOFError:
            others = [function(item) for item in items[1::2]]
    finally:
        receive.close()
        os.waitpid(child, 0)
    results = [None] * len(items)
    results[0::2], results[1::2] = own, others
    return results
