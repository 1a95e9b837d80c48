//! Any text as a process plan made into motion: no panic, no program beside an error, every place a number, and the
//! plan can be listed.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let (planned, out) = gr_planner::plan(data, gr_text::FileId(0), &gr_planner::Options::default());
    let failed = out.iter().any(|d| d.severity == gr_text::Severity::Error);
    assert_eq!(planned.is_none(), failed);
    for l in out.iter().flat_map(|d| &d.labels) {
        assert!(l.span.start <= l.span.end && l.span.end as usize <= data.len());
    }
    let Some(planned) = planned else { return };
    for s in planned.program.steps() {
        assert!(s.end.xyz().iter().all(|c| c.is_finite()));
    }
    let _ = gr_planner::table::text(&planned.process, &planned.tools);
    let _ = gr_planner::tool_table(&planned.tools);
});
