"""Where and when the mismatch is: missing moments of a recorded motion, impulses, onset, and their description."""
