"""The page's files, without a browser: complete, unchanged where vendored, and asking no other host."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest

import lobefit

WEB = (Path(lobefit.__file__).parent / "service" / "web").resolve()
OURS = sorted(p for p in WEB.rglob("*") if p.is_file() and "vendor" not in p.relative_to(WEB).parts)
SCRIPTS = [p for p in OURS if p.suffix == ".js"]
# A name of a format, which no browser fetches.
NAMESPACE = "http://www.w3.org/2000/svg"

IMPORT = re.compile(
    r'^import\s+(?:(\{[^}]*\})|\*\s+as\s+\w+)\s+from\s+"\./([\w/.]+)";', re.MULTILINE
)


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def references(path: Path) -> set[Path]:
    if path.suffix == ".html":
        return {WEB / found for found in re.findall(r'(?:src|href)="static/([^"]+)"', text(path))}
    if path.suffix == ".css":
        return {path.parent / found for found in re.findall(r"url\([\"']?([^\"')]+)", text(path))}
    return {path.parent / found for _, found in IMPORT.findall(text(path))}


def test_files_are_there_and_all_are_used() -> None:
    wanted = {found for path in OURS for found in references(path)}
    assert [p for p in sorted(wanted) if not p.is_file()] == []
    assert sorted({*OURS} - wanted) == [WEB / "index.html"]


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.name)
def test_what_is_imported_is_exported(path: Path) -> None:
    for names, module in IMPORT.findall(text(path)):
        offered = re.findall(
            r"^export (?:async )?(?:function|class|const|let) (\w+)",
            text(path.parent / module),
            re.MULTILINE,
        )
        for name in re.findall(r"\w+", names):
            assert name in offered, f"{module} does not export {name}"


@pytest.mark.parametrize("path", OURS, ids=lambda p: p.name)
def test_nothing_comes_from_another_host(path: Path) -> None:
    found = re.findall(r"(?:https?:)?//[\w.-]+\.\w+[^\s\"'`)]*", text(path))
    assert [address for address in found if address != NAMESPACE] == []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda p: p.name)
def test_data_cannot_become_markup_or_code(path: Path) -> None:
    ways = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|srcdoc|DOMParser"
    assert re.findall(ways, text(path)) == []


def test_the_markup_holds_no_script_and_no_style() -> None:
    page = text(WEB / "index.html")
    assert re.findall(r"<script(?![^>]*\bsrc=)", page) == []
    assert re.findall(r"<style|\sstyle=|\son\w+=", page) == []


def test_vendored_files_are_those_of_the_list() -> None:
    vendor = WEB / "vendor"
    rows = re.findall(
        r"^\| (\S+) \|.*\| ([0-9a-f]{64}) \|$", text(vendor / "README.md"), re.MULTILINE
    )
    there = {p.relative_to(vendor).as_posix(): p for p in vendor.rglob("*") if p.is_file()}
    there.pop("README.md")
    assert {name for name, _ in rows} == set(there)
    for name, digest in rows:
        assert hashlib.sha256(there[name].read_bytes()).hexdigest() == digest
        assert (there[name].parent / "LICENSE").is_file()
