"""How pages and messages are written: the length of the front page, of its sentences, and phrases for which the field has a term."""

import re
from pathlib import Path
from statistics import median

import lines

#: Words of README.md, and of its sentences the most and the most in the middle.
README_WORDS, LONGEST, MIDDLE = (500, 700), 30, 15

#: Phrases, and what to write in their place.
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
    r"\b(prior|priors|surrogate|surrogates|data) (knows?|believes?|speaks? for|asks?|tells?)\b": "the user or the program acts",
}


def complaints(root: Path) -> list[str]:
    """What is wrong with the prose of a source tree."""
    readme = (root / "README.md").read_text(encoding="utf-8")
    found = [f"README.md: {words}" for words in of_readme(readme)]
    pages = [root / "README.md", root / "docs" / "start.md", *sorted((root / "docs" / "tutorials").glob("*.md"))]
    texts = [(page, page.read_text(encoding="utf-8")) for page in pages]
    # Texts in quotes: messages and help.
    texts += [(path, "\n".join(re.findall(r"'[^'\n]*'|\"[^\"\n]*\"", path.read_text(encoding="utf-8")))) for path in lines.files(root)]
    for path, text in texts:
        found += [f"{path.relative_to(root)}: '{phrase}': write '{term}'" for phrase, term in of_phrases(text)]
    return found


def of_readme(text: str) -> list[str]:
    """Whether the front page is as long as it may be, and its sentences."""
    count, low, high = len(text.split()), *README_WORDS
    found = [] if low <= count <= high else [f"{count} words; allowed {low} to {high}"]
    lengths = [(len(sentence.split()), sentence) for sentence in sentences(text)]
    if (middle := median(n for n, _ in lengths)) > MIDDLE:
        found.append(f"the median sentence has {middle:g} words; allowed {MIDDLE}")
    return found + [f"a sentence of {n} words; allowed {LONGEST}: {sentence}" for n, sentence in lengths if n > LONGEST]


def sentences(text: str) -> list[str]:
    """The sentences of a page, without code, tables, headings and pictures."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    paragraphs = [part for part in text.split("\n\n") if part.strip() and not part.lstrip().startswith(("#", "|", "!"))]
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(part.split())).replace("**", "") for part in paragraphs]
    return [sentence for part in plain for sentence in re.split(r"(?<=[.:?!])\s+(?=[A-Z`*])", part) if " " in sentence]


def of_phrases(text: str) -> list[tuple[str, str]]:
    """Phrases of a text that have a better one, and that."""
    text = " ".join(text.split())
    return [(found[0], term) for pattern, term in PHRASES.items() for found in re.finditer(pattern, text, flags=re.IGNORECASE)]
