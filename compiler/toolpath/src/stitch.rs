//! Joins loose segments into closed curves.
