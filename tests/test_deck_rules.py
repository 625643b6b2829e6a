"""The tables of keywords of input decks: their page says what they say, and every keyword has one verdict."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from warp_mca.geometry.deck_rules import ABAQUS_RULES, ELEMENTS, KEYWORD_RULES, NASTRAN_RULES, OTHER, Rules

PAGE = (Path(__file__).parent.parent / "docs" / "api" / "geometry.md").read_text(encoding="utf-8")
FORMATS = {"Abaqus and CalculiX": ABAQUS_RULES, "Nastran": NASTRAN_RULES, "LS-DYNA": KEYWORD_RULES}
STRUCTURE = re.compile(r"END.*|BEGIN.*|KEYWORD.*|STEP|PART_.*|SET_NODE|CORD\*|CPYRA")  # read, and not worth a word


def part(title: str, kind: str) -> str:
    """What the page lists for a format under Read, Refused or Left out, without blanks, in capitals."""
    section = PAGE.split(f"\n**{title}**\n")[1].split("\n**")[0]
    text = section.split(f"- {kind}: ")[1].split("\n- ")[0]
    return re.sub(r"[\s*]", "", text).upper()


@pytest.mark.parametrize("title", FORMATS)
def test_the_page_lists_what_the_tables_have(title: str):
    rules: Rules = FORMATS[title]
    read, refused, left = (part(title, kind) for kind in ("Read", "Refused", "Left out"))
    for keyword in rules.read:
        if not STRUCTURE.fullmatch(keyword):
            stem = keyword.removesuffix("_GENERATE")
            assert stem in read or stem in refused, keyword  # *SYSTEM is read where it moves nothing
    for keyword in rules.refused:
        assert keyword.strip("*").rpartition("*")[2].strip("_") in refused, keyword
    for kind in rules.left_out:
        assert re.sub(r"\s", "", kind).upper() in left, kind


@pytest.mark.parametrize("title", FORMATS)
def test_each_keyword_has_one_verdict(title: str):
    rules = FORMATS[title]
    for keyword in rules.refused:
        with pytest.raises(ValueError, match="is not read: it"):
            rules.kind(keyword.replace("*", "X"))
    assert {rules.kind(keyword.replace("*", "X")) for keyword in rules.read} == {"read"}
    assert {rules.kind(keyword.replace("*", "X")) for keyword in rules.silent} == {""}
    for kind, keywords in rules.left_out.items():
        assert {rules.kind(keyword.replace("*", "X")) for keyword in keywords} == {kind}
    assert rules.kind("FROBNICATE") == OTHER
    assert title == "Abaqus and CalculiX" or ELEMENTS in rules.left_out
