//! Any text read as motion text: no panic, and what is accepted prints and reads back the same.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    let Ok(program) = gr_ir::text::parse(&text) else { return };
    let printed = gr_ir::text::print(&program, true);
    let again = gr_ir::text::parse(&printed).expect("what we print we read");
    assert_eq!(gr_ir::text::print(&again, true), printed);
});
