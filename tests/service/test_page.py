"""The page in a browser, against the service: what a person sees, does and is told."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

SAMPLES = Path(__file__).parents[2] / "samples"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader")
START_SECONDS = 180
FIT_MS = 120_000
BAD = "# material: a leaf\ntheta_i,phi_i,theta_o,phi_o,R\n30,0,20,180,0.5\n30,0,ten,180,0.4\n"
TOKEN = "a-token-for-this-test"


def browser_path() -> str:
    named = os.environ.get("LOBEFIT_BROWSER")
    found = named or next(filter(None, map(shutil.which, BROWSERS)), None)
    if not found:
        pytest.skip("no Chromium is installed")
    return found


def serve(folder: Path, until: str, *arguments: str) -> tuple[subprocess.Popen[str], str]:
    """Start a service of one worker; gives the process and its address once `until` is well."""
    command = [sys.executable, "-c", "from lobefit.service.cli import main; main()", "serve"]
    command += ["--port", "0", "--workers", "1", "--data-dir", str(folder), *arguments]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    address = re.search(r"http://\S+", line)
    assert address, f"the service said {line!r}"
    end = time.monotonic() + START_SECONDS
    while time.monotonic() < end:
        try:
            with urllib.request.urlopen(f"{address[0]}/{until}", timeout=5):
                return process, address[0]
        except OSError:  # not listening yet, or 503
            time.sleep(0.1)
    process.terminate()
    raise AssertionError("the service does not get ready")


def stop(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.communicate(timeout=30)


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    browser_path()
    process, found = serve(tmp_path_factory.mktemp("data"), "readyz")
    yield found
    stop(process)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as p:
        started = p.chromium.launch(executable_path=browser_path(), args=list(FLAGS))
        yield started
        started.close()


@dataclass
class Visit:
    """A tab, and what went wrong in it."""

    page: Any
    hosts: set[str] = field(default_factory=set)
    errors: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(20_000)
        self.page.on("request", lambda r: self.hosts.add(urlsplit(r.url).netloc))
        self.page.on("console", self.heard)
        self.page.on("pageerror", lambda e: self.errors.append(str(e)))

    def heard(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def wide(self) -> int:
        """Pixels by which the page is wider than the window."""
        script = "document.documentElement.scrollWidth - window.innerWidth"
        return int(self.page.evaluate(script))

    def upload(self, name: str, content: bytes) -> None:
        self.page.set_input_files(
            "#file", files=[{"name": name, "mimeType": "text/csv", "buffer": content}]
        )


@pytest.fixture
def visit(browser: Any, address: str) -> Iterator[Visit]:
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    found = Visit(context.new_page())
    found.page.goto(address)
    yield found
    context.close()


@pytest.fixture(scope="module")
def fitted(browser: Any, address: str) -> Iterator[Visit]:
    """A visit that uploaded a sample and had three models fitted by filling in the form."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    visit = Visit(context.new_page())
    page = visit.page
    page.goto(address)
    visit.upload("copper.csv", (SAMPLES / "rough_copper.csv").read_bytes())
    page.get_by_text("465 directions at 6 incidences, 3 channels (R, G, B)").wait_for()
    page.locator(".u-over").wait_for()
    page.get_by_label("Choose").check()
    for name in ("lambert", "modified_phong"):
        page.locator(f"input[name=model][value={name}]").check()
    page.get_by_label("Variants and sums").fill("ggx:k_s=1")
    page.get_by_role("button", name="Fit", exact=True).click()
    # The verdict is shown before the pictures are made; the files come last.
    page.locator(".files").wait_for(timeout=FIT_MS)
    yield visit
    context.close()


def test_a_fit_shows_verdict_ranking_and_parameters(fitted: Visit) -> None:
    page = fitted.page
    assert "describes this surface to within its noise" in page.locator(".verdict").inner_text()
    rows = page.locator(".ranking tbody tr").all_inner_texts()
    assert [re.search(r"ggx:k_s=1|lambert|modified_phong", row)[0] for row in rows] == [  # type: ignore[index]
        "ggx:k_s=1",
        "modified_phong",
        "lambert",
    ]
    assert "recommended" in rows[0]
    assert "misfit-limited" in rows[2]
    parameters = page.get_by_role("region", name="ggx:k_s=1: parameters").first.inner_text()
    assert "roughness" in parameters
    assert re.search(r"0\.\d+ ± 0\.\d+", parameters)


