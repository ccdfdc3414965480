"""The page in a browser, against the service: what a person sees, does and is told."""

from __future__ import annotations

import json
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


def test_a_chart_made_from_a_measurement_shows_its_front(visit: Visit) -> None:
    page = visit.page
    visit.upload("paint.csv", (SAMPLES / "matte_paint.csv").read_bytes())
    page.get_by_role("button", name="Chart speed against accuracy").click()
    page.locator("select[name=set]").select_option("chosen")
    page.get_by_label("Names").fill("lambert")
    page.get_by_label("Timed runs").fill("1")
    for group in page.locator("input[name=group]").all():
        group.uncheck()
    page.get_by_role("button", name="Make the chart").click()
    page.locator(".front").wait_for(timeout=FIT_MS)
    with page.expect_download() as waiting:
        page.get_by_role("button", name="chart.json").click()
    chart = json.loads(waiting.value.path().read_text(encoding="utf-8"))
    assert page.locator(".said").inner_text() == chart["answer"]
    assert page.locator(".finding").all_inner_texts() == [p["finding"] for p in chart["panels"]]
    front = chart["panels"][0]["front"]
    assert page.locator(".front th[scope=row]").all_inner_texts() == front
    # The fastest choice is the first that the keys reach, and its settings are told.
    page.get_by_role("img", name="How to fit").focus()
    page.keyboard.press("Home")
    fastest = min(chart["panels"][0]["points"], key=lambda p: p["seconds"]["median"])
    assert page.locator(".tip strong").inner_text() == fastest["label"]
    assert f"metric\n{fastest['settings']['metric']}" in page.locator(".tip").inner_text()
    page.keyboard.press("Escape")
    assert not page.locator(".tip").is_visible()
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(300)
    assert visit.wide() <= 0
    page.get_by_role("link", name="Charts").click()
    page.get_by_role("link", name="paint.csv").wait_for()
    assert visit.errors == []


def test_several_files_become_a_batch(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Several at once").select_option("quick")
    names = {"copper.csv": "rough_copper.csv", "paint.csv": "matte_paint.csv"}
    files = {name: (SAMPLES / sample).read_text("utf-8") for name, sample in names.items()}
    dropped = page.evaluate_handle(
        """(files) => { const data = new DataTransfer();
        for (const [name, text] of Object.entries(files)) data.items.add(new File([text], name));
        return data; }""",
        {**files, "leaf.csv": BAD},
    )
    page.dispatch_event(".drop", "drop", {"dataTransfer": dropped})
    page.get_by_role("heading", name="copper.csv and 1 other").wait_for()
    unread = page.get_by_role("region", name="1 file could not be read").inner_text()
    for words in ("leaf.csv", "Row\n4", "Column\ntheta_o", "a number"):
        assert words in unread
    page.get_by_text("All have ended: 2 fits.").wait_for(timeout=FIT_MS)
    rows = page.locator(".batch tbody tr").all_inner_texts()
    assert [row.split()[:2] for row in rows] == [["copper.csv", "done"], ["paint.csv", "done"]]
    assert "ggx:k_s=1 describes this surface to within its noise" in rows[0]
    page.get_by_role("img", name="The batch").wait_for()
    with page.expect_download() as waiting:
        page.get_by_role("button", name="table.csv").click()
    table = waiting.value.path().read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[0] for line in table] == ["name", *names]
    page.get_by_role("link", name="paint.csv").click()
    page.locator(".verdict").wait_for()
    page.get_by_role("link", name="Its batch").click()
    page.get_by_role("region", name="Files and their fits").wait_for()


def drop(page: Any, names: list[str]) -> None:
    script = """(names) => { const data = new DataTransfer();
        for (const name of names) data.items.add(new File(["x"], name));
        return data; }"""
    page.dispatch_event(".drop", "drop", {"dataTransfer": page.evaluate_handle(script, names)})


def test_files_of_any_name_become_a_batch(visit: Visit) -> None:
    page, sent = visit.page, []
    page.route("**/v1/measurements?*", lambda r: r.fulfill(status=201, json={"id": "0" * 64}))

    def batches(route: Any) -> None:
        sent.append(route.request.post_data_json)
        route.fulfill(status=202, json={"id": "none"})

    page.route("**/v1/batches", batches)
    drop(page, ["\U0001f33f" * 250 + ".csv", "a\tb.csv"])
    page.get_by_role("alert").wait_for()  # there is no such batch
    names = [sent[0]["name"], *(item["name"] for item in sent[0]["items"])]
    assert names[0].endswith(" and 1 other") and names[2] == "a?b.csv"
    assert max(map(len, names)) <= 200


def test_a_busy_service_is_not_taken_for_files_that_cannot_be_read(visit: Visit) -> None:
    page, sent = visit.page, []

    def upload(route: Any) -> None:
        sent.append(route.request.url)
        if len(sent) > 1:
            route.fulfill(status=503, json={"title": "The queue is full", "status": 503})
        else:
            route.fulfill(status=201, json={"id": "0" * 64})

    page.route("**/v1/measurements?*", upload)
    page.route("**/v1/batches", lambda route: sent.append("batch"))
    drop(page, [f"{k}.csv" for k in range(40)])
    page.get_by_role("alert").get_by_text("The queue is full").wait_for()
    page.wait_for_timeout(200)
    assert page.get_by_role("alert").is_visible()
    assert "batch" not in sent and len(sent) < 8


@pytest.mark.parametrize(("position", "said"), [(1, "Next in line"), (3, "2 other jobs before")])
def test_a_fit_that_waits_says_how_many_go_before(visit: Visit, position: int, said: str) -> None:
    job: dict[str, Any] = {
        "id": "q",
        "name": None,
        "measurement": None,
        "state": "queued",
        "request": {},
    }
    job |= {"position": position, "artefacts": [], "created": "2026-01-01T00:00:00Z"}
    visit.page.route("**/v1/fits/q", lambda route: route.fulfill(json=job))
    visit.page.route("**/v1/fits/q/events", lambda route: route.fulfill(body=": nothing yet\n\n"))
    visit.page.evaluate("window.location.hash = '#/fits/q'")
    visit.page.get_by_text(said).wait_for()


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
