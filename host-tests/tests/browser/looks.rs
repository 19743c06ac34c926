//! How the page loads and looks: nothing broken, nothing from elsewhere, everything named, readable and reachable.
//!
//! Not here: beauty. The pictures that these tests write are for people to look at.

use host_tests::setup;

use crate::bench::{Bench, LIVE};
use crate::chromium::Page;

const PAGES: [&str; 11] = [
    "machine",
    "trends",
    "parameters",
    "autotune",
    "drive",
    "faults",
    "link",
    "session",
    "training",
    "acceptance",
    "health",
];
/// Phone, tablet, desktop, and in the dark: width and height, px, and whether it is dark.
const SCREENS: [(u32, u32, bool); 4] = [
    (390, 844, true),
    (820, 1180, false),
    (1440, 900, false),
    (1440, 900, true),
];

/// Text whose contrast is below what WCAG 2.2 asks for (1.4.3, level AA), with its ratio.
///
/// Colours are read back from a canvas, so that every notation is understood. A text's ground is the nearest opaque
/// one behind it; in the mimic it is the shape that it lies on.
const FAINT: &str = r#"(() => {
  const canvas = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true });
  const colour = (name) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = name;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], [R, G, B]) => [r * a + R * (1 - a), g * a + G * (1 - a), b * a + B * (1 - a)];
  const luminance = (rgb) => rgb.map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (element) => {
    if (!element) return [255, 255, 255];
    const own = colour(getComputedStyle(element).backgroundColor);
    return own[3] === 1 ? own.slice(0, 3) : over(own, ground(element.parentElement));
  };
  const faint = [];
  for (const element of document.querySelectorAll('body *')) {
    const text = [...element.childNodes].filter((n) => n.nodeType === 3).map((n) => n.data.trim()).join('');
    if (!text || element.closest(':disabled, .hidden, noscript, option, canvas')) continue;
    if (!element.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
    const box = element.getBoundingClientRect();
    if (!box.width || !box.height) continue;
    const style = getComputedStyle(element);
    const svg = element instanceof SVGElement;
    let behind = ground(svg ? element.closest('svg').parentElement : element);
    if (svg) {
      element.scrollIntoView({ block: 'center' });
      const now = element.getBoundingClientRect();
      const shape = document.elementsFromPoint(now.x + now.width / 2, now.y + now.height / 2)
        .find((e) => e instanceof SVGElement && e.tagName !== 'text' && e.tagName !== 'svg' && getComputedStyle(e).fill !== 'none');
      if (shape) behind = over(colour(getComputedStyle(shape).fill), behind);
    }
    let front = colour(svg ? style.fill : style.color);
    for (let e = element; e; e = e.parentElement) front = [...front.slice(0, 3), front[3] * Number(getComputedStyle(e).opacity)];
    const [a, b] = [luminance(over(front, behind)), luminance(behind)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5)) faint.push(`${ratio.toFixed(2)} ${element.tagName}.${element.className.baseVal ?? element.className} "${text.slice(0, 40)}"`);
  }
  scrollTo(0, 0);
  return faint;
})()"#;

/// What can be operated now, and is seen, in the order of the page.
const OPERATED: &str = "[...document.querySelectorAll('a[href], button, input, select, [tabindex=\"0\"]')]\
    .filter((e) => !e.disabled && e.tabIndex >= 0 && e.checkVisibility())";

fn strings(page: &mut Page, expression: &str) -> Vec<String> {
    let list = page.eval(expression);
    let texts = list.as_array().expect("a list").iter();
    texts
        .map(|text| text.as_str().unwrap_or_default().to_owned())
        .collect()
}

/// With a set being wound, so that there is something to see.
fn winding() -> Bench {
    let mut bench = Bench::start();
    bench.thread();
    bench.run(1200, 900);
    bench
}

/// How much wider than the window the page is, when all that moves has come to six digits and a sign.
const LONG_NUMBERS: &str = "(() => { \
    for (const e of document.querySelectorAll('main .num b, main td.n b')) \
        if (e.firstChild?.nodeType === 3) e.firstChild.data = '\u{2212}888 888'; \
    return document.documentElement.scrollWidth - innerWidth; })()";

