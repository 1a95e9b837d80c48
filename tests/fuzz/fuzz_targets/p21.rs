//! Any bytes as an exchange file: no panic, checking and reading agree, formatting is stable on sound files.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let file = gr_p21::parse(data);
    assert_eq!(gr_p21::check_syntax(data), file.faults);
    let index = gr_p21::index(data);
    for e in &index.entries {
        assert!(e.start < e.end && e.end as usize <= data.len());
    }
    for v in &file.values {
        let _ = (file.real(data, *v), file.string(data, *v), file.reference(data, *v), file.enumeration(data, *v));
    }
    for i in &file.instances {
        assert!(i.start <= i.end && i.end as usize <= data.len());
    }
    let once = gr_p21::format(data);
    if file.faults.is_empty() {
        assert_eq!(gr_p21::parse(&once).faults, []);
        assert_eq!(gr_p21::format(&once), once);
    }
    let _ = gr_p21::renumber(data);
});
