"""Opens pages of results in headless Chromium, uses them as a person would, and says what does not work.

Usage: report_page.py CHROMIUM SCREENSHOTS PAGE...; exit status 0 where all is well. SCREENSHOTS is a folder.
"""

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

# Software rendering, and no calls home.
FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-renderer-backgrounding",
    "--no-first-run",
]
# How many colours a canvas shows, and a number that changes with its pixels.
PIXELS = """(id) => {
  const source = document.getElementById(id);
  const canvas = new OffscreenCanvas(source.width, source.height);
  const context = canvas.getContext("2d");
  context.drawImage(source, 0, 0);
  const words = new Uint32Array(context.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
  let sum = 0;
  for (const word of words) sum = (31 * sum + word) >>> 0;
  return { colours: new Set(words).size, sum, inside: words.reduce((n, word) => n + (word >>> 24 > 127), 0) / words.length };
}"""
SETTLED = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


class Page:
    def __init__(self, browser, path, width):
        self.page = browser.new_page(viewport={"width": width, "height": 800})
        self.page.set_default_timeout(120_000)
        self.said = []
        self.page.on("console", lambda message: self.hear(message.type, message.text))
        self.page.on("pageerror", lambda error: self.hear("error", str(error)))
        self.page.on("request", lambda request: self.hear_request(request.url))
        self.page.goto(path.resolve().as_uri())
        self.page.wait_for_selector("html[data-ready]")

    def hear(self, kind, text):
        # Software rendering is slow to read back, and says so.
        if kind in ("error", "warning") and "ReadPixels" not in text:
            self.said.append(f"{kind}: {text}")

    def hear_request(self, url):
        if not url.startswith(("file:", "data:", "blob:")):
            self.said.append(f"request: {url}")

    def pixels(self, canvas):
        self.page.evaluate(SETTLED)
        return self.page.evaluate(PIXELS, canvas)

    def facts(self, element):
        return self.page.evaluate("(id) => ({ ...document.getElementById(id).dataset })", element)

    def changes(self, what, canvas, act):
        before = self.pixels(canvas)["sum"]
        act()
        assert self.pixels(canvas)["sum"] != before, f"{what} changes nothing"

    def centre(self, element):
        box = self.page.locator(element).bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def zoom_out(self):
        self.page.mouse.move(*self.centre("#scene"))
        for _ in range(8):
            self.page.mouse.wheel(0, 300)

    def switch(self, label):
        return self.page.locator("#switches label", has_text=label).locator("input")


def check(page):
    view = page.pixels("scene")
    assert view["colours"] > 200 and 0.02 < view["inside"] < 1, f"the viewer's canvas is blank: {view}"
    facts = page.facts("scene")
    if facts["shape"] == "mesh":
        width, height = map(int, facts["texture"].split("x"))
        assert min(width, height) >= 64 and float(facts["triangles"]) > 100, facts
        page.changes("the wireframe", "scene", lambda: page.switch("wireframe").click())
        page.switch("wireframe").click()
    else:
        assert int(facts["points"]) > 100, facts
        page.changes("showing dots", "scene", lambda: page.switch("dots").click())
        page.switch("dots").click()
    for key in ("plain", "normals"):
        page.changes(key, "scene", lambda: page.page.click(f"#colouring [data-key={key}]"))
    page.page.locator("#colouring button").first.click()
    page.zoom_out()
    page.changes("hiding the cameras", "scene", lambda: page.switch("cameras").click())
    page.switch("cameras").click()
    if page.switch("input's points").count():
        page.changes("showing the input's points", "scene", lambda: page.switch("input's points").click())
        page.switch("input's points").click()

    slider = page.page.locator("#frame")
    before, name = page.facts("picture"), page.page.inner_text("#frame-name")
    slider.focus()
    page.changes("the slider", "picture", lambda: slider.press("ArrowRight"))
    assert int(page.facts("picture")["frame"]) == int(before["frame"]) + 1, page.facts("picture")
    assert page.page.inner_text("#frame-name") != name, "the slider leaves the frame's name"
    for layer in ("picture", "depth"):
        page.changes(layer, "picture", lambda: page.page.click(f"#layer [data-key={layer}]"))
    page.changes("hiding the outline", "picture", lambda: page.page.click("#outline"))
    page.page.click("#outline")
    page.page.click("#layer [data-key=overlay]")

    page.changes("looking through a camera", "scene", lambda: page.page.click("#through"))
    page.changes("the slider, looking through cameras,", "scene", lambda: slider.press("ArrowLeft"))
    page.page.click("#reset")

    def turn():
        x, y = page.centre("#scene")
        page.page.mouse.move(x, y)
        page.page.mouse.down()
        page.page.mouse.move(x + 120, y + 20, steps=4)
        page.page.mouse.up()

    page.changes("dragging", "scene", turn)
    page.changes("the wheel", "scene", lambda: page.page.mouse.wheel(0, -300))
    page.page.click("#reset")
    for chart in ("objective", "style", "agreement", "density", "motion"):
        marks = page.page.locator(f"#{chart} svg :is(path, circle)").count()
        assert marks > 3, f"the chart {chart} is empty"
    assert not page.said, page.said


def main(chromium, screenshots, *paths):
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        for number, path in enumerate(paths):
            page = Page(browser, Path(path), 1100)
            page.page.screenshot(path=f"{screenshots}/{number}.png", full_page=True)
            check(page)
            narrow = Page(browser, Path(path), 420)
            wider = narrow.page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
            narrow.page.screenshot(path=f"{screenshots}/{number}-narrow.png", full_page=True)
            assert wider <= 0, f"{path}: {wider} pixels wider than a telephone"
            assert not narrow.said, narrow.said
            print(f"{path}: {page.facts('scene')}")
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
