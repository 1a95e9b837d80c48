//! The command line as data.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::render::MessageFormat;

/// Compiler toolchain for G-code: checks, explains, formats, compares and translates programs.
#[derive(Parser, Debug)]
#[command(name = "gcc-robot", version, max_term_width = 100, arg_required_else_help = true)]
#[command(after_help = "Exit status: 0 done, 1 errors or differences found, 2 wrong usage, 3 files can't be read or written.")]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// For every command.
    #[command(flatten)]
    pub global: Global,
}

/// Options of every command.
#[derive(Args, Debug, Clone)]
pub struct Global {
    /// How diagnostics are written
    #[arg(long, global = true, value_enum, default_value_t, value_name = "FORMAT")]
    pub message_format: MessageFormat,
    /// When to use colours
    #[arg(long, global = true, value_enum, default_value_t, value_name = "WHEN")]
    pub color: When,
    /// No summary and no progress
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

/// When to use colours.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, Default)]
pub enum When {
    /// On a terminal, unless NO_COLOR is set
    #[default]
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

/// The commands.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Check programs and report everything that is wrong or doubtful
    Check(CheckArgs),
    /// Translate programs: normalised G-code, robot programs, canonical calls, dumps, plots
    Build(Box<BuildArgs>),
    /// Explain a diagnostic (E0203), a G-code (G83) or a word letter
    Explain(ExplainArgs),
    /// Format programs: case, blanks, indentation; comments stay
    Fmt(FmtArgs),
    /// Give lines new N numbers
    Renumber(RenumberArgs),
    /// Draw the path of the tool
    Preview(PreviewArgs),
    /// Compare two programs as motion: paths, tools, feeds, time
    Diff(DiffArgs),
    /// Prove that a translation moves the machine as its source does
    Verify(VerifyArgs),
    /// What error the machine will make along a program
    Accuracy(AccuracyArgs),
    /// A map of the machine's work space: reach, errors, stiffness, singularities
    Map(MapArgs),
    /// The best place for a part in the machine's work space
    Place(PlaceArgs),
    /// List and show what `build --target` can make
    Target(TargetArgs),
    /// List, show and check machines
    Machine(MachineArgs),
    /// Filter of LinuxCNC: a STEP-NC file becomes G-code on standard output, with the tools of the machine
    Filter(FilterArgs),
    /// Stand in for LinuxCNC's rs274: same options, output, messages and exit status
    Rs274(Rs274Args),
    /// Write a project file gcc-robot.toml
    Init(InitArgs),
    /// Language server on standard input and output, for editors
    Lsp(LspArgs),
    /// Print a completion script for a shell
    Completions(CompletionsArgs),
}

/// The machine and its controller, as far as a program depends on them.
#[derive(Args, Debug, Clone, Default)]
pub struct SetupArgs {
    /// Dialect: linuxcnc, linuxcnc-2.10, fanuc-mill, fanuc-turn, grbl, ufmg2008 [default: by extension]
    #[arg(long, value_name = "NAME")]
    pub dialect: Option<String>,
    /// Machine: an id such as generic/mill3, or the path of a machine file
    #[arg(long, value_name = "MACHINE")]
    pub machine: Option<String>,
    /// Tool table (.tbl); without one every tool exists, without length and diameter
    #[arg(short = 't', long, value_name = "FILE")]
    pub tools: Option<PathBuf>,
    /// Stored parameters (.var); read only
    #[arg(long, value_name = "FILE")]
    pub vars: Option<PathBuf>,
    /// INI file of the machine
    #[arg(short = 'i', long, value_name = "FILE")]
    pub ini: Option<PathBuf>,
    /// Length unit of the machine: of tool table and stored parameters [default: INI file's, else mm]
    #[arg(long, value_enum, value_name = "UNIT")]
    pub machine_units: Option<UnitArg>,
    /// Skip lines that begin with /
    #[arg(long)]
    pub block_delete: bool,
    /// Folder with subroutine files; may be given several times
    #[arg(long = "subs", value_name = "FOLDER")]
    pub subs: Vec<PathBuf>,
    /// STEP-NC: how feeds, speeds and angles are meant [default: as the standard says; an error where speeds contradict it]
    #[arg(long, value_enum, value_name = "UNITS")]
    pub step_units: Option<StepUnits>,
    /// STEP-NC: how the overlap of two passes is meant [default: a ratio; millimetres in step-modeler's units]
    #[arg(long, value_enum, value_name = "HOW")]
    pub step_overlap: Option<StepOverlap>,
}

/// How STEP-NC files write the overlap of two passes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StepOverlap {
    /// Share of the tool's diameter, 0 to 1: ISO 14649
    Ratio,
    /// Percent of the diameter: the printed example of ISO 14649-11
    Percent,
    /// Millimetres: STEP Modeler
    Mm,
}

