"""The report of a study in a headless browser: python3 report_test.py REPORT.html [unittest's options].

A check is a function that returns what is wrong. Each is run on the page as it is, and again after a fault was
planted, which it must find.
"""
import base64
import pathlib
import sys
import time
import unittest

from headless import BrowserTest

PHONE, DESKTOP, PAPER = 390, 1200, 680

# What the checks use, defined anew in each page.
TOOLS = """
window.tools = {
  boxes: (root, selector) => [...root.querySelectorAll(selector)].map(node => ({node, text: node.textContent,
    box: node.getBoundingClientRect()})).filter(({box}) => box.width > 0),
  overlap: (a, b, by = 0.5) => a.left < b.right - by && b.left < a.right - by && a.top < b.bottom - by && b.top < a.bottom - by,
  luminance: rgb => rgb.slice(0, 3).map(c => c / 255).map(c => c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0),
  colour: text => { const n = text.match(/[\\d.]+/g).map(Number); return n.length < 4 ? [...n, 1] : n; },
  background: node => {
    for (let at = node; at; at = at.parentElement) {
      const colour = tools.colour(getComputedStyle(at).backgroundColor);
      if (colour[3] > 0) return colour;
    }
    return [255, 255, 255, 1];
  },
};
"""

AXES = """
return [...document.querySelectorAll('figure')].flatMap(figure => {
  const labels = [...figure.querySelectorAll('svg text.axis')].map(label => label.textContent);
  const wanted = figure.dataset.plot === 'summary' ? 1 : 2, curves = figure.querySelectorAll('svg .series path').length;
  const unit = label => /\\[[^\\]]+\\]/.test(label) || /units in the legend/.test(label);
  const ticks = figure.querySelectorAll('svg text.tick').length;
  return labels.length === wanted && labels.every(unit) && curves > 0 && ticks >= 2 ? [] :
    [`${figure.dataset.description}: labels ${JSON.stringify(labels)}, ${curves} curves, ${ticks} ticks`];
});"""

LEGENDS = """
return [...document.querySelectorAll('figure')].flatMap(figure => {
  const several = figure.querySelectorAll('svg .series').length > 1, keys = figure.querySelectorAll('svg .key').length;
  return several && keys < 1 && figure.dataset.plot !== 'motion' ? [`${figure.dataset.description}: no legend`] : [];
});"""

OVERLAPS = """
return [...document.querySelectorAll('svg.picture')].flatMap(svg => {
  const texts = tools.boxes(svg, 'text'), frame = svg.getBoundingClientRect(), wrong = [];
  const plot = svg.querySelector('clipPath rect'), size = name => Number(plot.getAttribute(name));
  const zoom = frame.width / svg.viewBox.baseVal.width;
  const area = {left: frame.left + zoom * (size('x') + 6), top: frame.top + zoom * (size('y') + 6),
    right: frame.left + zoom * (size('x') + size('width') - 6), bottom: frame.top + zoom * (size('y') + size('height') - 6)};
  texts.forEach((a, i) => {
    const {left, right, top, bottom} = a.box;
    if (left < frame.left - 1 || right > frame.right + 1 || top < frame.top - 1 || bottom > frame.bottom + 1)
      wrong.push(`'${a.text}' leaves the picture ${svg.getAttribute('aria-label')}`);
    if (a.node.closest('.key') && tools.overlap(a.box, area)) wrong.push(`the key '${a.text}' lies on the curves`);
    texts.slice(i + 1).filter(b => tools.overlap(a.box, b.box))
      .forEach(b => wrong.push(`'${a.text}' over '${b.text}' in ${svg.getAttribute('aria-label')}`));
  });
  return wrong;
});"""

COLOURS = """
const ofMethod = new Map();
document.querySelectorAll('figure[data-plot=work] .key, figure[data-plot=orders] .key').forEach(key => {
  const method = key.textContent.split(',')[0], colour = getComputedStyle(key.querySelector('path')).stroke;
  ofMethod.set(method, (ofMethod.get(method) || new Set()).add(colour));
});
document.querySelectorAll('figure[data-plot=error]').forEach(figure => {
  const method = data.histories[figure.dataset.scene].method, curve = figure.querySelector('.series path');
  ofMethod.get(method).add(getComputedStyle(curve).stroke);
});
const several = [...ofMethod].filter(([, colours]) => colours.size > 1).map(([method]) => `${method} has several colours`);
const all = [...ofMethod].map(([, colours]) => [...colours][0]);
return all.length < 3 ? ['too few methods'] : new Set(all).size < all.length ? ['two methods of one colour'] : several;"""

