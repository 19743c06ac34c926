//! The board's settings on the page: refused beside their field, kept, and told.

use host_tests::setup;

use crate::bench::Bench;
use crate::chromium::field;

#[test]
fn settings_are_refused_beside_their_field_kept_and_told() {
    let mut bench = Bench::start();
    bench.show("parameters");
    bench.page.press("Board");
    bench.page.until_text("Nothing is in the flash");
    bench.page.fill("Modbus station", "248");
    bench.page.press("For the next start");
    bench.choose_password();
    bench.page.until_text("1 to 247 is permitted");

    bench.page.fill("Modbus station", "17");
    let select = field("Address");
    bench.page.eval(&format!(
        "(() => {{ const one = {select}; one.value = 'fixed'; \
         one.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
    ));
    bench.page.fill("Address and bits", "192.168.7.9/33");
    bench.page.press("For the next start");
    bench.page.until_text("1 to 30 is permitted");
    bench.page.fill("Address and bits", "192.168.7.9/24");
    bench.page.press("For the next start");
    bench
        .page
        .until_text("The next start has 192.168.7.9/24; 19");
    bench.page.until_text("station 17");
    bench
        .page
        .until_text("in the flash, and there at the next start");
    for (width, height, dark) in [(1440, 900, false), (390, 844, true)] {
        bench.page.screen(width, height, dark);
        let wide = "document.documentElement.scrollWidth - innerWidth";
        assert!(bench.page.eval(wide).as_f64() <= Some(0.0), "{width}");
        let file = setup::scratch(&format!("hmi-board-{width}.png"));
        bench.page.picture(&file.expect("a place"));
    }

    bench.page.screen(1440, 900, false);
    bench.page.press("Empty the flash");
    bench.page.press("Empty it");
    bench.page.until_text("Nothing is in the flash");
}