#[test]
fn every_page_is_whole_readable_and_named_at_every_width() {
    let mut bench = winding();
    for (width, height, dark) in SCREENS {
        let scheme = if dark { "dark" } else { "light" };
        bench.page.screen(width, height, dark);
        for name in PAGES {
            bench.show(name);
            bench.page.until("!document.querySelector('main .wait')");
            if name == "link" {
                // every register has come
                bench.page.until(
                    "[...document.querySelectorAll('.registers td:nth-child(3)')].every((t) => t.textContent.trim() !== '–')",
                );
            }
            let file = setup::scratch(&format!("hmi-{name}-{width}-{scheme}.png"));
            bench.page.picture(&file.expect("a place"));

            let at = format!("{name} at {width} px, {scheme}");
            let wide = bench.page.eval(LONG_NUMBERS);
            assert!(wide.as_f64() <= Some(0.0), "{at} is {wide} px too wide");
            let faint = strings(&mut bench.page, FAINT);
            assert!(faint.is_empty(), "{at}, too faint:\n{}", faint.join("\n"));
            let controls = bench.page.controls();
            assert!(controls.len() > PAGES.len(), "{at}: {controls:?}");
            let nameless = controls.iter().filter(|(_, name)| name.trim().is_empty());
            let nameless: Vec<_> = nameless.collect();
            assert!(nameless.is_empty(), "{at}, without a name: {nameless:?}");
        }
    }
    let complaints = bench.page.complaints();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    let own = [bench.url().to_owned(), bench.url().replace("http:", "ws:")];
    let elsewhere: Vec<_> = bench
        .page
        .requests()
        .into_iter()
        .filter(|url| !own.iter().any(|own| url.starts_with(own)) && !url.starts_with("blob:"))
        .collect();
    assert!(elsewhere.is_empty(), "{elsewhere:?}");
}

#[test]
fn every_control_is_reached_by_keyboard_and_shows_it() {
    let mut bench = winding();
    for name in PAGES {
        bench.show(name);
        bench.page.until("!document.querySelector('main .wait')");
        let count = bench
            .page
            .eval(&format!("(window.operated = {OPERATED}).length"));
        let count = count.as_u64().expect("a number");
        assert!(count > 10, "{name}: {count}");
        bench.page.eval(
            "document.activeElement.blur(); document.body.focus(); window.reached = new Set(); 0",
        );
        // once around, and the address bar between
        for _ in 0..count + 5 {
            bench.page.key("Tab");
            let plain = bench.page.eval(
                "(() => { const e = document.activeElement; window.reached.add(e); \
                 return e !== document.body && getComputedStyle(e).outlineStyle === 'none' ? e.outerHTML.slice(0, 80) : null; })()",
            );
            assert!(plain.is_null(), "{name}, no sign of focus: {plain}");
        }
        let missed = strings(
            &mut bench.page,
            "window.operated.filter((e) => e.isConnected && !e.disabled && !window.reached.has(e)).map((e) => e.outerHTML.slice(0, 100))",
        );
        assert!(missed.is_empty(), "{name}, not reached: {missed:?}");
    }
}

/// Not a verdict, which a busy PC could not give: the figure is written for who compares.
#[test]
fn the_first_paint_is_measured() {
    let mut bench = Bench::start();
    let mut paints = Vec::new();
    for _ in 0..5 {
        bench
            .page
            .call("Network.clearBrowserCache", serde_json::json!({}));
        let url = format!("http://{}/?{}", bench.http(), paints.len());
        bench.page.go(&url);
        bench
            .page
            .until("performance.getEntriesByName('first-contentful-paint').length === 1");
        let at = bench
            .page
            .eval("performance.getEntriesByName('first-contentful-paint')[0].startTime");
        paints.push(at.as_f64().expect("a time"));
        bench.page.until(LIVE);
    }
    paints.sort_by(f64::total_cmp);
    let text = format!("first contentful paint, ms, of five: {paints:.0?}\n");
    eprint!("{text}");
    std::fs::write(
        setup::scratch("hmi-first-paint.txt").expect("a place"),
        text,
    )
    .expect("a file");
    // something is drawn before any script has come
    let drawn = bench.page.eval(
        "fetch('/').then((a) => a.text()).then((t) => /<header[^]*Simulated/.test(t) && !/<script(?![^>]*src=)/.test(t))",
    );
    assert_eq!(drawn, true);
}