impl From<StepOverlap> for gr_planner::Overlap {
    fn from(o: StepOverlap) -> gr_planner::Overlap {
        match o {
            StepOverlap::Ratio => gr_planner::Overlap::Ratio,
            StepOverlap::Percent => gr_planner::Overlap::Percent,
            StepOverlap::Mm => gr_planner::Overlap::Millimetres,
        }
    }
}

/// Units of technology in STEP-NC files.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StepUnits {
    /// m/s, 1/s, degrees: ISO 14649
    Iso,
    /// m/min, rpm, mm/rev, radians: STEP Modeler
    StepModeler,
}

impl From<StepUnits> for gr_planner::Units {
    fn from(u: StepUnits) -> gr_planner::Units {
        match u {
            StepUnits::Iso => gr_planner::Units::Iso,
            StepUnits::StepModeler => gr_planner::Units::StepModeler,
        }
    }
}

/// A length unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UnitArg {
    /// Millimetres
    Mm,
    /// Inches
    Inch,
}

/// How severe findings are.
#[derive(Args, Debug, Clone, Default)]
pub struct LintArgs {
    /// Warnings count as errors
    #[arg(long)]
    pub strict: bool,
    /// Never mention this lint (code or slug); may be given several times
    #[arg(long, value_name = "CODE")]
    pub allow: Vec<String>,
    /// Mention this lint although it is off by default; may be given several times
    #[arg(long, value_name = "CODE")]
    pub warn: Vec<String>,
    /// Treat this lint as an error; may be given several times
    #[arg(long, value_name = "CODE")]
    pub deny: Vec<String>,
}

#[derive(Args, Debug)]
pub struct CheckArgs {
    /// Programs and folders; `-` is standard input [default: the project's sources]
    #[arg(value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    #[command(flatten)]
    pub setup: SetupArgs,
    #[command(flatten)]
    pub lints: LintArgs,
    /// Job file, which gives parts of the program to setups with their own placement of the part
    #[arg(long, value_name = "FILE")]
    pub job: Option<PathBuf>,
    /// Number of files checked at a time [default: number of processors]
    #[arg(short, long, value_name = "N")]
    pub jobs: Option<std::num::NonZeroUsize>,
}

#[derive(Args, Debug, Clone)]
pub struct BuildArgs {
    /// Programs [default: sources and targets of gcc-robot.toml]
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Folder whose gcc-robot.toml says what to build [default: the nearest one at or above this folder]
    #[arg(long, value_name = "FOLDER")]
    pub project: Option<PathBuf>,
    /// What to make; `gcc-robot target list` shows all [default: rs274ngc]
    #[arg(long, value_name = "TARGET")]
    pub target: Option<String>,
    /// Where the result goes: a file, a folder, or `-` for standard output [default: standard output]
    #[arg(short, long, value_name = "PATH")]
    pub output: Option<PathBuf>,
    /// Build again whenever a source changes
    #[arg(long)]
    pub watch: bool,
    /// Write a rule for make and ninja that names every file read
    #[arg(long, value_name = "FILE")]
    pub depfile: Option<PathBuf>,
    #[command(flatten)]
    pub setup: SetupArgs,
    #[command(flatten)]
    pub lints: LintArgs,
    #[command(flatten)]
    pub options: crate::emit::TargetOptions,
    /// Begin at this line of the program: what was in force there is set, and the tool approaches from above
    #[arg(long, value_name = "LINE", value_parser = clap::value_parser!(u32).range(1..))]
    pub from_line: Option<u32>,
    /// Height of the approach for --from-line, mm in the work frame [default: highest point of the program]
    #[arg(long, value_name = "MM", requires = "from_line", allow_negative_numbers = true)]
    pub safe_z: Option<f64>,
}

