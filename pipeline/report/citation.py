"""References as a reader wants them: a line to read, an entry of BibTeX to paste."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.report.words import clean
from pipeline.rigs.experiment import Reference

_ESCAPED = {"&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "$": r"\$"}


def citation(reference: Reference) -> str:
    """Return one line: authors, title, journal, volume, pages, year."""
    place = " ".join(filter(None, (reference.journal, reference.volume)))
    where = ", ".join(filter(None, (place, reference.pages)))
    authors = [name.strip() for name in reference.authors.split(" and ")]
    names = ", ".join(authors[:-1]) + f" and {authors[-1]}" if len(authors) > 1 else authors[0]
    doi = f" doi:{reference.doi}." if reference.doi else ""
    note = f" {reference.note[:1].upper()}{reference.note[1:].rstrip('.')}." if reference.note else ""
    return clean(f"{names}: {reference.title.rstrip('.')}. {where} ({reference.year}).{doi}{note}")


def bibtex(references: Sequence[Reference]) -> str:
    """Return the references as BibTeX."""
    return "\n\n".join(_entry(reference) for reference in references)


def _entry(reference: Reference) -> str:
    fields = {
        "author": reference.authors,
        "title": f"{{{reference.title}}}",
        "journal": reference.journal,
        "year": str(reference.year),
        "volume": reference.volume,
        "pages": reference.pages.replace("-", "--").replace("–", "--").replace("----", "--"),
        "doi": reference.doi,
        "note": reference.note,
    }
    lines = [f"  {name} = {{{text if name == 'doi' else _tex(text)}}}" for name, text in fields.items() if text]
    kind = "article" if reference.journal else "misc"
    return f"@{kind}{{{reference.key},\n" + ",\n".join(lines) + "\n}"


def _tex(text: str) -> str:
    return "".join(_ESCAPED.get(sign, sign) for sign in text)
