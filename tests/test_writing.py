"""Texts of the package avoid metaphors."""

import io
import re
import tokenize
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from maniport.cli import app

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "src" / "maniport").rglob("*.py"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEMPLATES = sorted((ROOT / "src" / "maniport").rglob("*.html"))
COMMANDS = sorted(typer.main.get_command(app).commands)
BANNED = re.compile(
    r"\b(house|room|wing|doors?|judge[sd]?|mend(?:s|ed)?|giv(?:es|ing) way|plays|wish(?:es)?)\b",
    re.IGNORECASE,
)


def prose(file):
    """Yield number and text of each line of comments and strings, without values in f-strings."""
    with tokenize.open(file) as stream:
        for token in tokenize.generate_tokens(io.StringIO(stream.read()).readline):
            text = token.string if token.type == tokenize.COMMENT else ""
            if token.type == tokenize.STRING or tokenize.tok_name[token.type] == "FSTRING_MIDDLE":
                text = re.sub(r"\{[^{}\n]*\}", "{}", token.string)
            yield from enumerate(text.splitlines(), token.start[0])


def violations(name, lines):
    return [f"{name}:{number}: {word}" for number, line in lines for word in BANNED.findall(line)]


def test_source_has_no_banned_words():
    assert [
        text for file in SOURCES for text in violations(file.relative_to(ROOT), prose(file))
    ] == []


@pytest.mark.parametrize("page", [*PAGES, *TEMPLATES], ids=lambda page: str(page.relative_to(ROOT)))
def test_pages_have_no_banned_words(page):
    lines = enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
    assert violations(page.relative_to(ROOT), lines) == []


@pytest.mark.parametrize("command", COMMANDS)
def test_help_pages_have_no_banned_words(command):
    result = CliRunner().invoke(app, [command, "--help-all"])
    assert result.exit_code == 0
    assert (
        violations(f"maniport {command} --help-all", enumerate(result.output.splitlines(), 1)) == []
    )
