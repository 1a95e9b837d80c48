//! Draws every strategy: `cargo run -p gr-toolpath --example plots -- FOLDER` writes one SVG per part and strategy.

use gr_toolpath::*;
use std::fmt::Write as _;

fn d(path: &Path2) -> String {
    let p = path.start();
    let mut out = format!("M{:.4} {:.4}", p.x, -p.y);
    for s in path.segs() {
        let b = s.b();
        match s {
            Seg::Line { .. } => write!(out, "L{:.4} {:.4}", b.x, -b.y),
            Seg::Arc { sweep, .. } => {
                let r = s.radius().unwrap_or(0.0);
                write!(out, "A{r:.4} {r:.4} 0 {} {} {:.4} {:.4}", u8::from(sweep.abs() > 3.141_592_7), u8::from(*sweep < 0.0), b.x, -b.y)
            }
        }
        .expect("a string takes everything");
    }
    out
}

fn svg(region: &Region, passes: &[Pass], r: f64) -> String {
    let b = region.bounds().grown(3.0);
    let size = b.size();
    let mut out = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{:.0}' height='{:.0}' viewBox='{:.2} {:.2} {:.2} {:.2}'><rect x='{:.2}' y='{:.2}' width='200' height='200' fill='white'/>",
        size.x * 10.0, size.y * 10.0, b.min.x, -b.max.y, size.x, size.y, b.min.x, -b.max.y
    );
    let edge: String = region.loops().map(d).collect();
    for p in passes {
        let _ = write!(out, "<path d='{}' stroke='#d8e8f8' stroke-width='{}' stroke-linecap='round' stroke-linejoin='round' fill='none'/>", d(&p.path), 2.0 * r);
    }
    let _ = write!(out, "<path d='{edge}' stroke='#c00' stroke-width='.3' fill='none'/>");
    for p in passes {
        let colour = match p.role {
            Role::Clear => "#06c",
            Role::Wall => "#083",
            Role::Rest => "#c0c",
        };
        let _ = write!(out, "<path d='{}' stroke='{colour}' stroke-width='.2' fill='none'/>", d(&p.path));
        let (s, t) = (p.path.start(), p.path.start_tangent());
        let (a, l, q) = (s + t * 1.2, t.left() * 0.4, s);
        let _ = write!(out, "<path d='M{} {}L{} {}L{} {}Z' fill='{colour}'/>", a.x, -a.y, (q + l).x, -(q + l).y, (q - l).x, -(q - l).y);
        match &p.link {
            Link::Stay(way) => {
                let _ = write!(out, "<path d='{}' stroke='#e80' stroke-width='.25' fill='none'/>", d(way));
            }
            Link::Retract => {
                let _ = write!(out, "<circle cx='{}' cy='{}' r='.5' fill='none' stroke='#000' stroke-width='.15'/>", s.x, -s.y);
            }
        }
    }
    out + "</svg>"
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let rect = |l, w, r| profile::rectangle(l, w, r);
    let islands = vec![rect(14.0, 10.0, 2.0)?.moved(P2::new(-12.0, 4.0)), profile::circle(5.0)?.moved(P2::new(14.0, -5.0))];
    let parts = [
        ("rectangle", Region::new(rect(60.0, 40.0, 0.0)?, vec![])?),
        ("hexagon", Region::new(profile::ngon(50.0, 6, profile::Ngon::Inscribed)?, vec![])?),
        ("islands", Region::new(rect(60.0, 40.0, 6.0)?, islands)?),
        ("circle", Region::new(profile::circle(20.0)?, vec![])?),
    ];
    let ways = [
        ("unidirectional", Strategy::Unidirectional(0.0)),
        ("bidirectional", Strategy::Bidirectional(0.0)),
        ("contour-parallel", Strategy::ContourParallel),
        ("bidirectional-contour", Strategy::BidirectionalContour(0.4)),
        ("contour-bidirectional", Strategy::ContourBidirectional(0.0)),
        ("contour-spiral", Strategy::ContourSpiral),
        ("centre", Strategy::CentreMilling),
    ];
    for (part, region) in &parts {
        for (way, strategy) in ways {
            for (share, step) in [("50", 3.0), ("85", 5.1)] {
                let plan = clear(region, &Clear::new(3.0, step, strategy))?;
                std::fs::write(format!("{folder}/{part}-{way}-{share}.svg"), svg(region, &plan.passes, 3.0))?;
            }
        }
    }
    Ok(())
}
