"""The browser of the tests, without a window."""
import unittest

from selenium import webdriver
from selenium.webdriver.chrome.service import Service


def headless_browser():
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service("chromedriver"), options=options)


class BrowserTest(unittest.TestCase):
    """Tests of a class share one browser."""

    @classmethod
    def setUpClass(cls):
        cls.browser = headless_browser()

    @classmethod
    def tearDownClass(cls):
        cls.browser.quit()

    def script(self, text):
        return self.browser.execute_script("return " + text)