SORTING = """
const value = cell => cell.dataset.value === undefined ? cell.textContent : cell.dataset.value === '' ? null : Number(cell.dataset.value);
const rising = list => list.every((v, i) => i === 0 || v === null || (list[i - 1] !== null &&
  (typeof v === 'string' ? list[i - 1].localeCompare(v, 'en', {numeric: true}) <= 0 : list[i - 1] <= v)));
const falling = list => { const there = list.filter(v => v !== null); return rising(there.reverse()); };
return [...document.querySelectorAll('table')].flatMap((table, t) => [...table.tHead.rows].at(-1).cells.length === 0 ? ['no head'] :
  [...[...table.tHead.rows].at(-1).cells].flatMap((head, column) => {
    const read = () => [...table.tBodies[0].rows].map(row => value(row.cells[column]));
    head.querySelector('button').click();
    const up = rising(read()) && head.getAttribute('aria-sort') === 'ascending';
    head.querySelector('button').click();
    const down = falling(read()) && head.getAttribute('aria-sort') === 'descending';
    return up && down ? [] : [`table ${t}, column ${head.textContent}`];
  }));"""

CONTRAST = """
const seen = new Set(), wrong = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode.parentElement, style = getComputedStyle(node);
  if (!walker.currentNode.textContent.trim() || node.closest('script') || !node.getClientRects().length) continue;
  const ink = tools.colour(node.closest('svg') ? style.fill : style.color), paper = tools.background(node);
  const [a, b] = [tools.luminance(ink), tools.luminance(paper)], ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  seen.add(String(paper));
  if (ratio < 4.5) wrong.push(`${ratio.toFixed(2)}: '${walker.currentNode.textContent.trim().slice(0, 40)}'`);
}
return seen.size ? wrong : ['no text'];"""

CURVES_VISIBLE = """
return [...document.querySelectorAll('svg .key path')].flatMap(path => {
  const a = tools.luminance(tools.colour(getComputedStyle(path).stroke)), b = tools.luminance(tools.background(path.closest('figure')));
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  return ratio >= 2.5 ? [] : [`${ratio.toFixed(2)}: the key ${path.closest('.key').textContent}`];
});"""

WIDTH = f"""
const wide = document.documentElement.scrollWidth;
const small = tools.boxes(document, 'svg text').filter(({{box, node}}) => Math.min(box.width, box.height) < 11 && node.textContent.length > 1);
return (wide > {PHONE} ? [`the page is ${{wide}} wide`] : []).concat(small.map(({{text}}) => `'${{text}}' is too small`));"""

ON_PAPER = """
const edge = document.body.getBoundingClientRect().right + 1;
const cut = [...document.querySelectorAll('table, figure svg, dl')].filter(node => node.getBoundingClientRect().right > edge)
  .map(node => `a ${node.tagName} is cut: ${node.textContent.slice(0, 40)}`);
const split = [...document.querySelectorAll('tbody tr, figure')].filter(node => getComputedStyle(node).breakInside !== 'avoid');
const closed = document.querySelectorAll('details:not([open])').length, tools = document.querySelector('.tools');
return cut.concat(split.length ? ['rows or pictures may be cut'] : [], closed ? ['closed details'] : [],
  getComputedStyle(tools).display === 'none' ? [] : ['buttons on paper']);"""

FILES = """
return [...document.querySelectorAll('svg.picture')].flatMap(svg => {
  const text = svgText(svg), file = new DOMParser().parseFromString(text, 'image/svg+xml');
  return file.querySelector('parsererror') || text.includes('var(') ? [`no file of ${svg.getAttribute('aria-label')}`] : [];
}).concat(csvText(data.studies).trim().split('\\n').length === 1 + data.studies.reduce((n, s) => n + s.rows.length, 0) ? [] :
  ['the CSV lacks rows']);"""


