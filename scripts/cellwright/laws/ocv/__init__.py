"""The open-circuit voltage over temperature."""
