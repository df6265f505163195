"""What jobs stand on: artefacts, provenance, contract, sheets, settings, tables, page."""
