"""Rules of prose: the length of pages and of their sentences, and phrases for which the field has a
term.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from statistics import median

from tools import lines

#: Limits of README.md: its words, the words of its longest sentence, and of its median sentence.
README_WORDS, LONGEST, MIDDLE = (500, 700), 30, 15
#: Limits of the pages of users: words of all, words of one, words of the median sentence and of
#: the longest one.
PAGES_WORDS, PAGE_WORDS, PAGES_MIDDLE, PAGES_LONGEST = 20000, 2000, 17, 30

#: Phrases (patterns), and the terms to write instead.
PHRASES = {
    r"\b(is|are|was|were) told of\b": "is reported, warns",
    r"\b(has|have|had) a say\b": "the result depends on the prior",
    r"\bpiles? up at\b": "is truncated by",
    r"\bthe data (leave|left|decide|decided)\b": "determined by the measurements",
    r"\bdecided by the data\b": "determined by the measurements",
    r"\bgone on with\b": "resumed",
    r"\bworth \d+ (independent )?samples\b": "effective sample size",
    r"\bwhat (the|a|its) specimen adds\b": "the specimen correction",
    r"\b(sds|deviations) say\b": "the stated sds",
    r"\b(taught by|learn(t|s)? from|to learn from|learnt once from)\b": "is trained on",
    r"\bthere theory has no answer\b": "no analytical solution exists",
    r"\b(priors?|surrogates?|data) (knows?|believes?|asks?|tells?)\b": "the user or program acts",
    r"\b(priors?|surrogates?|data) speaks? for\b": "the user or program acts",
}


def complaints(root: Path) -> list[str]:
    """All faults in the prose of a source tree."""
    readme = (root / "README.md").read_text(encoding="utf-8")
    found = [f"README.md: {words}" for words in of_readme(readme)]
    found += of_pages(
        {
            str(page.relative_to(root)): page.read_text(encoding="utf-8")
            for page in pages_of_users(root)
        }
    )
    pages = [
        root / "README.md",
        root / "docs" / "start.md",
        *sorted((root / "docs" / "tutorials").glob("*.md")),
    ]
    texts = [(page, page.read_text(encoding="utf-8")) for page in pages]
    # Texts in quotes: messages and help.
    texts += [
        (path, "\n".join(re.findall(r"'[^'\n]*'|\"[^\"\n]*\"", path.read_text(encoding="utf-8"))))
        for path in lines.files(root)
    ]
    for path, text in texts:
        found += [
            f"{path.relative_to(root)}: '{phrase}': write '{term}'"
            for phrase, term in of_phrases(text)
        ]
    return found


def of_readme(text: str) -> list[str]:
    """Faults in the length of the front page and of its sentences."""
    count, low, high = len(text.split()), *README_WORDS
    found = [] if low <= count <= high else [f"{count} words; allowed {low} to {high}"]
    lengths = [(len(sentence.split()), sentence) for sentence in sentences(text)]
    if (middle := median(n for n, _ in lengths)) > MIDDLE:
        found.append(f"the median sentence has {middle:g} words; allowed {MIDDLE}")
    return found + [
        f"a sentence of {n} words; allowed {LONGEST}: {sentence}"
        for n, sentence in lengths
        if n > LONGEST
    ]


def pages_of_users(root: Path) -> list[Path]:
    """All pages except references and the tables of measurements."""
    left_out = {
        "verification",
        *("namelists.md", "diagnostics.md", "files.md"),
        *("python.md", "fortran.md", "glossary.md"),
    }
    docs = [
        page
        for page in sorted((root / "docs").rglob("*.md"))
        if not left_out & {*page.relative_to(root).parts}
    ]
    return [root / "README.md", root / "CONTRIBUTING.md", *docs]


def of_pages(texts: dict[str, str]) -> list[str]:
    """Faults in the length of these pages (text by name) together and of their sentences."""
    counts = {name: len(text.split()) for name, text in texts.items()}
    lengths = {}
    for name, text in texts.items():
        lengths[name] = sorted(len(sentence.split()) for sentence in sentences(text))
    every = sorted(n for found in lengths.values() for n in found)
    found = []
    if (total := sum(counts.values())) > PAGES_WORDS:
        found.append(
            f"pages of users: {total} words; allowed {PAGES_WORDS}; most in {worst(counts)}"
        )
    if (middle := median(every)) > PAGES_MIDDLE:
        medians = {name: median(of_page) for name, of_page in lengths.items() if of_page}
        found.append(
            f"pages of users: the median sentence has {middle:g} words; allowed {PAGES_MIDDLE}; "
            f"most in {worst(medians)}"
        )
    for name, count in counts.items():
        if count > PAGE_WORDS:
            found.append(f"{name}: {count} words; allowed {PAGE_WORDS}")
        long = sum(n > PAGES_LONGEST for n in lengths[name])
        if long:
            found.append(f"{name}: {long} sentences of more than {PAGES_LONGEST} words")
    return found


def worst(numbers: Mapping[str, float]) -> str:
    """The five pages with the largest numbers."""
    return ", ".join(
        f"{name} {numbers[name]:g}" for name in sorted(numbers, key=lambda name: -numbers[name])[:5]
    )


def sentences(text: str) -> list[str]:
    """The sentences of a page: no code, tables, headings, pictures, formulas, terms or marks of
    lists; code in a line is one word.
    """
    text = re.sub(r"^```.*?^```$|<!--.*?-->|\$\$.*?\$\$", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^[#|!].*$|^\S.*\n(?=: )", "", text, flags=re.MULTILINE)
    # Each item of a list stands by itself; what is indented below an empty line is code.
    text = re.sub(r"^ *(?:[-*:]|\d+\.) +(?=\S)", "\n\n", text, flags=re.MULTILINE)
    text = re.sub(r"(?<=\n\n)(?: {4}.*\n*)+", "", text)
    paragraphs = [
        " ".join(re.sub(r"`[^`]+`", "`x`", part).split()) for part in re.split(r"\n\s*\n", text)
    ]
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)|\*\*", r"\1", part) for part in paragraphs]
    return [
        sentence
        for part in plain
        for sentence in re.split(r"(?<=[.:?!])\s+(?=[A-Z`*])", part)
        if " " in sentence
    ]


def of_phrases(text: str) -> list[tuple[str, str]]:
    """Phrases of a text that have a better term, each with the term."""
    text = " ".join(text.split())
    return [
        (found[0], term)
        for pattern, term in PHRASES.items()
        for found in re.finditer(pattern, text, flags=re.IGNORECASE)
    ]
