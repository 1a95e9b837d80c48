//! How long a pocket takes.
fn main() {
    divan::main();
}
