//! Pictures of the path: SVG, PNG, and a page that can be turned and zoomed. Feed moves, curves and rapids
//! have a colour each; every view has a scale or axes with numbers. A path is thinned to what the picture
//! can show, so that a million moves stay quick and small.

mod chart;
pub mod font;
mod html;
mod path;
mod raster;
mod svg;
pub mod trace;

use gr_ir::Program;
use gr_ir::measure::Rates;
pub use html::page as preview_page;
pub use path::Class;
pub use trace::Trace;

/// What the picture shows.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Show {
    /// From the front right above, from the top and from the front, side by side.
    #[default]
    All,
    /// From the front right above.
    Isometric,
    /// X to the right, Y up.
    Top,
    /// X to the right, Z up.
    Front,
    /// Y to the right, Z up.
    Right,
}

/// How the picture is made.
#[derive(Clone, PartialEq, Debug)]
pub struct Options {
    /// Views.
    pub show: Show,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Heading, usually the file's name.
    pub title: String,
    /// Draw rapids.
    pub rapids: bool,
    /// Page: the program, shown beside the path; may be empty.
    pub text: String,
    /// Rapid rates, and what the machine can do.
    pub rates: Rates,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            show: Show::All,
            width: 1400,
            height: 900,
            title: String::new(),
            rapids: true,
            text: String::new(),
            rates: Rates::default(),
        }
    }
}

/// A PNG picture. `bent`: the path as a machine with joint rapids goes it.
pub fn png(program: &Program, bent: Option<&Trace>, options: &Options) -> Result<Vec<u8>, String> {
    let path = path::Path::new(program, options.rapids, &options.rates).bent(bent, options.rapids);
    let mut canvas = raster::Raster::new(limit(options.width), limit(options.height));
    chart::draw(&path, options, &mut canvas);
    canvas.encode()
}

/// An SVG picture; `bent` as for [`png`].
pub fn svg(program: &Program, bent: Option<&Trace>, options: &Options) -> String {
    let path = path::Path::new(program, options.rapids, &options.rates).bent(bent, options.rapids);
    let mut canvas = svg::Svg::new(limit(options.width), limit(options.height), &options.title);
    chart::draw(&path, options, &mut canvas);
    canvas.finish()
}

/// A page of its own, with the path inside: turn, zoom, play, measure, hide; the program stands beside it.
pub fn html(trace: &Trace, options: &Options) -> String {
    let text = (!options.text.is_empty()).then_some(options.text.as_str());
    html::page(&options.title, Some(trace.json(&options.title, &trace.key(), false)), text)
}

fn limit(pixels: u32) -> u32 {
    pixels.clamp(200, 8192)
}
