"""Bodies in space on the page of a study, in a headless browser: python3 bodies_page_test.py REPORT.html three|above
[unittest's options]. "three": the build found three.js; "above": it did not, and bodies are shown from above."""
import pathlib
import sys
import time
import unittest

from headless import BrowserTest
from selenium.webdriver.common.action_chains import ActionChains

REPORT, VIEW = pathlib.Path(sys.argv.pop(1)).resolve(), sys.argv.pop(1)
FIGURE = "document.querySelector('figure[data-plot=motion]')"

# Colours of the canvas by number of pixels: a black or empty canvas has one.
COLOURS = """
  const canvas = arguments[0], flat = document.createElement('canvas');
  flat.width = canvas.width; flat.height = canvas.height;
  const ink = flat.getContext('2d');
  ink.drawImage(canvas, 0, 0);
  const pixels = ink.getImageData(0, 0, flat.width, flat.height).data, colours = new Set();
  for (let i = 0; i < pixels.length; i += 16) colours.add(pixels[i] << 16 | pixels[i + 1] << 8 | pixels[i + 2]);
  return colours.size;"""


class BodiesPage(BrowserTest):
    def setUp(self):
        self.browser.set_window_size(1200, 1000)
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia",
                                     {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]})
        self.browser.execute_cdp_cmd("Network.enable", {})
        self.browser.execute_cdp_cmd("Network.emulateNetworkConditions",
                                     {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0})
        self.browser.get(REPORT.as_uri())
        self.browser.execute_script(FIGURE + ".scrollIntoView()")
        time.sleep(0.5)

    def canvas(self):
        return self.browser.find_element("css selector", "figure[data-plot=motion] canvas")

    def picture(self):
        return self.script(FIGURE + ".querySelector('canvas').toDataURL()")

    def place(self):
        return self.script(FIGURE + ".bodyView.meshes.find(mesh => mesh.name === 'top').quaternion.toArray()")

    def camera(self):
        return self.script(FIGURE + ".bodyView.camera.position.toArray()")

    def test_no_script_fails(self):
        severe = [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(severe, [])

    def test_nothing_is_fetched(self):
        self.assertEqual(self.script("performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length"), 0)


class InSpace(BodiesPage):
    def test_the_bodies_are_drawn(self):
        self.assertGreater(self.browser.execute_script(COLOURS, self.canvas()), 50)
        blank = self.script("document.body.appendChild(Object.assign(document.createElement('canvas'), {width: 99, height: 99}))")
        self.assertLess(self.browser.execute_script(COLOURS, blank), 2)  # what the check calls empty

    def test_dragging_turns_the_view(self):
        before, picture = self.camera(), self.picture()
        ActionChains(self.browser).move_to_element(self.canvas()).click_and_hold().move_by_offset(120, 40).release().perform()
        after = self.camera()
        self.assertGreater(sum(abs(a - b) for a, b in zip(before, after)), 0.1)
        self.assertNotEqual(picture, self.picture())

    def distance(self):
        return self.script(FIGURE + ".bodyView.camera.position.length()")

    def test_the_wheel_and_keys_zoom(self):
        before = self.distance()
        self.script(FIGURE + ".querySelector('canvas').dispatchEvent(new WheelEvent('wheel', {deltaY: -300, cancelable: true}))")
        time.sleep(0.2)
        nearer = self.distance()
        self.assertLess(nearer, 0.97 * before)
        self.canvas().send_keys("-")
        self.assertGreater(self.distance(), nearer)

    def test_it_plays_and_stops(self):
        before = self.place()
        time.sleep(0.3)
        self.assertEqual(self.place(), before)  # less motion is preferred
        self.script(FIGURE + ".querySelector('.tools button').click()")
        time.sleep(0.6)
        self.assertNotEqual(self.place(), before)
        self.script(FIGURE + ".querySelector('.tools button').click()")
        stopped = self.place()
        time.sleep(0.3)
        self.assertEqual(self.place(), stopped)

    def test_the_slider_goes_to_a_time(self):
        self.script("(slider => { slider.value = slider.max; slider.dispatchEvent(new Event('input')); })(" + FIGURE +
                    ".querySelector('input[type=range]'))")
        shown = self.place()
        end = self.script("data.histories[0].motion.solids[0].coordinates.slice(3).map(i => data.histories[0].motion.values[i].at(-1))")
        for wanted, value in zip(end[1:] + end[:1], shown):
            self.assertAlmostEqual(wanted, value, places=4)

    def test_it_fits_a_phone(self):
        self.browser.set_window_size(390, 800)
        time.sleep(0.4)
        self.assertLessEqual(self.script("document.documentElement.scrollWidth"), max(390, self.script("window.innerWidth")))

    def test_without_webgl_bodies_are_shown_from_above(self):
        self.browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument",
                                     {"source": """
          const context = HTMLCanvasElement.prototype.getContext;
          HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
            return kind.startsWith('webgl') ? null : context.call(this, kind, ...rest);
          };"""})
        self.browser.get(REPORT.as_uri())
        self.browser.execute_script(FIGURE + ".scrollIntoView()")
        time.sleep(0.5)
        self.assertTrue(self.script(FIGURE + ".querySelector('svg.picture') !== null"))
        self.assertTrue(self.script(FIGURE + ".querySelector('canvas') === null"))


class FromAbove(BodiesPage):
    def test_the_motion_is_drawn(self):
        self.assertGreater(self.script(FIGURE + ".querySelectorAll('svg .series path').length"), 0)


if VIEW == "three":
    del FromAbove
else:
    del InSpace

if __name__ == "__main__":
    del BodiesPage  # unittest runs what is left
    unittest.main()
