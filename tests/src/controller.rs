//! The whole controller of the Debian package `linuxcnc-uspace`, without hardware: a machine of three axes whose joints
//! are where they are wanted, run as a user that the test creates, since LinuxCNC does not want to be root's.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::oracle::{gcc_robot, kept, missing, root};
use crate::process::{Ended, run, start};

/// A folder with a machine in it, and the user that runs it. One at a time: its shared memory has fixed names.
pub struct Controller {
    folder: tempfile::TempDir,
    user: Option<String>,
    /// Shared memory that others had before.
    before: Vec<String>,
    _turn: File,
}

/// Whether a program is there; see [`missing`].
pub fn has(program: &str) -> bool {
    let found = std::env::var_os("PATH")
        .is_some_and(|p| std::env::split_paths(&p).any(|d| d.join(program).is_file()));
    found || missing(program)
}

fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output();
    id.is_ok_and(|o| o.stdout.trim_ascii() == b"0")
}

impl Controller {
    /// A machine whose screen is `display`, with `part` as its program behind our filter.
    pub fn new(display: &str, part: &Path, program: &str) -> Option<Controller> {
        if !has("linuxcnc") || is_root() && !(has("useradd") && has("runuser")) {
            return None;
        }
        let turn = File::create(kept("linuxcnc").join("turn")).ok()?;
        turn.lock().ok()?;
        let folder = tempfile::tempdir().ok()?;
        let mut controller = Controller { folder, user: None, before: shared_memory(), _turn: turn };
        controller.furnish(display, part, program);
        controller.own();
        Some(controller)
    }

