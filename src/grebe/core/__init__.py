"""Plain records and pure functions that everything else stands on."""
