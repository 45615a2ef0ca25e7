"""The page of a sweep in a headless browser: python3 sweep_page_test.py REPORT.html [unittest's options]."""
import pathlib
import sys
import unittest

from headless import BrowserTest
from selenium.webdriver.support.ui import Select

REPORT = pathlib.Path(sys.argv.pop(1)).resolve()


class SweepPage(BrowserTest):
    def setUp(self):
        self.browser.set_window_size(1200, 1000)
        self.browser.get(REPORT.as_uri())

    def choose(self, name, option):
        Select(self.browser.find_element("id", name)).select_by_visible_text(option)

    def test_no_script_fails(self):
        self.assertEqual([entry["message"] for entry in self.browser.get_log("browser")], [])

    def test_a_cell_for_each_member_of_a_grid(self):
        self.assertEqual(self.script("document.querySelectorAll('#map rect.cell').length"), 24)
        title = self.script("document.querySelector('#map rect.cell title').textContent")
        self.assertIn("g 5", title)

    def test_choices_change_the_map(self):
        before = self.script("document.getElementById('map').innerHTML")
        self.choose("colour", "lambda_rod")
        after = self.script("document.getElementById('map').innerHTML")
        self.assertNotEqual(before, after)
        self.assertIn("lambda_rod over", self.script("document.getElementById('map').getAttribute('aria-label')"))

    def test_bars_hold_all_members(self):
        self.choose("of", "y")
        counts = self.script("[...document.querySelectorAll('#distribution .bar title')].map(t => parseInt(t.textContent))")
        self.assertEqual(sum(counts), 24)

    def test_nothing_is_wider_than_a_phone(self):
        self.browser.set_window_size(390, 800)
        self.assertLessEqual(self.script("document.documentElement.scrollWidth"), self.script("window.innerWidth"))

    def test_texts_of_the_map_do_not_overlap(self):
        wrong = self.script("""(() => {
          const boxes = [...document.querySelectorAll('#map text')].map(node => [node.textContent, node.getBoundingClientRect()]);
          return boxes.flatMap(([a, p], i) => boxes.slice(i + 1).filter(([b, q]) => p.left < q.right && q.left < p.right &&
            p.top < q.bottom && q.top < p.bottom).map(([b]) => a + ' / ' + b));
        })()""")
        self.assertEqual(wrong, [])


if __name__ == "__main__":
    unittest.main()