    /// A file in the machine's folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn furnish(&self, display: &str, part: &Path, program: &str) {
        let from = root().join("tests/linuxcnc");
        for name in ["machine.hal", "drive.py", "times.py", "watch.py"] {
            std::fs::copy(from.join(name), self.path(name)).expect("the file is in the repository");
        }
        let executable: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o755);
        for name in ["drive.py", "times.py"] {
            let executable = std::fs::Permissions::clone(&executable);
            std::fs::set_permissions(self.path(name), executable).expect("writable");
        }
        std::fs::copy(root().join("docs/linuxcnc/stepnc_viewer.py"), self.path("stepnc_viewer.py")).expect("the viewer");
        std::fs::copy(part, self.path("part.p21")).expect("the part");
        // The user may not be allowed to look into the folder that the program was built in.
        std::fs::copy(gcc_robot(), self.path("gcc-robot")).expect("the binary");
        std::fs::write(self.path("machine.var"), "").expect("writable");
        let folder = self.folder.path().to_string_lossy().into_owned();
        let display = display.replace("@FOLDER@", &folder);
        let filter = format!("{folder}/gcc-robot filter");
        let ini = std::fs::read_to_string(from.join("machine.ini")).expect("the file is in the repository");
        let ini = ini
            .replace("@DISPLAY@", &display)
            .replace("@PROGRAM@", &format!("{folder}/{program}"))
            .replace("@FILTER@", &filter)
            .replace("@FOLDER@", &folder);
        std::fs::write(self.path("machine.ini"), ini).expect("writable");
    }

    /// A user of our own, to whom the folder belongs.
    fn own(&mut self) {
        if !is_root() {
            return;
        }
        let name = format!("gcc-robot-{}", std::process::id());
        let folder = self.folder.path();
        let made = Command::new("useradd").args(["-r", "-M", "-s", "/bin/sh", "-d"]).arg(folder).arg(&name).status();
        assert!(made.is_ok_and(|s| s.success()), "useradd {name}");
        self.user = Some(name.clone());
        self.give();
    }

    /// Files that were added since belong to the user too.
    pub fn give(&self) {
        if let Some(name) = &self.user {
            let given = Command::new("chown").args(["-R", name]).arg(self.folder.path()).status();
            assert!(given.is_ok_and(|s| s.success()), "chown");
        }
    }

    /// The filter by hand: the program as `part.ngc`, and the tool table of the machine.
    pub fn filter(&self) -> Ended {
        let out = run(
            Command::new(self.path("gcc-robot")).args(["filter", "part.p21", "--write-tools", "tool.tbl"]).current_dir(self.folder.path()),
            Duration::from_secs(60),
        )
        .expect("the filter runs");
        std::fs::write(self.path("part.ngc"), &out.stdout).expect("writable");
        self.give();
        out
    }

    fn linuxcnc(&self) -> Command {
        let env = [format!("HOME={}", self.folder.path().display()), "LC_ALL=C".into()];
        let mut c = match &self.user {
            Some(name) => {
                let mut c = Command::new("runuser");
                c.args(["-u", name, "--", "env"]);
                c
            }
            None => Command::new("env"),
        };
        c.args(env).args(["linuxcnc", "-r", "machine.ini"]).current_dir(self.folder.path());
        c
    }

    /// Runs the controller until its screen ends. The real `rs274` makes LinuxCNC's shared memory too, where a program asks
    /// for a HAL value; tests beside this one run it, as another user.
    pub fn run(&self, limit: Duration) -> Ended {
        for _ in 0..10 {
            free_shared_memory();
            let ended = run(&mut self.linuxcnc(), limit).expect("linuxcnc runs");
            if !ended.errors().contains("could not open shared memory") {
                return ended;
            }
            std::thread::sleep(Duration::from_secs(2));
        }
        panic!("LinuxCNC's shared memory stays taken")
    }

    /// Starts the controller on an X display.
    pub fn start(&self, display: &str) -> Child {
        let log = File::create(self.path("log.txt")).expect("writable");
        let also = log.try_clone().expect("a second handle");
        free_shared_memory();
        let mut command = self.linuxcnc();
        start(command.env("DISPLAY", display).stdin(Stdio::null()).stdout(log).stderr(also)).expect("linuxcnc starts")
    }

    /// Waits until a file says what is expected.
    pub fn wait_for(&self, name: &str, seconds: u64, good: impl Fn(&str) -> bool) -> Result<String, String> {
        let start = Instant::now();
        loop {
            let text = std::fs::read_to_string(self.path(name)).unwrap_or_default();
            if good(&text) {
                return Ok(text);
            }
            if start.elapsed() > Duration::from_secs(seconds) {
                let log = std::fs::read_to_string(self.path("log.txt")).unwrap_or_default();
                return Err(format!("{name} says {text:?}; the log:\n{log}"));
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Processes that were started with this folder as home, as far as we may look.
    fn left(&self) -> Vec<String> {
        let home = format!("HOME={}", self.folder.path().display());
        let ours = |pid: &str| {
            let environment = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
            environment.split(|b| *b == 0).any(|v| v == home.as_bytes())
        };
        let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let names = all.filter_map(|e| e.file_name().into_string().ok());
        names.filter(|n| n.bytes().all(|b| b.is_ascii_digit()) && ours(n)).collect()
    }
}

/// Segments of shared memory with a public key, as LinuxCNC's are, that nobody is attached to.
/// Takes away what nobody uses of LinuxCNC's shared memory: whoever made it, others can't open it.
fn free_shared_memory() {
    const KEYS: [&str; 3] = ["0x48484c34", "0x48414c32", "0x90280a48"];
    let list = Command::new("ipcs").arg("-m").output().map(|o| o.stdout).unwrap_or_default();
    for row in String::from_utf8_lossy(&list).lines() {
        if let [key, id, _, _, _, "0", ..] = row.split_whitespace().collect::<Vec<_>>()[..]
            && KEYS.contains(&key)
        {
            let _ = Command::new("ipcrm").args(["-m", id]).stderr(Stdio::null()).status();
        }
    }
}

fn shared_memory() -> Vec<String> {
    let list = Command::new("ipcs").arg("-m").output().map(|o| o.stdout).unwrap_or_default();
    let unused = |row: &str| match row.split_whitespace().collect::<Vec<_>>()[..] {
        [key, id, _, _, _, "0", ..] if key != "0x00000000" => Some(id.to_string()),
        _ => None,
    };
    String::from_utf8_lossy(&list).lines().filter_map(unused).collect()
}

impl Drop for Controller {
    fn drop(&mut self) {
        // The controller's shared memory is the machine's: the next one can't start before this one's is gone.
        for tries in 0..100 {
            let left = self.left();
            if left.is_empty() {
                break;
            }
            if tries >= 50 {
                let _ = Command::new("kill").arg("-KILL").args(&left).status();
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        for id in shared_memory().iter().filter(|id| !self.before.contains(id)) {
            let _ = Command::new("ipcrm").args(["-m", id]).stderr(Stdio::null()).status();
        }
        if let Some(name) = &self.user {
            let _ = Command::new("userdel").arg(name).status();
        }
    }
}

/// An X server without a screen; its picture lies in a file.
pub struct Screen {
    server: Child,
    folder: tempfile::TempDir,
    /// `:N`
    pub display: String,
}

/// A picture: width, height, and red green blue of each pixel.
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub pixels: Vec<[u8; 3]>,
}

impl Screen {
    /// Starts one; none when there is no Xvfb.
    pub fn new(width: usize, height: usize) -> Option<Screen> {
        use std::io::Read as _;
        if !has("Xvfb") {
            return None;
        }
        let folder = tempfile::tempdir().ok()?;
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{width}x{height}x24"), "-fbdir"])
            .arg(folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = Vec::new();
        let mut out = server.stdout.take()?;
        let mut byte = [0];
        while out.read(&mut byte).ok()? == 1 && byte[0] != b'\n' {
            number.push(byte[0]);
        }
        let display = format!(":{}", String::from_utf8_lossy(&number).trim());
        Some(Screen { server, folder, display })
    }

    /// What it shows as soon as it is what is wanted, or at last after half a minute.
    pub fn picture_when(&self, wanted: impl Fn(&Picture) -> bool) -> Picture {
        let start = Instant::now();
        loop {
            let picture = self.picture();
            if wanted(&picture) || start.elapsed() > Duration::from_secs(30) {
                return picture;
            }
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    /// What it shows now (the file is an X window dump).
    pub fn picture(&self) -> Picture {
        let d = std::fs::read(self.folder.path().join("Xvfb_screen0")).expect("the frame buffer");
        let word = |i: usize| u32::from_be_bytes(d[4 * i..4 * i + 4].try_into().expect("four bytes")) as usize;
        let (header, width, height, order, line, colors) = (word(0), word(4), word(5), word(7), word(12), word(19));
        let start = header + 12 * colors;
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let p = &d[start + y * line + 4 * x..][..4];
                pixels.push(if order == 0 { [p[2], p[1], p[0]] } else { [p[1], p[2], p[3]] });
            }
        }
        Picture { width, height, pixels }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

impl Picture {
    /// How many pixels have a color, give or take a little.
    pub fn count(&self, color: [u8; 3]) -> usize {
        self.pixels.iter().filter(|p| p.iter().zip(color).all(|(a, b)| a.abs_diff(b) < 6)).count()
    }
    /// As a portable pixmap, which every viewer reads.
    pub fn ppm(&self) -> Vec<u8> {
        let mut out = format!("P6\n{} {}\n255\n", self.width, self.height).into_bytes();
        out.extend(self.pixels.iter().flatten());
        out
    }
}