#[derive(Args, Debug)]
#[command(mut_args(|a| crate::emit::hidden_unless(a, &[])))]
pub struct FilterArgs {
    /// STEP-NC file (or program)
    pub file: PathBuf,
    /// Number the tools here and write a tool table for them; an older one is kept as FILE.bak
    #[arg(long, value_name = "FILE", conflicts_with = "tools")]
    pub write_tools: Option<PathBuf>,
    #[command(flatten)]
    pub setup: SetupArgs,
    #[command(flatten)]
    pub options: crate::emit::TargetOptions,
}

#[derive(Args, Debug)]
pub struct FmtArgs {
    /// Programs and folders; `-` reads standard input and writes standard output
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Write nothing; say which files would change (exit status 1 if any)
    #[arg(long)]
    pub check: bool,
    /// Dialect [default: by extension]
    #[arg(long, value_name = "NAME")]
    pub dialect: Option<String>,
    #[command(flatten)]
    pub style: StyleArgs,
}

/// How programs are laid out.
#[derive(Args, Debug, Clone)]
pub struct StyleArgs {
    /// Case of words and functions
    #[arg(long, value_enum, default_value = "upper", value_name = "CASE")]
    pub case: CaseArg,
    /// Case of O-words and their keywords
    #[arg(long, value_enum, default_value = "lower", value_name = "CASE")]
    pub o_word_case: CaseArg,
    /// No blanks between words
    #[arg(long)]
    pub no_spaces: bool,
    /// Blanks per level of nesting
    #[arg(long, default_value_t = 2, value_name = "N", value_parser = up_to::<32>)]
    pub indent: usize,
    /// Zeros in front of numbers
    #[arg(long, value_enum, default_value = "keep", value_name = "HOW")]
    pub leading_zeros: ZerosArg,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum CaseArg {
    Keep,
    Upper,
    Lower,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum ZerosArg {
    Keep,
    Strip,
    Pad,
}

#[derive(Args, Debug)]
pub struct RenumberArgs {
    /// Program; `-` is standard input
    pub file: PathBuf,
    /// First number
    #[arg(long, default_value_t = 10)]
    pub start: u32,
    /// Distance of numbers
    #[arg(long, default_value_t = 10)]
    pub step: u32,
    /// Number lines that have no number yet, too
    #[arg(long)]
    pub all: bool,
    /// Where the result goes; the program's own name is allowed [default: standard output]
    #[arg(short, long, value_name = "PATH")]
    pub output: Option<PathBuf>,
    /// Dialect [default: by extension]
    #[arg(long, value_name = "NAME")]
    pub dialect: Option<String>,
}

#[derive(Args, Debug)]
pub struct PreviewArgs {
    /// Program
    pub file: PathBuf,
    /// Picture: .svg, .png or .html
    #[arg(short, long, value_name = "PATH", required_unless_present = "serve")]
    pub output: Option<PathBuf>,
    /// Serve the picture as a page on this computer that follows the file
    #[arg(long, conflicts_with = "output")]
    pub serve: bool,
    /// With --serve: follow an editor by JSON lines on standard input, answer on standard output
    #[arg(long, requires = "serve")]
    pub editor: bool,
    /// What is shown (.svg, .png)
    #[arg(long, value_enum, default_value = "all", conflicts_with = "serve")]
    pub view: ViewArg,
    /// Width in pixels (.svg, .png)
    #[arg(long, default_value_t = 1400, conflicts_with = "serve")]
    pub width: u32,
    /// Height in pixels (.svg, .png)
    #[arg(long, default_value_t = 900, conflicts_with = "serve")]
    pub height: u32,
    /// Leave out rapids (.svg, .png)
    #[arg(long, conflicts_with = "serve")]
    pub no_rapids: bool,
    #[command(flatten)]
    pub setup: SetupArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum ViewArg {
    All,
    Isometric,
    Top,
    Front,
    Right,
}

#[derive(Args, Debug)]
pub struct DiffArgs {
    /// First program
    pub a: PathBuf,
    /// Second program
    pub b: PathBuf,
    /// Greatest distance between equal paths, mm, and as many degrees of rotary axes
    #[arg(long, value_name = "MM", default_value_t = 1e-6)]
    pub tolerance: f64,
    /// Greatest difference of feeds, speeds and times, as a share
    #[arg(long, value_name = "SHARE", default_value_t = 1e-6)]
    pub rate: f64,
    /// Compare in the work frame, for programs made for other offsets
    #[arg(long)]
    pub work_frame: bool,
    /// Differences listed at most
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    /// Dialect of the second program, when it differs
    #[arg(long, value_name = "NAME")]
    pub second_dialect: Option<String>,
    #[command(flatten)]
    pub setup: SetupArgs,
}

#[derive(Args, Debug)]
#[command(mut_args(|a| crate::emit::hidden_unless(a, &crate::commands::diff::ROBOT_OPTIONS)))]
pub struct VerifyArgs {
    /// Program
    pub file: PathBuf,
    /// For a robot (--machine): folder for the table of points and the pictures of errors, joints and speeds
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub setup: SetupArgs,
    #[command(flatten)]
    pub options: crate::emit::TargetOptions,
}

#[derive(Args, Debug)]
pub struct ExplainArgs {
    /// E0203, arc/radius-mismatch, G83, M6, F …
    #[arg(required_unless_present = "list")]
    pub name: Option<String>,
    /// Dialect of G-codes and words
    #[arg(long, value_name = "NAME", default_value = "linuxcnc")]
    pub dialect: String,
    /// List all diagnostics
    #[arg(long, conflicts_with = "name")]
    pub list: bool,
}

#[derive(Args, Debug)]
pub struct TargetArgs {
    #[command(subcommand)]
    pub action: TargetAction,
}

#[derive(Subcommand, Debug)]
pub enum TargetAction {
    /// List all targets
    List,
    /// Show one target and its options
    Show { id: String },
}

#[derive(Args, Debug)]
pub struct MachineArgs {
    #[command(subcommand)]
    pub action: MachineAction,
}

#[derive(Subcommand, Debug)]
pub enum MachineAction {
    /// List the machines that come with the program
    List,
    /// Describe a machine
    Show {
        /// An id, or the path of a machine file
        machine: String,
        /// Print the machine file itself
        #[arg(long)]
        toml: bool,
    },
    /// Check machine files
    Check {
        /// Machine files
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Make a machine file of a URDF
    Import {
        /// URDF file
        file: PathBuf,
        /// Id of the new machine: maker/model
        #[arg(long, default_value = "my/robot", value_name = "ID", value_parser = machine_id)]
        id: String,
        /// Link that the arm ends at [default: `tool0` or `flange`, else the longest chain of moving joints]
        #[arg(long, value_name = "LINK")]
        tip: Option<String>,
        /// Where the machine file goes [default: standard output]
        #[arg(short, long, value_name = "PATH")]
        output: Option<PathBuf>,
    },
}

#[derive(Args, Debug)]
pub struct InitArgs {
    /// Folder of the project
    #[arg(default_value = ".")]
    pub folder: PathBuf,
    /// Overwrite an existing project file
    #[arg(long)]
    pub force: bool,
}

#[derive(Args, Debug)]
pub struct CompletionsArgs {
    /// Shell
    pub shell: clap_complete::Shell,
}

/// The options of the real rs274, and which LinuxCNC it stands in for.
#[derive(Args, Debug, Clone)]
#[command(disable_help_flag = true)]
pub struct Rs274Args {
    /// Options and files as for rs274, and --linuxcnc 2.9|2.10
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    pub arguments: Vec<std::ffi::OsString>,
}

/// Options of `lsp`.
#[derive(Args, Debug)]
pub struct LspArgs {
    /// Accepted because editors pass it; there is no other way
    #[arg(long)]
    pub stdio: bool,
}

/// Options of `accuracy`.
#[derive(Args, Debug, Clone)]
pub struct AccuracyArgs {
    /// Program: G-code or STEP-NC
    pub file: PathBuf,
    /// How it is read
    #[command(flatten)]
    pub setup: SetupArgs,
    /// Where the part's origin is in the machine's base [default: as the machine file says]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub part: Option<String>,
    /// Tolerance, plus or minus, mm [default: that of the STEP-NC feature, else of its workpiece]
    #[arg(long, value_name = "MM")]
    pub tolerance: Option<f64>,
    /// Grade of ISO 286-1 of the machine's geometry, in place of its file's
    #[arg(long = "it", value_name = "GRADE", value_parser = clap::value_parser!(u8).range(1..=18))]
    pub grade: Option<u8>,
    /// Material of the part [default: that of the STEP-NC file]
    #[arg(long, value_name = "NAME")]
    pub material: Option<String>,
    /// Depth of cut along the tool, where the program states none, mm
    #[arg(long, value_name = "MM")]
    pub depth: Option<f64>,
    /// Width of cut across the tool, where the program states none, mm
    #[arg(long, value_name = "MM")]
    pub width: Option<f64>,
    /// Teeth of the mills, where the program states none
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    pub teeth: Option<f64>,
    /// Point angle of the drills, where the program states none, degrees; such drills have two lips
    #[arg(long, value_name = "DEGREES")]
    pub point: Option<f64>,
    /// Diameter of the tools, where neither program nor tool table states it, mm
    #[arg(long, value_name = "MM")]
    pub diameter: Option<f64>,
    /// Deviations of the geometry, such as ls1x=0.0077,lu2y=-0.013 (mm or degrees), in place of the worst pattern of the
    /// tolerances
    #[arg(long, value_name = "NAME=VALUE,…", allow_hyphen_values = true)]
    pub deviations: Option<String>,
    /// Map of the errors by joints and geometry over the work space, at the height of the largest error (.png, .svg, .csv)
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How the report is written
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    pub format: TableFormat,
    /// Where to write it [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The model of a publication
    #[arg(long, value_enum, value_name = "SYSTEM")]
    pub reference: Option<AccuracyReference>,
}

/// How a table is written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, Default)]
pub enum TableFormat {
    /// For people
    #[default]
    Text,
    /// One object
    Json,
    /// One row per line
    Csv,
}

/// Publications with a model of accuracy.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum AccuracyReference {
    /// Gojtan, EPUSP 2009: cones of the spherical joints fixed in the base, tolerances by the formula of chapter 7
    Usp2009,
}

/// Options of `map`.
#[derive(Args, Debug, Clone)]
pub struct MapArgs {
    /// Machine: an id such as usp/2ups-prp, or the path of a machine file
    #[arg(long, value_name = "MACHINE")]
    pub machine: String,
    /// workspace, condition, singularity, manipulability, norm, kinematic[-x|-y|-z], geometric[-x|-y|-z], elastic[-x|-y|-z], total,
    /// total-rss, stiffness, or sensitivity (bars)
    #[arg(long, value_name = "NAME", default_value = "workspace")]
    pub quantity: String,
    /// Plane of the base (with a turning table: of the part's frame on it): x=…, y=… or z=…, mm
    #[arg(long, value_name = "AXIS=MM", default_value = "z=0")]
    pub plane: String,
    /// Picture or table: its ending says which (.png, .svg, .csv); may be given several times
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Nodes along each side [default: 400, for bars 120]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(2..=4000))]
    pub resolution: Option<u32>,
    /// Force on the tool, N: three numbers along X, Y and Z of the same frame, for deflections
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub force: Option<String>,
    /// Deviations of the geometry, such as ls1x=0.0077,lu2y=-0.013 (mm or degrees); without them the worst pattern of the
    /// tolerances
    #[arg(long, value_name = "NAME=VALUE,…", allow_hyphen_values = true)]
    pub deviations: Option<String>,
    /// Signs of the joint errors, such as +-+; without them the worst pattern
    #[arg(long, value_name = "SIGNS", allow_hyphen_values = true)]
    pub signs: Option<String>,
    /// Grade of ISO 286-1 of the machine's geometry, in place of its file's
    #[arg(long = "it", value_name = "GRADE", value_parser = clap::value_parser!(u8).range(1..=18))]
    pub grade: Option<u8>,
    /// What is held: the tool of the machine file with this number; without one the nose of the spindle, or the flange
    #[arg(long, value_name = "NUMBER", conflicts_with = "tool_length")]
    pub tool: Option<u32>,
    /// What is held: the length of a tool that the machine file does not have, mm
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub tool_length: Option<f64>,
    /// How the tool is turned, as by the words A, B and C, degrees; without it straight down on arms, upright on mills
    #[arg(long, value_name = "A,B,C", allow_hyphen_values = true)]
    pub tool_turn: Option<String>,
    /// Where a mill's part was touched, in the base, mm: errors by the geometry count from there [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub zero: Option<String>,
    /// The model of a publication: its grid of 5 mm too
    #[arg(long, value_enum, value_name = "SYSTEM")]
    pub reference: Option<AccuracyReference>,
}

/// Options of `place`.
#[derive(Args, Debug, Clone)]
pub struct PlaceArgs {
    /// Program whose path must be within reach; without one the largest rectangle of stock is looked for
    pub file: Option<PathBuf>,
    /// How it is read
    #[command(flatten)]
    pub setup: SetupArgs,
    /// What is best
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub aim: PlaceAim,
    /// Heights of the rectangle: a number or two, mm
    #[arg(long, value_name = "FROM,TO", default_value = "0", allow_hyphen_values = true)]
    pub heights: String,
    /// Without a program: the tool of the machine file with this number; without one the nose of the spindle, or the flange
    #[arg(long, value_name = "NUMBER", conflicts_with = "tool_length")]
    pub tool: Option<u32>,
    /// Without a program: the length of a tool that the machine file does not have, mm
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    pub tool_length: Option<f64>,
    /// Without a program: how the tool is turned, as by the words A, B and C, degrees; without it straight down on arms, upright on mills
    #[arg(long, value_name = "A,B,C", allow_hyphen_values = true)]
    pub tool_turn: Option<String>,
    /// How the result is written
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    pub format: TableFormat,
    /// The model of a publication
    #[arg(long, value_enum, value_name = "SYSTEM")]
    pub reference: Option<AccuracyReference>,
}

/// What the best place is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, Default)]
pub enum PlaceAim {
    /// Furthest from where the reach ends
    #[default]
    Margin,
    /// Smallest error
    Error,
}

/// The id of a machine of one's own.
fn machine_id(text: &str) -> Result<String, &'static str> {
    if gr_machine::good_id(text) { Ok(text.to_string()) } else { Err(gr_machine::ID_FORM) }
}

/// A number of at most `MOST`.
pub fn up_to<const MOST: usize>(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| *n <= MOST).ok_or_else(|| format!("a whole number from 0 to {MOST} is wanted"))
}
