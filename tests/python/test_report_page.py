"""The report as a browser shows it, at the width of a desk and of a phone: no figure empty, nothing
too wide, no text too small.

Headless Chromium lays the page out in frames of these widths (its own windows are never narrower
than 500 px), and a script beside them measures.
"""

import base64
import html
import io
import json
import os
import re
import shutil
import subprocess

import pytest
from markupsafe import escape
from matplotlib.text import Text

from bayesindent.program.cli import main
from bayesindent.report import drawing
from support.programs import HANGS_S
from support.tree import SOURCE

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        CHROMIUM is None,
        reason="Chromium is not installed (Debian package chromium): nobody looked at the report",
    ),
]

WIDTHS = (1280, 390)
#: Size of text, px, below which it cannot be read; share of the dots of a figure that are not
#: white.
SMALLEST_PX, LEAST_INK = 9.0, 0.005

MEASURE = """
function measure(frame) {
  const page = frame.contentDocument, view = frame.contentWindow;
  const root = page.documentElement, found = [];
  for (const part of page.querySelectorAll("details")) part.open = true;
  if (root.scrollWidth > root.clientWidth) found.push(`the page is ${root.scrollWidth} px wide`);
  for (const element of page.body.querySelectorAll("*")) {
    const text = [...element.childNodes].some(node => node.nodeType === 3 && node.data.trim());
    const size = parseFloat(view.getComputedStyle(element).fontSize);
    if (text && element.checkVisibility() && size < SMALLEST)
      found.push(`text of ${size} px: ${element.textContent.slice(0, 30)}`);
  }
  const images = [...page.images];
  for (const image of images) {
    const size = image.dataset.text * image.clientWidth / image.dataset.points;
    const canvas = document.createElement("canvas");
    if (!(size >= SMALLEST)) found.push(`text of ${size} px in a figure: ${image.alt}`);
    canvas.width = 400; canvas.height = 300;
    const context = canvas.getContext("2d");
    context.fillStyle = "white"; context.fillRect(0, 0, 400, 300);
    if (image.naturalWidth) context.drawImage(image, 0, 0, 400, 300);
    const dots = context.getImageData(0, 0, 400, 300).data;
    let ink = 0;
    for (let i = 0; i < dots.length; i += 4)
      ink += Math.min(dots[i], dots[i + 1], dots[i + 2]) < 250;
    if (ink < INK * dots.length / 4) found.push(`an empty figure: ${image.alt}`);
  }
  return { width: view.innerWidth, figures: images.length, height: root.scrollHeight, found };
}
window.onload = () => {
  const told = document.createElement("pre");
  told.id = "told";
  told.textContent = JSON.stringify([...document.querySelectorAll("iframe")].map(measure));
  document.querySelectorAll("iframe").forEach(frame => frame.remove());
  document.body.append(told);
};
"""


def shown_by_chromium(page: str, folder, timeout: float) -> str:
    """The document of a page after its scripts, '' where the browser does not work."""
    (folder / "shown.html").write_text(page)
    options = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-dev-shm-usage",
    ]
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"} | {
        "HOME": str(folder)
    }
    command = [
        str(CHROMIUM),
        *options,
        f"--user-data-dir={folder / 'browser'}",
        "--dump-dom",
        (folder / "shown.html").as_uri(),
    ]
    try:
        return subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=timeout,
            env=environment,
            stdin=subprocess.DEVNULL,
        ).stdout
    except (OSError, subprocess.TimeoutExpired):
        return ""


@pytest.fixture(scope="module", autouse=True)
def working_browser(tmp_path_factory):
    """A container may have Chromium and not let it start."""
    if "works" not in shown_by_chromium(
        "<!doctype html><p>works</p>", tmp_path_factory.mktemp("browser"), HANGS_S
    ):
        pytest.skip("Chromium does not start here: nobody looked at the report")


@pytest.fixture(autouse=True)
def sizes(monkeypatch):
    """By the alternative text of each figure of a report its width and smallest text, in points."""
    found, own = {}, drawing.embedded

    def embedded(picture):
        texts = [
            text.get_fontsize()
            for text in picture.figure.findobj(Text)
            if text.get_visible() and text.get_text().strip()
        ]
        found[str(escape(picture.alt))] = 72 * picture.figure.get_figwidth(), min(texts)
        return own(picture)

    monkeypatch.setattr(drawing, "embedded", embedded)
    return found


