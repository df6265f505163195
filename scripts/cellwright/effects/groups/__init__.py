"""The search for a missing effect in one branch of a parallel group."""
