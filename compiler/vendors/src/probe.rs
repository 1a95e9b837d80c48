//! What the operator reads where a probe move can't begin or found nothing. Short enough for 24 characters.

/// The input already has the state that would end the move.
pub(crate) const NOT_READY: &str = "The probe is not ready";
/// The move came to its end.
pub(crate) const NOT_TRIPPED: &str = "The probe did not trip";