def look_at(page: str, folder) -> list[dict]:
    """What was measured at each width."""
    script = MEASURE.replace("SMALLEST", str(SMALLEST_PX)).replace("INK", str(LEAST_INK))
    frames = "".join(
        f'<iframe style="width: {width}px; height: 900px; border: 0" '
        f'srcdoc="{html.escape(page)}"></iframe>'
        for width in WIDTHS
    )
    shown = shown_by_chromium(
        f"<!doctype html><meta charset='utf-8'><body><script>{script}</script>{frames}</body>",
        folder,
        HANGS_S,
    )
    told = re.search(r'<pre id="told">(.*?)</pre>', shown, re.DOTALL)
    assert told, shown[:500]
    return json.loads(html.unescape(told[1]))


def check(folder, tmp_path, sizes) -> None:
    page = (folder / "report.html").read_text()
    for alt, (points, text) in sizes.items():
        own = f'alt="{alt}"'
        assert own in page
        page = page.replace(own, f'{own} data-points="{points}" data-text="{text}"')
    measured = look_at(page, tmp_path)
    assert [frame["width"] for frame in measured] == list(WIDTHS)
    for frame in measured:
        assert frame["found"] == [], frame["width"]
        assert frame["figures"] == page.count("<img ") > 0
    # The narrow one is the longer one, unless nothing is laid out.
    assert measured[1]["height"] > measured[0]["height"] > 2000


def test_both_steps(tmp_path, capsys, sizes):
    """By theory in place of simulations, which takes no time."""
    file = tmp_path / "steps.nml"
    file.write_text(
        "&problem symmetry = 'cubic', title = 'Both steps of a cubic crystal', "
        "synthetic = .true. /\n"
        "&simulation simulator = 'theory' /\n"
        "&domain c_min = 100, 60, 40, c_max = 250, 150, 120, anisotropy_cap = 4 /\n"
        "&surrogate file = 'mine.txt', model = 'paper', degree = 2, bandlimit = 4, scan = '1, "
        "2 x 4' /\n"
        "&design n_candidates = 200, budget = 60, validation = 20 /\n"
        f"&measurements file = '{SOURCE}/inputs/data/copper_film.csv', "
        "modulus_kind = 'indentation_modulus' /\n"
        "&prior c_min = 100, 60, 40, c_max = 250, 150, 120, anisotropy_cap = 4 /\n"
        "&sampler chains = 2, samples = 3000, burn_in = 1000 /\n"
        "&next count = 3 /\n"
    )
    assert main(["run", str(file), "--output", str(tmp_path / "out")]) == 0
    check(tmp_path / "out", tmp_path, sizes)


def test_simulations(tmp_path, capsys, sizes):
    zinc = "161.1,34.2,38.3,61.1,50.3"
    (tmp_path / "zinc.csv").write_text(
        f"C11,C12,C44,C33,C13,phi1_deg,Phi_deg,phi2_deg\n{zinc},0,0,0\n{zinc},0,90,0\n"
    )
    file = tmp_path / "fe.nml"
    file.write_text(
        "&problem symmetry = 'hexagonal' /\n"
        "&crystals points = 'zinc.csv' /\n"
        "&simulation refine = 0.6 /\n"
    )
    assert main(["run", str(file), "--output", str(tmp_path / "out")]) == 0
    check(tmp_path / "out", tmp_path, sizes)


def test_what_is_wrong_is_found(tmp_path):
    from matplotlib.figure import Figure

    content = io.BytesIO()
    Figure().savefig(content, format="png")
    white = base64.b64encode(content.getvalue()).decode()
    page = (
        "<!doctype html><body style='margin: 0'><p style='font-size: 8px'>small</p><div "
        "style='width: 700px'>wide</div>"
        f"<img alt='white' src='data:image/png;base64,{white}' width='300' data-points='504' "
        "data-text='9'></body>"
    )
    broad, narrow = (frame["found"] for frame in look_at(page, tmp_path))
    wrong = [
        "text of 8 px: small",
        f"text of {9 * 300 / 504} px in a figure: white",
        "an empty figure: white",
    ]
    assert broad == wrong
    assert narrow == ["the page is 700 px wide", *wrong]
