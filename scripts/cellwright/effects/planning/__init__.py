"""What records can show of an effect, and the test that would show it next."""