class Report(BrowserTest):
    page = None

    def open(self, width=DESKTOP, scheme="light", media="", motion="reduce"):
        command = self.browser.execute_cdp_cmd
        command("Emulation.setDeviceMetricsOverride",
                {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width == PHONE})
        command("Emulation.setEmulatedMedia", {"media": media, "features": [
            {"name": "prefers-color-scheme", "value": scheme}, {"name": "prefers-reduced-motion", "value": motion}]})
        self.browser.get(self.page.as_uri())
        self.run_script(TOOLS)

    def run_script(self, script):
        return self.browser.execute_script(script)

    def check(self, script, fault):
        """Nothing is wrong with the page, and something is once the fault is planted."""
        self.assertEqual(self.run_script(script), [])
        self.run_script(fault)
        self.assertNotEqual(self.run_script(script), [], "the planted fault was not found")

    def errors(self):
        return [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]

    def test_no_error_on_the_console(self):
        self.open()
        self.assertEqual(self.errors(), [])
        self.run_script("setTimeout(() => nothing.there, 0)")
        time.sleep(0.2)
        self.assertNotEqual(self.errors(), [])

    def test_axes_have_labels_with_units(self):
        self.open()
        self.check(AXES, "document.querySelector('figure[data-plot=error] text.axis').textContent = 'time'")

    def test_several_curves_have_a_legend(self):
        self.open()
        self.check(LEGENDS, "document.querySelector('figure[data-plot=history] .legend').remove()")

    def test_no_text_lies_on_another(self):
        for width in (DESKTOP, 700, PHONE):
            with self.subTest(width=width):
                self.open(width)
                self.check(OVERLAPS, "document.querySelector('figure[data-plot=work] .key').setAttribute('transform', 'translate(90,60)')")
                self.open(width)
                self.check(OVERLAPS, "document.querySelectorAll('figure[data-plot=work] .key')[1].setAttribute('transform',"
                           "document.querySelector('figure[data-plot=work] .key').getAttribute('transform'))")

    def test_each_method_has_a_colour_of_its_own(self):
        self.open()
        self.check(COLOURS, "document.querySelector('figure[data-plot=work] .key path').style.stroke = '#123456'")

    def test_tables_sort(self):
        self.open()
        self.check(SORTING, "document.addEventListener('click', event => event.stopPropagation(), true)")

    def test_fits_a_phone(self):
        self.open(PHONE)
        self.check(WIDTH, "document.querySelector('h1').style.minWidth = '500px'")

    def test_is_readable_by_day_and_by_night(self):
        for scheme in ("light", "dark"):
            with self.subTest(scheme=scheme):
                self.open(scheme=scheme)
                self.check(CONTRAST, "document.querySelector('h1').style.color = '#777777'")
                self.check(CURVES_VISIBLE, "document.querySelector('.key path').style.stroke = 'var(--paper)'")
        self.assertLess(self.run_script("return tools.luminance(tools.background(document.querySelector('h1')))"), 0.05)

    def test_is_whole_on_paper(self):
        self.open(PAPER, media="print")
        self.run_script("window.dispatchEvent(new Event('beforeprint'))")
        self.check(ON_PAPER, "document.querySelector('th').style.minWidth = '700px'")
        self.open()
        pdf = base64.b64decode(self.browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})["data"])
        self.assertTrue(pdf.startswith(b"%PDF"))
        self.assertGreater(pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page "), 2)

    def test_pictures_and_data_can_be_saved(self):
        self.open()
        self.check(FILES, "document.querySelector('svg.picture path').setAttribute('style', 'fill:var(--x y)')")

    def test_values_show_under_the_pointer(self):
        self.open()
        show = """
          const svg = document.querySelector('figure[data-plot=work] svg'), box = svg.closest('figure').querySelector('.values');
          const at = svg.querySelector('.series path[transform]').getBoundingClientRect();
          svg.dispatchEvent(new PointerEvent('pointermove', {clientX: at.x + at.width / 2, clientY: at.y + at.height / 2 + %d}));
          return box.hidden ? '' : box.textContent;"""
        for word in ("step", "error of q", "CPU"):
            self.assertIn(word, self.run_script(show % 0))
        self.assertEqual(self.run_script(show % -2000), "")

    def motion(self):
        return self.run_script("const bar = document.querySelector('figure[data-plot=motion] .tools');"
                               "return [bar.querySelector('button').textContent, bar.querySelector('output').value,"
                               "document.querySelector('figure[data-plot=motion] svg g:last-of-type').innerHTML]")

    def test_motion_waits_where_less_is_preferred(self):
        self.open()
        self.run_script("document.querySelector('figure[data-plot=motion]').scrollIntoView()")
        time.sleep(0.3)
        before = self.motion()
        time.sleep(0.3)
        self.assertEqual(self.motion(), before)
        self.assertIn("Play", before[0])
        self.run_script("document.querySelector('figure[data-plot=motion] .tools button').click()")
        time.sleep(0.5)
        after = self.motion()
        self.assertIn("Pause", after[0])
        self.assertNotEqual(after[1:], before[1:])

    def test_motion_plays_else(self):
        self.open(motion="no-preference")
        self.run_script("document.querySelector('figure[data-plot=motion]').scrollIntoView()")
        time.sleep(0.3)
        before = self.motion()
        time.sleep(0.4)
        self.assertNotEqual(self.motion()[1], before[1])


if __name__ == "__main__":
    Report.page = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
