/// Numbered and named parameters.
#[derive(Clone, Debug, Default)]
pub struct Params {}

impl Params {
    /// Value of a numbered parameter; 0 outside 1 … 5601.
    pub fn get(&self, _index: u32) -> f64 {
        0.0
    }
    /// Sets a numbered parameter.
    pub fn set(&mut self, _index: u32, _value: f64) {}
}