def test_the_plots_are_drawn_and_follow_the_chosen_model(fitted: Visit) -> None:
    page = fitted.page
    page.get_by_role("heading", name="Residuals over the angles").scroll_into_view_if_needed()
    page.get_by_role("img", name="A sphere of ggx:k_s=1").wait_for()
    assert page.get_by_role("img", name="Polar lobes").is_visible()
    page.get_by_role("button", name="Show lambert as model B").click()
    page.get_by_role("img", name="Residual map of B lambert").wait_for()
    page.get_by_role("img", name="A sphere of lambert").wait_for()
    # Something is on the sphere's canvas, and it is not all of one colour.
    colours = page.evaluate(
        """() => { const c = document.querySelector(".spheres canvas");
        const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
        const seen = new Set(); for (let k = 0; k < d.length; k += 404) seen.add(d[k]); return seen.size; }"""
    )
    assert colours > 10


def test_plots_are_read_by_keys(fitted: Visit) -> None:
    page = fitted.page
    page.get_by_role("img", name="Measured and fitted BRDF").focus()
    page.keyboard.press("ArrowRight")
    page.get_by_text(re.compile(r"theta_o -?\d.*°: .* · A ")).first.wait_for()
    page.get_by_role("img", name="Residual map of A").focus()
    page.keyboard.press("ArrowRight")
    page.get_by_text(re.compile(r"theta_i .* the model")).wait_for()


def test_files_are_downloaded(fitted: Visit) -> None:
    with fitted.page.expect_download() as waiting:
        fitted.page.get_by_role("button", name="samples.csv").click()
    path = waiting.value.path()
    assert path.read_text(encoding="utf-8").count("\n") > 465


def test_a_past_fit_is_found_again(fitted: Visit, visit: Visit) -> None:
    del fitted  # which made it
    visit.page.get_by_role("link", name="Past fits").click()
    visit.page.get_by_role("link", name="copper.csv").first.click()
    visit.page.locator(".verdict").wait_for()
    assert visit.errors == []


def test_nothing_but_the_service_was_asked_and_nothing_failed(fitted: Visit, address: str) -> None:
    assert fitted.hosts <= {urlsplit(address).netloc, ""}  # "": the download's blob
    assert fitted.errors == []


def test_narrow_windows_need_no_sideways_scrolling(fitted: Visit, visit: Visit) -> None:
    for page in (fitted, visit):
        page.page.set_viewport_size({"width": 390, "height": 844})
        page.page.wait_for_timeout(300)
        assert page.wide() <= 0


def test_bad_input_is_shown_at_its_row_and_column(visit: Visit) -> None:
    visit.upload("leaf.csv", BAD.encode())
    alert = visit.page.get_by_role("alert")
    alert.locator("mark").wait_for()
    said = alert.inner_text()
    for words in ("leaf.csv", "Row\n4", "Column\ntheta_o", "Found\nten", "a number"):
        assert words in said
    assert alert.locator("mark").inner_text() == "ten"
    assert alert.locator("li.wrong").inner_text().startswith("4")


def test_markup_in_a_file_stays_text(visit: Visit) -> None:
    attack = "<img src=x onerror=document.title='owned'>"
    visit.upload(
        f"{attack}.csv",
        f"# material: {attack}\ntheta_i,phi_i,theta_o,phi_o,{attack}\n".encode()
        + b"".join(b"30,0,%d,180,0.5\n" % theta for theta in range(0, 80, 5)),
    )
    visit.page.get_by_text("16 directions").wait_for()
    assert attack in visit.page.locator("main").inner_text()
    assert visit.page.locator("main img").count() == 0
    assert visit.page.title() == f"{attack}.csv · Lobefit"


def test_inline_scripts_are_forbidden(visit: Visit) -> None:
    visit.page.evaluate(
        """() => { const s = document.createElement("script"); s.textContent = "window.ran = true";
        document.head.append(s); }"""
    )
    assert visit.page.evaluate("window.ran") is None
    assert any("Content Security Policy" in text for text in visit.errors)


def test_a_token_is_asked_for_once(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> None:
    process, address = serve(tmp_path_factory.mktemp("data"), "healthz", "--token", TOKEN)
    try:
        page = browser.new_page()
        page.goto(address)
        field = page.locator("#token")
        field.fill("wrong")
        page.keyboard.press("Enter")
        page.get_by_text("The service refused that token").wait_for()
        field.fill(TOKEN)
        page.keyboard.press("Enter")
        page.get_by_text("Nothing was fitted yet").wait_for()
        page.close()
    finally:
        stop(process)
